"""Wilcoxon's signed-rank test on paired results, corrected for how many tests were made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

LEVEL = 0.05
"""Differences with a corrected p under this count."""


@dataclass(frozen=True)
class Comparison:
    """One method against another over the same runs.

    Parameters
    ----------
    difference : float
        Median of this minus the other; negative where this is better.
    p : float
        Of the two-sided signed-rank test.
    corrected : float
        p after Holm's correction over the whole family of tests.
    sign : int
        Sign of the sum of signed ranks: -1 where this is better, by whatever the test says.
    """

    difference: float
    p: float
    corrected: float
    sign: int

    @property
    def verdict(self) -> int:
        """-1: this is better (lower); 1: worse; 0: no difference that the runs can tell."""
        return self.sign if self.corrected < LEVEL else 0


def signed_rank(first: ArrayLike, second: ArrayLike) -> tuple[float, int]:
    """Two-sided p of Wilcoxon's signed-rank test of paired samples, and the sign of the signed ranks' sum.

    Pairs without a difference are dropped (Wilcoxon's way); without any other, p is 1.
    """
    from scipy.stats import rankdata, wilcoxon

    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    differences = differences[differences != 0.0]
    if differences.size == 0:
        return 1.0, 0
    total = float(np.sum(np.sign(differences) * rankdata(np.abs(differences))))
    return float(wilcoxon(differences).pvalue), int(np.sign(total))


def holm(p: ArrayLike) -> NDArray[np.float64]:
    """Holm's step-down correction (Scandinavian Journal of Statistics 6, 1979) of a family's p values (T,)."""
    values = np.asarray(p, dtype=np.float64)
    order = np.argsort(values, kind="stable")
    scaled = values[order] * np.arange(len(values), 0, -1)
    corrected = np.empty_like(values)
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return corrected


def compare_all(pairs: Sequence[tuple[ArrayLike, ArrayLike]]) -> list[Comparison]:
    """Test each pair of samples; all tests are one family."""
    tests = [signed_rank(first, second) for first, second in pairs]
    corrected = holm([p for p, _ in tests])
    return [
        Comparison(float(np.median(np.asarray(first) - np.asarray(second))), p, float(q), sign)
        for (first, second), (p, sign), q in zip(pairs, tests, corrected, strict=True)
    ]


def fewest_pairs(tests: int) -> int:
    """Pairs from which the clearest result, all differences of one sign, can be a difference among so many tests."""
    pairs = 1
    while tests * 2.0 ** (1 - pairs) >= LEVEL:
        pairs += 1
    return pairs
