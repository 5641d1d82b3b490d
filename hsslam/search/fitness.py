"""Fitness functions by name: what a population search maximises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import ConfigError
from hsslam.kernels.fitness import scale
from hsslam.kernels.raster import Raster
from hsslam.kernels.surface import Surface, scan_lines
from hsslam.se2 import Points
from hsslam.search.fitness_functions import FitnessName, load_fitness

__all__ = ["FitnessName", "HitFitness", "build_raster"]


_NO_LINES: NDArray[np.float64] = np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class HitFitness:
    """Counts a scan's points that hit a raster (paper, equations 9 and 10); one per match.

    Parameters
    ----------
    cells, frame : arrays
        Of the reference's `Raster`.
    scaled : float32 (3, M)
        The scan's points in cells, and the way they face, as `hsslam.kernels.fitness.scale` orders and pads them.
    count : int
        How many there are.
    """

    cells: NDArray[np.uint8]
    frame: NDArray[np.float64]
    scaled: NDArray[np.float32]
    count: int

    @classmethod
    def of(
        cls,
        raster: Raster,
        points: Points,
        most: int | None = None,
        lines: NDArray[np.float64] | None = None,
    ) -> HitFitness:
        """Fitness of (N, 2) points against a raster: of all, or of ``most`` spread over the scan.

        Where sides count, (N, 3) `scan_lines` tell which way points face; they are made if they are left out.
        """
        count = len(points) if most is None else min(most, len(points))
        if lines is None:
            lines = scan_lines(points) if raster.sided else _NO_LINES
        return cls(raster.cells, raster.frame, scale(points, lines, raster.frame, count), count)

    @property
    def xs(self) -> NDArray[np.float32]:
        """Their first coordinates, (count,)."""
        return self.scaled[0, : self.count]

    @property
    def ys(self) -> NDArray[np.float32]:
        """Their second coordinates, (count,)."""
        return self.scaled[1, : self.count]

    def share(self, hits: int) -> float:
        """What a sum of worths is of the most there could be, in [0, 1]."""
        return hits / float(self.frame[3] * self.count)


def build_raster(
    name: FitnessName, points: Points, surface: Surface, half_side: float, resolution: float
) -> Raster:
    """Rasterise a reference for a fitness function.

    Parameters
    ----------
    name : str
        See `hsslam.search.fitness_functions`.
    points : Points
        (N, 2) m, the reference.
    surface : Surface
        Through these points.
    half_side, resolution : float
        Of a square (of ``likelihood``: its standard deviation), and of a cell (m).
    """
    made = load_fitness(name)(points, surface, half_side, resolution)
    if not isinstance(made, Raster):  # a plugin's may return anything
        raise ConfigError(
            f"fitness function {name!r}: expected it to return a hsslam.search.Raster, found {type(made).__name__}"
        )
    return made
