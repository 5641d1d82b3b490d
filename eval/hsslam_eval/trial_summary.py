"""What the trials of a matcher come to."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hsslam_eval.statistics import Interval, bootstrap_interval, wilson_interval

if TYPE_CHECKING:
    from hsslam_eval.trials import TrialResult


@dataclass(frozen=True)
class Spread:
    """Mean and median of an error over ``count`` trials, each with its bootstrap interval."""

    count: int
    mean: Interval
    median: Interval


@dataclass(frozen=True)
class SuccessSummary:
    """How often a matcher succeeded by one definition, and how precise it was when it did.

    Parameters
    ----------
    name : str
        The threshold's.
    displacement_limit_m, rotation_limit_rad : float
        The definition.
    successes : int
        Trials that succeeded.
    ratio : Interval
        Their share of all trials, with Wilson's interval.
    displacement_m, rotation_deg : Spread
        Errors over the successful trials.
    """

    name: str
    displacement_limit_m: float
    rotation_limit_rad: float
    successes: int
    ratio: Interval
    displacement_m: Spread
    rotation_deg: Spread


@dataclass(frozen=True)
class TrialSummary:
    """The figures of one matcher.

    Parameters
    ----------
    matcher, protocol : str
        What was tried, and where the truth is from.
    trials : int
        How many were run.
    seed : int
        Of pairs, guesses and the matcher's random numbers.
    half_xy_m, half_theta_deg : float
        The box that guesses were drawn from.
    confidence : float
        Of every interval.
    success : dict of SuccessSummary
        By the threshold's name, in the config's order.
    displacement_m, rotation_deg : Spread
        Errors over all trials; where there was no answer, those of the guess.
    initial_displacement_m, initial_rotation_deg : float
        Mean error of the guesses.
    match_seconds_median, match_seconds_mean : float
        Wall time of a match, reference prepared (s).
    prepare_seconds_median, prepare_seconds_mean : float
        Wall time of preparing a reference (s).
    evaluations_mean : float
        Fitness evaluations or iterations, over the trials in which the matcher did not raise.
    failures : dict
        Reasons for trials without an answer, and how many trials each cost.
    """

    matcher: str
    protocol: str
    trials: int
    seed: int
    half_xy_m: float
    half_theta_deg: float
    confidence: float
    success: dict[str, SuccessSummary]
    displacement_m: Spread
    rotation_deg: Spread
    initial_displacement_m: float
    initial_rotation_deg: float
    match_seconds_median: float
    match_seconds_mean: float
    prepare_seconds_median: float
    prepare_seconds_mean: float
    evaluations_mean: float
    failures: dict[str, int]

    def to_dict(self) -> dict[str, Any]:
        """Plain nested data for JSON; figures that do not exist (no success, say) are None."""
        plain = _without_nan(asdict(self))
        assert isinstance(plain, dict)
        return plain


def summarise(result: TrialResult) -> TrialSummary:
    """Work out the figures of the trials of one matcher."""
    config = result.config
    rotation_deg = np.degrees(result.rotation)

    def spread(values: NDArray[np.float64]) -> Spread:
        mean, median = (
            bootstrap_interval(
                values, statistic, seed=config.seed, confidence=config.confidence, resamples=config.resamples
            )
            for statistic in ("mean", "median")
        )
        return Spread(len(values), mean, median)

    success = {}
    for threshold in config.thresholds:
        good = result.success(threshold)
        success[threshold.name] = SuccessSummary(
            name=threshold.name,
            displacement_limit_m=threshold.displacement,
            rotation_limit_rad=threshold.rotation,
            successes=int(good.sum()),
            ratio=wilson_interval(int(good.sum()), len(result), config.confidence),
            displacement_m=spread(result.displacement[good]),
            rotation_deg=spread(rotation_deg[good]),
        )
    seconds, prepare = (times[np.isfinite(times)] for times in (result.seconds, result.prepare_seconds))
    return TrialSummary(
        matcher=result.matcher,
        protocol=result.protocol,
        trials=len(result),
        seed=config.seed,
        half_xy_m=config.half_xy,
        half_theta_deg=config.half_theta_deg,
        confidence=config.confidence,
        success=success,
        displacement_m=spread(result.displacement),
        rotation_deg=spread(rotation_deg),
        initial_displacement_m=float(result.initial_displacement.mean()),
        initial_rotation_deg=float(np.degrees(result.initial_rotation).mean()),
        match_seconds_median=_or_nan(np.median, seconds),
        match_seconds_mean=_or_nan(np.mean, seconds),
        prepare_seconds_median=_or_nan(np.median, prepare),
        prepare_seconds_mean=_or_nan(np.mean, prepare),
        evaluations_mean=_or_nan(np.mean, result.evaluations[np.isfinite(result.seconds)]),
        failures=dict(Counter(reason for reason in result.failures if reason).most_common()),
    )


def _or_nan(statistic: Any, values: NDArray[Any]) -> float:
    return float(statistic(values)) if len(values) else float("nan")


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(inner) for key, inner in value.items()}
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
