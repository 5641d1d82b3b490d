"""Trials of a matcher: a pair of scans with a known truth, a guess that is off, and how the matcher does."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.matching import Matcher
from hsslam.se2 import Pose, between, wrap
from hsslam_eval.protocols import TrialPair, make_pairs
from hsslam_eval.trial_config import SuccessThreshold, TrialConfig
from hsslam_eval.trial_summary import TrialSummary, summarise

__all__ = [
    "SuccessThreshold",
    "TrialConfig",
    "TrialOutcome",
    "TrialPair",
    "TrialResult",
    "make_pairs",
    "run_trial",
    "run_trials",
    "trial_guess",
    "warm_up",
]


@dataclass(frozen=True)
class TrialOutcome:
    """One trial of one matcher.

    Parameters
    ----------
    displacement : float
        Distance of the answer from the truth (m). Without an answer the guess stands in for it.
    rotation : float
        Absolute difference of its heading from the true one (rad).
    initial_displacement, initial_rotation : float
        The same of the guess.
    seconds : float
        Wall time of the match, the reference being prepared (s); NaN where the matcher raised.
    prepare_seconds : float
        Wall time of preparing the reference (s); NaN where the matcher raised there.
    evaluations : int
        As the matcher reported.
    score : float
        As in `hsslam.matching.MatchResult`.
    converged : bool
        As the matcher reported.
    failure : str
        Why there is no answer: the matcher raised, or its answer was rejected; empty where there is one.
    """

    displacement: float
    rotation: float
    initial_displacement: float
    initial_rotation: float
    seconds: float
    prepare_seconds: float
    evaluations: int
    score: float
    converged: bool
    failure: str = ""


@dataclass(frozen=True, eq=False)
class TrialResult:
    """All trials of one matcher, an entry of each array per trial; units and meaning as in `TrialOutcome`.

    Parameters
    ----------
    matcher : str
        What reports call it.
    protocol : str
        Where the truth is from.
    config : TrialConfig
        What the trials were run with.
    """

    matcher: str
    protocol: str
    config: TrialConfig
    displacement: NDArray[np.float64]
    rotation: NDArray[np.float64]
    initial_displacement: NDArray[np.float64]
    initial_rotation: NDArray[np.float64]
    seconds: NDArray[np.float64]
    prepare_seconds: NDArray[np.float64]
    evaluations: NDArray[np.int64]
    score: NDArray[np.float64]
    converged: NDArray[np.bool_]
    failures: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.displacement)

    @classmethod
    def gather(
        cls, matcher: str, protocol: str, config: TrialConfig, outcomes: Iterable[TrialOutcome]
    ) -> TrialResult:
        """Put single outcomes together."""
        rows = list(outcomes)

        def column(name: str, dtype: type) -> NDArray[Any]:
            return np.array([getattr(row, name) for row in rows], dtype=dtype)

        return cls(
            matcher=matcher,
            protocol=protocol,
            config=config,
            displacement=column("displacement", np.float64),
            rotation=column("rotation", np.float64),
            initial_displacement=column("initial_displacement", np.float64),
            initial_rotation=column("initial_rotation", np.float64),
            seconds=column("seconds", np.float64),
            prepare_seconds=column("prepare_seconds", np.float64),
            evaluations=column("evaluations", np.int64),
            score=column("score", np.float64),
            converged=column("converged", np.bool_),
            failures=tuple(row.failure for row in rows),
        )

    @property
    def answered(self) -> NDArray[np.bool_]:
        """Whether there was an answer at all, (T,)."""
        return np.array([not failure for failure in self.failures], dtype=np.bool_)

    def success(self, threshold: SuccessThreshold) -> NDArray[np.bool_]:
        """Which trials succeeded, (T,): answered, and nearer the truth than both limits.

        A guess that happens to be near is no success of a matcher that gave no answer. What a matcher says of
        its own convergence does not count.
        """
        near = (self.displacement < threshold.displacement) & (self.rotation < threshold.rotation)
        return near & self.answered

    def columns(self) -> dict[str, NDArray[Any]]:
        """Per-trial arrays by name, for tables: lengths in m, angles in rad, times in s."""
        return {
            "trial": np.arange(len(self)),
            "displacement_m": self.displacement,
            "rotation_rad": self.rotation,
            "initial_displacement_m": self.initial_displacement,
            "initial_rotation_rad": self.initial_rotation,
            "seconds": self.seconds,
            "prepare_seconds": self.prepare_seconds,
            "evaluations": self.evaluations,
            "score": self.score,
            "converged": self.converged,
            "failure": np.array(self.failures, dtype=np.str_),
        }

    def summary(self) -> TrialSummary:
        """Success ratios, errors and times with their intervals; the same each time it is asked for."""
        return summarise(self)


def run_trials(
    matcher_name: str,
    matcher: Matcher[Any],
    pairs: Sequence[TrialPair],
    config: TrialConfig,
    progress: Callable[[int, int], None] | None = None,
) -> TrialResult:
    """Run one trial per pair.

    Guesses depend on the seed and the trial's number alone, so every matcher gets the same. A matcher that
    raises in a trial fails that trial, with the reason kept; the others go on.

    Parameters
    ----------
    matcher_name : str
        What reports call it.
    matcher : Matcher
        What is tried.
    pairs : sequence of TrialPair
        From `make_pairs`.
    config : TrialConfig
        Seed, box of the guesses (the matcher's window as well), warm-up.
    progress : callable, optional
        Called with (trials done, trials in all) after each.

    Raises
    ------
    DataError
        There are no pairs.
    """
    if not pairs:
        raise DataError("there are no pairs of scans to try a matcher on")
    warm_up(matcher, pairs, config)
    outcomes = []
    for trial, pair in enumerate(pairs):
        outcomes.append(run_trial(matcher, pair, config, trial))
        if progress is not None:
            progress(trial + 1, len(pairs))
    return TrialResult.gather(matcher_name, pairs[0].protocol, config, outcomes)


def warm_up(matcher: Matcher[Any], pairs: Sequence[TrialPair], config: TrialConfig) -> None:
    """Run ``config.warm_up`` trials that do not count, so that nothing is compiled on the clock."""
    for trial in range(config.warm_up):
        run_trial(matcher, pairs[trial % len(pairs)], config, trial)


def run_trial(matcher: Matcher[Any], pair: TrialPair, config: TrialConfig, trial: int) -> TrialOutcome:
    """Run one trial: prepare the reference, match from a guess that is off, compare with the truth.

    Preparing includes the surface that the framework scores on. See `run_trials`.
    """
    guess = trial_guess(pair.truth, config, trial)
    initial_displacement, initial_rotation = _error(pair.truth, guess)
    rng = np.random.default_rng(_seed(config, trial).spawn(1)[0])
    prepare_seconds = seconds = np.nan
    try:
        start = perf_counter()
        reference = matcher.prepare(pair.reference_points)
        reference.surface  # noqa: B018  (built on first use, which is not to fall into the time of the match)
        prepare_seconds = perf_counter() - start
        start = perf_counter()
        found = matcher.match(reference, pair.scan_points, guess, config.window, rng)
        seconds = perf_counter() - start
    except Exception as error:  # a matcher may fail in any way; it costs this trial only
        return TrialOutcome(
            displacement=initial_displacement,
            rotation=initial_rotation,
            initial_displacement=initial_displacement,
            initial_rotation=initial_rotation,
            seconds=seconds,
            prepare_seconds=prepare_seconds,
            evaluations=0,
            score=0.0,
            converged=False,
            failure=f"{type(error).__name__}: {error}",
        )
    displacement, rotation = _error(pair.truth, found.pose)
    return TrialOutcome(
        displacement=displacement,
        rotation=rotation,
        initial_displacement=initial_displacement,
        initial_rotation=initial_rotation,
        seconds=seconds,
        prepare_seconds=prepare_seconds,
        evaluations=found.evaluations,
        score=found.score,
        converged=found.converged,
        failure=str(found.diagnostics.get("rejected", "")),
    )


def trial_guess(truth: Pose, config: TrialConfig, trial: int) -> Pose:
    """Draw the guess of a trial: the truth plus an error uniform in the box, for every matcher the same."""
    half = config.window.half
    offset = np.random.default_rng(_seed(config, trial)).uniform(-half, half)
    guess = truth + offset
    guess[2] = wrap(guess[2])
    return guess


def _seed(config: TrialConfig, trial: int) -> np.random.SeedSequence:
    return np.random.SeedSequence([config.seed, trial])


def _error(truth: Pose, pose: Pose) -> tuple[float, float]:
    error = between(truth, pose)
    return float(np.hypot(error[0], error[1])), abs(float(error[2]))
