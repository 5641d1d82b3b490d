"""How good the best pose is after each evaluation: what the paper's convergence plots show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.matching import Matcher
from hsslam.search import HitFitness, PopulationMatcher, PopulationReference
from hsslam_eval.protocols import TrialPair
from hsslam_eval.reproduce.experiment import Tell
from hsslam_eval.reproduce.methods import Method
from hsslam_eval.trial_config import TrialConfig
from hsslam_eval.trials import trial_guess


@dataclass(frozen=True, eq=False)
class Traces:
    """The best pose so far in every trial (row) after every evaluation (column).

    Parameters
    ----------
    displacement : float64 (T, E)
        Its distance from the truth (m).
    fitness : float64 (T, E)
        Share of the scan's points that hit.
    """

    displacement: NDArray[np.float64]
    fitness: NDArray[np.float64]


def trace_trials(
    method: Method, pairs: Sequence[TrialPair], config: TrialConfig, evaluations: int, tell: Tell
) -> Traces:
    """Run the bare search, no refinement, once per pair; the guesses are those of `run_trials`.

    Parameters
    ----------
    method : Method
        A population search.
    pairs, config : list of TrialPair, TrialConfig
        As for `hsslam_eval.trials.run_trials`.
    evaluations : int
        Columns wanted, the filling of the memory included; at most what the method spends.
    tell : callable
        Progress.
    """
    matcher: Matcher[Any] = method.matcher
    assert isinstance(matcher, PopulationMatcher)
    displacement, fitness = (np.empty((len(pairs), evaluations)) for _ in range(2))
    for trial, pair in enumerate(pairs):
        reference = matcher.prepare(pair.reference_points)
        assert isinstance(reference, PopulationReference)
        hits = HitFitness.of(reference.raster, pair.scan_points)
        seed = np.random.SeedSequence([config.seed, trial]).spawn(1)[0]
        trace = np.full((evaluations, 4), np.nan)
        guess = trial_guess(pair.truth, config, trial)
        matcher.search(hits, guess, config.window, np.random.default_rng(seed), trace)
        _carry_on(trace)
        displacement[trial] = np.hypot(trace[:, 0] - pair.truth[0], trace[:, 1] - pair.truth[1])
        fitness[trial] = trace[:, 3] * hits.share(1)
        tell(method.label, trial + 1, len(pairs))
    return Traces(displacement, fitness)


def _carry_on(trace: NDArray[np.float64]) -> None:
    """A search that stopped early keeps its answer."""
    written = int(np.isfinite(trace[:, 3]).sum())
    trace[written:] = trace[written - 1]
