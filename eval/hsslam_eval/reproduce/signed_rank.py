"""Wilcoxon's signed-rank test on paired results, corrected for how many tests were made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hsslam_eval import paired_tests
from hsslam_eval.paired_tests import holm

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
    found = paired_tests.signed_rank(first, second)
    return found.p, int(np.sign(found.effect))


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
