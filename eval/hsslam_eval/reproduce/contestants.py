"""The searches that benchmark functions are run with, each at its published (or its library's own) settings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.search.minimize import METHODS, minimize
from hsslam_eval.reproduce.benchmark_functions import BenchmarkFunction

Floats: TypeAlias = NDArray[np.float64]

SCIPY_MEMBERS = 15
"""Members per variable, scipy's default."""

_ONE_BY_ONE = ("harmony", "ihs")
"""Methods that never evaluate a generation at once."""


@dataclass(frozen=True)
class Contestant:
    """A search: a method of `minimize` with its options, or scipy's differential evolution where it is None.

    Parameters
    ----------
    label : str
        In tables and figures.
    method : str, optional
        See there.
    options : dict
        What differs from the method's defaults.
    added : bool
        The paper does not name it among the searches HIDE is made from or set against; we thought it worth having.
    """

    label: str
    method: str | None
    options: dict[str, Any] = field(default_factory=dict)
    added: bool = False

    def history(
        self, function: BenchmarkFunction, dimension: int, budget: int, seed: Sequence[int]
    ) -> Floats:
        """Least value after each of ``budget`` evaluations, (budget,); the same seed gives the same."""
        rng = np.random.default_rng(list(seed))
        if self.method is None:
            return _scipy_history(function, dimension, budget, rng)
        alone = self.method in _ONE_BY_ONE
        found = minimize(
            function.at if alone else function.at_columns,
            function.bounds(dimension),
            self.method,
            rng=rng,
            maxfev=budget,
            vectorized=not alone,
            history=True,
            **self.options,
        )
        return np.asarray(found.history, dtype=np.float64)

    def described(self) -> dict[str, Any]:
        """Every parameter, defaults included."""
        if self.method is None:
            return {
                "method": "scipy.optimize.differential_evolution",
                "popsize": SCIPY_MEMBERS,
                "polish": False,
                "updating": "deferred",
            }
        return {
            "method": self.method,
            **METHODS[self.method].options.model_validate(self.options).model_dump(mode="json"),
        }


def _scipy_history(
    function: BenchmarkFunction, dimension: int, budget: int, rng: np.random.Generator
) -> Floats:
    from scipy import optimize

    search: Any = optimize.differential_evolution
    energies: list[Floats] = []

    def recorded(points: Floats) -> Floats:
        energies.append(function.at_columns(points))
        return energies[-1]

    members = SCIPY_MEMBERS * dimension
    search(
        recorded,
        function.bounds(dimension),
        popsize=SCIPY_MEMBERS,
        maxiter=max(0, -(-budget // members) - 1),
        tol=0.0,
        atol=0.0,
        polish=False,
        seed=rng,
        vectorized=True,
        updating="deferred",
    )
    least = np.minimum.accumulate(np.concatenate(energies))[:budget]
    # A population that has become one point ends scipy's search early; its answer stands from there on.
    return np.concatenate((least, np.full(budget - len(least), least[-1])))


HIDE = "HIDE"
CONTESTANTS = (
    Contestant("HS", "harmony"),
    Contestant("IHS", "ihs"),
    Contestant("DE (eq. 11)", "de"),
    Contestant("DE/rand-to-best/1", "de-rand-to-best"),
    Contestant(HIDE, "hide"),
    Contestant("GA, Gray-coded", "genetic", added=True),
    Contestant("GA, real-valued", "genetic", {"encoding": "real"}, added=True),
    Contestant("scipy's DE", None, added=True),
)
