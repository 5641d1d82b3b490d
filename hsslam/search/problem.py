"""What a search of `hsslam.search.minimize` sees: a box, an objective that counts, and when to stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import ConfigError

Floats: TypeAlias = NDArray[np.float64]
Objective: TypeAlias = Callable[..., Any]


@dataclass(frozen=True, eq=False)
class Box:
    """Where to search: float64 (N,) each, ``low <= high``."""

    low: Floats
    high: Floats

    @classmethod
    def of(cls, bounds: Any) -> Box:
        """From ``[(low, high), ...]`` or a `scipy.optimize.Bounds`.

        Raises
        ------
        ConfigError
            They are no such thing, not finite, or the wrong way round.
        """
        pairs = np.column_stack((bounds.lb, bounds.ub)) if hasattr(bounds, "lb") else bounds
        try:
            found = np.array(pairs, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ConfigError(f"bounds: expected a (low, high) for each variable: {error}") from error
        if found.ndim != 2 or found.shape[1] != 2 or len(found) == 0:
            raise ConfigError(
                f"bounds: expected a (low, high) for each variable, found an array of shape {found.shape}"
            )
        for place, (low, high) in enumerate(found):
            if not (math.isfinite(low) and math.isfinite(high) and low <= high):
                raise ConfigError(
                    f"bounds[{place}]: expected finite numbers, low <= high, found ({low:g}, {high:g})"
                )
        return cls(found[:, 0].copy(), found[:, 1].copy())

    @property
    def size(self) -> int:
        """N, the number of variables."""
        return len(self.low)

    @property
    def span(self) -> Floats:
        """Ranges of the variables, (N,)."""
        return self.high - self.low

    def clip(self, points: Floats) -> Floats:
        """Move points (..., N) that lie outside to the box's surface, as the matchers do with their window."""
        return np.minimum(np.maximum(points, self.low), self.high)

    def draw(self, count: int, rng: np.random.Generator) -> Floats:
        """Uniform points (count, N) (paper, equation 1)."""
        return self.clip(self.low + rng.random((count, self.size)) * self.span)


class Problem:
    """An objective over a box, evaluated ``maxfev`` times and not once more.

    Parameters
    ----------
    objective : callable
        See `hsslam.search.minimize`, as are the others.
    box : Box
        Where to search.
    maxfev : int
        The budget.
    start : float64 (N,), optional
        First member of the first population.
    """

    def __init__(
        self,
        objective: Objective,
        box: Box,
        maxfev: int,
        *,
        args: tuple[Any, ...] = (),
        start: Floats | None = None,
        vectorized: bool = False,
        patience: int | None = None,
        tolerance: float = 0.0,
        history: bool = False,
    ) -> None:
        self.box = box
        self.maxfev = maxfev
        self.spent: int = 0
        self.best: Floats = box.low
        self.least: float = math.inf
        self.stalled: bool = False
        self._objective = objective
        self._args = args
        self._start = start
        self._vectorized = vectorized
        self._patience = patience
        self._tolerance = tolerance
        self._mean = math.nan
        self._since = 0
        self._energies = np.empty(maxfev) if history else None

    @property
    def left(self) -> int:
        """Evaluations left of the budget."""
        return self.maxfev - self.spent

    @property
    def history(self) -> Floats | None:
        """Least energy after each evaluation, (spent,), where that was asked for."""
        return None if self._energies is None else np.minimum.accumulate(self._energies[: self.spent])

    def fill(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Draw and evaluate a first population: (count, N) and (count,), or what the budget allows of it."""
        members = self.box.draw(count, rng)
        if self._start is not None:
            members[0] = self._start
        energies = self.many(members)
        return members[: len(energies)], energies

    def one(self, point: Floats) -> float:
        """Evaluate a point (N,); there must be budget left."""
        if self._vectorized:
            return float(self.many(point[None])[0])
        energy = _number(self._objective(point, *self._args))
        if energy < self.least:
            self.best, self.least = point, energy
        if self._energies is not None:
            self._energies[self.spent] = energy
        self.spent += 1
        return energy

    def many(self, points: Floats) -> Floats:
        """Evaluate points (K, N), or the first of them if the budget ends: their energies."""
        points = points[: self.left]
        if not self._vectorized:
            return np.array([self.one(point.copy()) for point in points])
        energies = np.asarray(self._objective(points.T, *self._args), dtype=np.float64)
        if energies.shape != (len(points),):
            raise ConfigError(
                f"objective: with vectorized=True it is given an array (N, K) and must return (K,) = "
                f"({len(points)},), found {energies.shape}"
            )
        energies = np.where(np.isnan(energies), math.inf, energies)
        least = int(np.argmin(energies))
        if energies[least] < self.least:
            self.best, self.least = points[least].copy(), float(energies[least])
        if self._energies is not None:
            self._energies[self.spent : self.spent + len(points)] = energies
        self.spent += len(points)
        return energies

    def done(self, energies: Floats) -> bool:
        """Whether to stop, given the population's energies: the two criteria of the paper's section 4.4."""
        if self.left == 0:
            return True
        if self._patience is None:
            return False
        mean = float(energies.mean())
        if mean != self._mean and not abs(mean - self._mean) <= self._tolerance * abs(self._mean):
            self._mean, self._since = mean, self.spent
        self.stalled = self.spent - self._since >= self._patience
        return self.stalled


def _number(value: Any) -> float:
    """An energy; NaN counts as infinitely bad."""
    try:
        energy = float(value)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"objective: it must return a number, found {type(value).__name__}") from error
    return math.inf if energy != energy else energy
