"""Confidence intervals of what trials measure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

_DRAWS_AT_ONCE = 1_000_000


@dataclass(frozen=True)
class Interval:
    """An estimate and its confidence interval.

    Parameters
    ----------
    value : float
        The estimate; NaN where there was nothing to estimate it from.
    low, high : float
        Ends of the interval.
    """

    value: float
    low: float
    high: float


def bootstrap_interval(
    values: ArrayLike,
    statistic: Literal["mean", "median"] = "mean",
    *,
    seed: int = 0,
    confidence: float = 0.95,
    resamples: int = 2000,
) -> Interval:
    """Percentile bootstrap of a mean or median.

    Parameters
    ----------
    values : array_like (N,)
        A sample; all finite.
    statistic : {"mean", "median"}
        What to estimate.
    seed : int
        Of the resampling: the same seed and values give the same interval.
    confidence : float
        Share of such intervals that hold the true value, in (0, 1).
    resamples : int
        How many samples of size N to draw with replacement.

    Returns
    -------
    Interval
        All NaN for an empty sample; of no width for a sample of one.
    """
    sample = np.asarray(values, dtype=np.float64)
    if sample.size == 0:
        return Interval(math.nan, math.nan, math.nan)
    apply = np.mean if statistic == "mean" else np.median
    rng = np.random.default_rng(np.random.SeedSequence([seed, sample.size]))
    batch = max(1, _DRAWS_AT_ONCE // sample.size)
    drawn = np.empty(resamples)
    for start in range(0, resamples, batch):
        stop = min(start + batch, resamples)
        chosen = rng.integers(0, sample.size, size=(stop - start, sample.size))
        drawn[start:stop] = apply(sample[chosen], axis=1)
    tail = (1.0 - confidence) / 2.0
    low, high = np.quantile(drawn, [tail, 1.0 - tail])
    return Interval(float(apply(sample)), float(low), float(high))


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> Interval:
    """Interval of a success ratio (Wilson, JASA 22, 1927); sensible at 0 and 1 too.

    Parameters
    ----------
    successes, trials : int
        ``0 <= successes <= trials``.
    confidence : float
        In (0, 1).

    Returns
    -------
    Interval
        The ratio and its interval; NaN and [0, 1] without trials.

    Raises
    ------
    ValueError
        If there are more successes than trials, or fewer than none.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes in {trials} trials")
    if trials == 0:
        return Interval(math.nan, 0.0, 1.0)
    z = NormalDist().inv_cdf(0.5 + confidence / 2.0)
    ratio = successes / trials
    scale = 1.0 + z * z / trials
    centre = (ratio + z * z / (2 * trials)) / scale
    half = z / scale * math.sqrt(ratio * (1.0 - ratio) / trials + z * z / (4 * trials * trials))
    # Rounding must not push the ends past the ratio itself when that is 0 or 1.
    return Interval(ratio, max(0.0, min(centre - half, ratio)), min(1.0, max(centre + half, ratio)))
