"""Functions that searches are commonly tried on, each with a known minimum of 0, in any number of variables.

Boxes as in Yao, Liu and Lin, "Evolutionary programming made faster" (IEEE Transactions on Evolutionary Computation 3,
1999), so that all come from one place; other authors have smaller ones for some.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

SCHWEFEL_MINIMISER = 420.96874635998204
_SCHWEFEL_DEPTH = 418.98288727243374
"""Of x sin(sqrt|x|) at its greatest in the box."""


@dataclass(frozen=True)
class BenchmarkFunction:
    """A function to minimise.

    Parameters
    ----------
    name, title : str
        In results, and for reading.
    half : float
        The box is from minus to plus this along each variable.
    minimiser : float
        Every variable has this value at the minimum, where the function is 0.
    code : int
        Its number in the kernel.
    local_minima : bool
        Whether there are many.
    source : str
        Where it is from.
    """

    name: str
    title: str
    half: float
    minimiser: float
    code: int
    local_minima: bool
    source: str

    def bounds(self, dimension: int) -> list[tuple[float, float]]:
        """The box in so many variables."""
        return [(-self.half, self.half)] * dimension

    def at(self, point: NDArray[np.float64]) -> float:
        """Value at a point (N,)."""
        return evaluate(self.code, point)

    def at_columns(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (K,) at points (N, K), one per column."""
        return evaluate_rows(self.code, np.ascontiguousarray(points.T))


@kernel
def evaluate(code: int, x: NDArray[np.float64]) -> float:
    """Value of the function of that code at a point (N,)."""
    n = x.shape[0]
    total = 0.0
    if code == 0:
        for i in range(n):
            total += x[i] * x[i]
    elif code == 1:
        for i in range(n - 1):
            step = x[i + 1] - x[i] * x[i]
            total += 100.0 * step * step + (1.0 - x[i]) * (1.0 - x[i])
    elif code == 2:
        for i in range(n):
            total += x[i] * x[i] - 10.0 * math.cos(2.0 * math.pi * x[i]) + 10.0
    elif code == 3:
        waves = 0.0
        for i in range(n):
            total += x[i] * x[i]
            waves += math.cos(2.0 * math.pi * x[i])
        total = 20.0 + math.e - 20.0 * math.exp(-0.2 * math.sqrt(total / n)) - math.exp(waves / n)
    elif code == 4:
        product = 1.0
        for i in range(n):
            total += x[i] * x[i]
            product *= math.cos(x[i] / math.sqrt(i + 1.0))
        total = 1.0 + total / 4000.0 - product
    else:
        for i in range(n):
            total += _SCHWEFEL_DEPTH - x[i] * math.sin(math.sqrt(abs(x[i])))
    return total


@kernel
def evaluate_rows(code: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (K,) at points (K, N)."""
    values = np.empty(points.shape[0])
    for k in range(points.shape[0]):
        values[k] = evaluate(code, points[k])
    return values


FUNCTIONS: tuple[BenchmarkFunction, ...] = (
    BenchmarkFunction("sphere", "Sphere", 100.0, 0.0, 0, False, "De Jong, doctoral thesis, Michigan 1975"),
    BenchmarkFunction(
        "rosenbrock", "Rosenbrock", 30.0, 1.0, 1, False, "Rosenbrock, The Computer Journal 3, 1960"
    ),
    BenchmarkFunction(
        "rastrigin",
        "Rastrigin",
        5.12,
        0.0,
        2,
        True,
        "Rastrigin 1974; in N variables Mühlenbein, Schomisch and Born, Parallel Computing 17, 1991",
    ),
    BenchmarkFunction("ackley", "Ackley", 32.0, 0.0, 3, True, "Ackley, doctoral thesis, Kluwer 1987"),
    BenchmarkFunction(
        "griewank",
        "Griewank",
        600.0,
        0.0,
        4,
        True,
        "Griewank, J. Optimization Theory and Applications 34, 1981",
    ),
    BenchmarkFunction(
        "schwefel",
        "Schwefel",
        500.0,
        SCHWEFEL_MINIMISER,
        5,
        True,
        "Schwefel, Numerical Optimization of Computer Models, Wiley 1981 (2.26)",
    ),
)
"""Sphere and Rosenbrock have one basin (Rosenbrock two from four variables on), the others many."""
