"""How far a search stays below the best that its fitness has to offer in the window."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.matching import Matcher, MatchResult
from hsslam_eval.protocols import TrialPair
from hsslam_eval.reproduce.experiment import Tell, Value
from hsslam_eval.reproduce.methods import FITNESS, Method, oracle
from hsslam_eval.statistics import bootstrap_interval
from hsslam_eval.trial_config import TrialConfig
from hsslam_eval.trials import trial_guess


@dataclass(frozen=True, eq=False)
class Optima:
    """The best that the published fitness has to offer in the window of each trial.

    Parameters
    ----------
    fitness : float64 (T,)
        Share of the scan's points that hit at the best pose.
    proven : float
        Share of the trials in which no pose of the window can be better by a point.
    """

    fitness: NDArray[np.float64]
    proven: float


def find_optima(pairs: Sequence[TrialPair], config: TrialConfig, tell: Tell) -> Optima | None:
    """Search every window exhaustively, around the guesses of `run_trials`; None where there is no oracle."""
    best = oracle()
    if best is None:
        return None
    fitness, proven = np.empty(len(pairs)), 0
    for trial, pair in enumerate(pairs):
        found = _match(best.matcher, pair, config, trial)
        fitness[trial] = found.diagnostics["fitness"]
        proven += bool(found.diagnostics["proven"])
        tell(f"proving the optima, L = {200 * config.half_xy:.0f} cm", trial + 1, len(pairs))
    return Optima(fitness, proven / len(pairs))


def regret_of(
    method: Method, optima: Optima, pairs: Sequence[TrialPair], config: TrialConfig, tell: Tell
) -> Value | None:
    """Mean share of the scan's points (%) that the proven optimum hits and the method's answer does not.

    Returns
    -------
    Value or None
        None for a method with another fitness, or one that refines its answer, which then is no maximum.
    """
    if any(method.parameters.get(key) != value for key, value in FITNESS.items()):
        return None
    found = np.empty(len(pairs))
    for trial, pair in enumerate(pairs):
        found[trial] = _match(method.matcher, pair, config, trial).diagnostics["fitness"]
        tell(f"{method.label}: regret, L = {200 * config.half_xy:.0f} cm", trial + 1, len(pairs))
    return Value.of(bootstrap_interval(100.0 * (optima.fitness - found), seed=config.seed))


def _match(matcher: Matcher[Any], pair: TrialPair, config: TrialConfig, trial: int) -> MatchResult:
    seed = np.random.SeedSequence([config.seed, trial]).spawn(1)[0]
    return matcher.match(
        matcher.prepare(pair.reference_points),
        pair.scan_points,
        trial_guess(pair.truth, config, trial),
        config.window,
        np.random.default_rng(seed),
    )
