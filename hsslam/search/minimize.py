"""The searches on their own: minimise any function over a box."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from hsslam.errors import ConfigError
from hsslam.search import options as settings
from hsslam.search.generations import genetic
from hsslam.search.problem import Box, Floats, Objective, Problem
from hsslam.search.searches import (
    Outcome,
    best_evolution,
    harmony_search,
    hide,
    improved_harmony_search,
    simple_evolution,
)
from hsslam.validation import explain

if TYPE_CHECKING:
    from scipy.optimize import Bounds, OptimizeResult


@dataclass(frozen=True)
class Method:
    """A search and the model of its options."""

    search: Callable[[Problem, Any, np.random.Generator], Outcome]
    options: type[settings.Options]


METHODS: dict[str, Method] = {
    "harmony": Method(harmony_search, settings.Harmony),
    "ihs": Method(improved_harmony_search, settings.ImprovedHarmony),
    "de": Method(simple_evolution, settings.SimpleEvolution),
    "de-rand-to-best": Method(best_evolution, settings.BestEvolution),
    "hide": Method(hide, settings.Hide),
    "genetic": Method(genetic, settings.Genetic),
}
"""Methods of `minimize` by name."""


def minimize(
    objective: Objective,
    bounds: Sequence[tuple[float, float]] | Bounds,
    method: str = "hide",
    *,
    args: tuple[Any, ...] = (),
    x0: ArrayLike | None = None,
    seed: int | None = None,
    rng: np.random.Generator | None = None,
    maxfev: int = 10_000,
    patience: int | None = None,
    tolerance: float = 0.0,
    vectorized: bool = False,
    history: bool = False,
    **options: Any,
) -> OptimizeResult:
    """Minimise a function over a box.

    Parameters
    ----------
    objective : callable
        ``objective(x, *args) -> float`` with x float64 (N,), which it must not change; Python or numba. NaN counts
        as infinitely bad.
    bounds : sequence of (low, high), or scipy.optimize.Bounds
        One pair per variable, finite. No point outside is ever evaluated: what a search moves out of the box is
        clipped to it.
    method : str
        ``harmony``: harmony search, fixed PAR and BW (paper, section 3). ``ihs``: improved harmony search,
        equations 2 and 3, which is what HSL searches with. ``de``: differential evolution, equation 11.
        ``de-rand-to-best``: equation 12. ``hide``: harmony search and equation 12 in turns (section 5).
        ``genetic``: a genetic algorithm, Gray-coded as in GLASM or real-valued.
    args : tuple
        Passed on to the objective.
    x0 : array_like (N,), optional
        First member of the first population (equation 5), inside the bounds; the others are uniform.
    seed : int, optional
        Of the random choices; 0 if neither it nor ``rng`` is given. The same seed gives the same result.
    rng : numpy.random.Generator, optional
        Makes the random choices instead.
    maxfev : int
        Evaluations of the objective, the first population's included; spent to the last unless ``patience`` ends
        the search. NI and NFE of the paper are this less the memory's size. PAR and BW follow the share spent.
    patience : int, optional
        Stop after this many evaluations in which the population's average has not changed (section 4.4; the paper
        gives no number).
    tolerance : float
        Relative change of the average that counts as none.
    vectorized : bool
        The objective takes x (N, K), a point per column, and returns (K,), as scipy's differential evolution has it.
        Faster where points come in generations; harmonies come one by one.
    history : bool
        Keep the least value after each evaluation.
    **options
        Of the method: the fields of its model in `hsslam.search.options`, by the names that the matchers' parameters
        have. Bandwidths are shares of a variable's range; their defaults are the paper's 8 and 0.2 cm over its
        window of 30 cm.

    Returns
    -------
    scipy.optimize.OptimizeResult
        ``x`` (N,), ``fun``, ``nfev``, ``nit``, ``success`` (a finite value was found), ``status`` (0: budget spent,
        1: the population stopped changing), ``message``, ``method``, ``population`` (M, N) best first,
        ``population_energies`` (M,), and ``history`` (nfev,) where asked for.

    Raises
    ------
    ConfigError
        Unknown method or option, a value out of its range, unusable bounds, or an objective that returns no number.

    Notes
    -----
    Where the paper is open we read it as follows. Equation 8's plus-minus: a fair coin, times Algorithm 1's U(0, 1).
    Equation 11's L: 1 (`hsslam.search.options.SimpleEvolution`). Crossover after equations 11 and 12: binomial, rate
    0.9. A newcomer replaces the worst harmony, or its parent, only where it is strictly better.

    Examples
    --------
    >>> from hsslam.search import minimize
    >>> found = minimize(lambda x: (x**2).sum(), [(-5.0, 5.0)] * 3, maxfev=2000, seed=1)
    >>> bool(found.fun < 1e-2), found.nfev
    (True, 2000)
    """
    from scipy.optimize import OptimizeResult

    if method not in METHODS:
        close = difflib.get_close_matches(str(method), METHODS, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise ConfigError(f"no search is named {method!r}{hint} (there are: {', '.join(METHODS)})")
    chosen = METHODS[method]
    try:
        configured = chosen.options.model_validate(options)
    except ValidationError as error:
        raise explain(error, chosen.options, prefix=method) from error
    if seed is not None and rng is not None:
        raise ConfigError("give seed or rng, not both")
    _at_least("maxfev", maxfev, 1)
    if patience is not None:
        _at_least("patience", patience, 1)
    box = Box.of(bounds)
    problem = Problem(
        objective,
        box,
        maxfev,
        args=args,
        start=None if x0 is None else _inside(x0, box),
        vectorized=vectorized,
        patience=patience,
        tolerance=tolerance,
        history=history,
    )
    generator = rng if rng is not None else np.random.default_rng(0 if seed is None else seed)
    population, energies, iterations = chosen.search(problem, configured, generator)
    order = np.argsort(energies, kind="stable")
    make: Any = OptimizeResult
    result: OptimizeResult = make(
        x=problem.best.copy(),
        fun=problem.least,
        nfev=problem.spent,
        nit=iterations,
        success=bool(np.isfinite(problem.least)),
        status=int(problem.stalled),
        message=_message(problem, patience),
        method=method,
        population=population[order],
        population_energies=energies[order],
    )
    if history:
        result["history"] = problem.history
    return result


def _message(problem: Problem, patience: int | None) -> str:
    if not np.isfinite(problem.least):
        return f"the objective was not finite anywhere it was evaluated ({problem.spent} points)"
    if problem.stalled:
        return f"the population's average has not changed for {patience} evaluations"
    return f"all {problem.maxfev} evaluations are spent"


def _at_least(name: str, value: Any, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ConfigError(f"{name}: expected a whole number from {least}, found {value!r}")


def _inside(start: ArrayLike, box: Box) -> Floats:
    found = np.array(start, dtype=np.float64)
    if found.shape != (box.size,):
        raise ConfigError(f"x0: expected {box.size} numbers, one per bound, found shape {found.shape}")
    if not np.all((found >= box.low) & (found <= box.high)):
        raise ConfigError(f"x0: expected a point within the bounds, found {found.tolist()}")
    return found
