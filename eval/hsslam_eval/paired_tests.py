"""Tests of two matchers on the same trials, and the price of making many of them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class PairedTest:
    """One matcher against another by one measure.

    Parameters
    ----------
    count : int
        Trials that both have.
    difference : float
        First minus second: of the shares for McNemar's test, the median difference for the signed rank test.
    effect : float
        In [-1, 1], its sign that of the difference. Signed ranks: matched-pairs rank-biserial correlation. McNemar:
        share of the trials decided for the first minus that for the second, of those in which they differ.
    p : float
        Two-sided; 1 where the two never differ.
    wins, losses : int
        Trials in which the first has the larger value, and the smaller one.
    """

    count: int
    difference: float
    effect: float
    p: float
    wins: int
    losses: int


def signed_rank(first: ArrayLike, second: ArrayLike) -> PairedTest:
    """Wilcoxon's signed rank test (Biometrics Bulletin 1, 1945); pairs without a difference are dropped.

    Parameters
    ----------
    first, second : array_like (N,)
        Of the same trials; trials in which either is not finite are left out.
    """
    from scipy.stats import rankdata, wilcoxon

    differences = np.asarray(first, dtype=np.float64) - np.asarray(second, dtype=np.float64)
    differences = differences[np.isfinite(differences)]
    count = len(differences)
    median = float(np.median(differences)) if count else math.nan
    decided = differences[differences != 0.0]
    if not len(decided):
        return PairedTest(count, median, 0.0, 1.0, 0, 0)
    ranks = rankdata(np.abs(decided))
    effect = float(np.sum(np.sign(decided) * ranks) / np.sum(ranks))
    wins = int(np.sum(decided > 0.0))
    return PairedTest(count, median, effect, float(wilcoxon(decided).pvalue), wins, len(decided) - wins)


def mcnemar(first: ArrayLike, second: ArrayLike) -> PairedTest:
    """McNemar's test (Psychometrika 12, 1947) in its exact form, on successes of the same trials.

    Parameters
    ----------
    first, second : array_like of bool (N,)
        Whether each succeeded.
    """
    from scipy.stats import binomtest

    one, other = np.asarray(first, dtype=np.bool_), np.asarray(second, dtype=np.bool_)
    wins, losses = int(np.sum(one & ~other)), int(np.sum(~one & other))
    decided = wins + losses
    difference = (wins - losses) / len(one) if len(one) else math.nan
    if not decided:
        return PairedTest(len(one), difference, 0.0, 1.0, 0, 0)
    p = float(binomtest(wins, decided, 0.5).pvalue)
    return PairedTest(len(one), difference, (wins - losses) / decided, p, wins, losses)


def holm(p: ArrayLike) -> NDArray[np.float64]:
    """Correct the p values (T,) of a family of tests (Holm, Scandinavian Journal of Statistics 6, 1979)."""
    values = np.asarray(p, dtype=np.float64)
    order = np.argsort(values, kind="stable")
    scaled = values[order] * np.arange(len(values), 0, -1)
    corrected = np.empty_like(values)
    corrected[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return corrected
