"""Searches against each other on benchmark functions, with equal evaluations: the runs and what they gave."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hsslam_eval.reproduce.benchmark_functions import FUNCTIONS, BenchmarkFunction
from hsslam_eval.reproduce.contestants import CONTESTANTS, HIDE, Contestant, Floats
from hsslam_eval.reproduce.signed_rank import Comparison, compare_all

SOLVED = 1e-8
"""Errors under this count as 0, as is usual where searches are compared."""

CURVE_POINTS = 100
EARLY = 0.1
"""Share of the budget after which speed is judged."""


@dataclass(frozen=True)
class Size:
    """How much to run."""

    dimensions: tuple[int, ...]
    runs: int
    evaluations_per_dimension: int


QUICK = Size((2, 5), 5, 300)
USUAL = Size((2, 5, 10, 30), 30, 600)


@dataclass(frozen=True)
class Problem:
    """A function in so many variables."""

    function: BenchmarkFunction
    dimension: int

    @property
    def title(self) -> str:
        """For a table."""
        return f"{self.function.title}, {self.dimension}"


@dataclass(frozen=True, eq=False)
class BenchmarksResult:
    """What the searches found.

    Parameters
    ----------
    size : Size
        What was run.
    seed : int
        Run r of every search draws from the generator seeded with [seed, r]; those with equal populations begin from
        the same points.
    contestants : tuple of Contestant
        The searches, M of them.
    finals, early : dict
        Error (M, R) of each problem after the whole budget, and after a tenth of it; 0 where under 1e-8.
    quartiles : dict
        First quartile, median, third quartile of the error (3, M, P) over ``shares`` of the budget.
    shares : float64 (P,)
        See there.
    """

    size: Size
    seed: int
    contestants: tuple[Contestant, ...]
    finals: dict[Problem, Floats]
    early: dict[Problem, Floats]
    quartiles: dict[Problem, Floats]
    shares: Floats

    @property
    def problems(self) -> list[Problem]:
        """Functions and dimensions, the function changing slowest."""
        return list(self.finals)

    @property
    def labels(self) -> list[str]:
        """All searches."""
        return [contestant.label for contestant in self.contestants]

    @property
    def others(self) -> list[Contestant]:
        """All searches but HIDE."""
        return [contestant for contestant in self.contestants if contestant.label != HIDE]

    @cached_property
    def ranks(self) -> dict[Problem, Floats]:
        """Mean rank of each search over the runs, (M,); 1 is best, equals share."""
        from scipy.stats import rankdata

        return {problem: rankdata(found, axis=0).mean(axis=1) for problem, found in self.finals.items()}

    def against(self, early: bool = False) -> dict[str, dict[Problem, Comparison]]:
        """HIDE against each other search on each problem, paired by run; all tests are one family for Holm."""
        return self._tests[early]

    @cached_property
    def _tests(self) -> dict[bool, dict[str, dict[Problem, Comparison]]]:
        return {early: self._test(errors) for early, errors in ((False, self.finals), (True, self.early))}

    def _test(self, errors: dict[Problem, Floats]) -> dict[str, dict[Problem, Comparison]]:
        keys = [(other.label, problem) for other in self.others for problem in self.problems]
        tests = compare_all([(self._of(errors, p, HIDE), self._of(errors, p, label)) for label, p in keys])
        out: dict[str, dict[Problem, Comparison]] = {other.label: {} for other in self.others}
        for (label, problem), test in zip(keys, tests, strict=True):
            out[label][problem] = test
        return out

    def overall(self, early: bool = False, many_minima: bool = False) -> dict[str, Comparison]:
        """HIDE against each other search over the problems, or over those with many local minima.

        What is paired are log10 of the median errors, at least 1e-8 each; one test per other search, and these are
        one family for Holm.
        """
        errors = self.early if early else self.finals
        problems = [problem for problem in self.problems if problem.function.local_minima or not many_minima]

        def logs(label: str) -> Floats:
            medians = [np.median(self._of(errors, problem, label)) for problem in problems]
            return np.log10(np.maximum(medians, SOLVED))

        labels = [other.label for other in self.others]
        tests = compare_all([(logs(HIDE), logs(label)) for label in labels])
        return dict(zip(labels, tests, strict=True))

    def _of(self, errors: dict[Problem, Floats], problem: Problem, label: str) -> Floats:
        found: Floats = errors[problem][self.labels.index(label)]
        return found


def measure(
    size: Size = USUAL,
    seed: int = 0,
    tell: Callable[[str, int, int], None] | None = None,
    contestants: Sequence[Contestant] = CONTESTANTS,
    functions: Sequence[BenchmarkFunction] = FUNCTIONS,
) -> BenchmarksResult:
    """Run every search on every function.

    Parameters
    ----------
    size : Size
        Dimensions, runs, evaluations.
    seed : int
        Every random choice follows from it.
    tell : callable, optional
        Called with what is being done, steps done, steps in all; a step is all runs of a search on a problem.
    contestants, functions : sequences
        Who and on what; HIDE must be among the contestants for comparisons.
    """
    problems = [Problem(function, n) for function in functions for n in size.dimensions]
    shares = np.arange(1, CURVE_POINTS + 1) / CURVE_POINTS
    finals, early, quartiles = {}, {}, {}
    done = 0
    total = len(problems) * len(contestants)
    for problem in problems:
        budget = size.evaluations_per_dimension * problem.dimension
        places = np.maximum(np.ceil(shares * budget).astype(np.int64) - 1, 0)
        curves = np.empty((len(contestants), size.runs, len(places)))
        begun = np.empty((len(contestants), size.runs))
        for m, contestant in enumerate(contestants):
            for run in range(size.runs):
                least = contestant.history(problem.function, problem.dimension, budget, (seed, run))
                curves[m, run] = least[places]
                begun[m, run] = least[max(int(EARLY * budget) - 1, 0)]
            done += 1
            if tell is not None:
                tell("searches on benchmark functions", done, total)
        curves[curves < SOLVED] = 0.0
        begun[begun < SOLVED] = 0.0
        finals[problem] = curves[:, :, -1].copy()
        early[problem] = begun
        quartiles[problem] = np.quantile(curves, (0.25, 0.5, 0.75), axis=1)
    return BenchmarksResult(size, seed, tuple(contestants), finals, early, quartiles, shares)
