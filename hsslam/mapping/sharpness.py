"""How sharp a map is: a figure for logs without a truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsslam.mapping.occupancy import OccupancyGrid


@dataclass(frozen=True)
class Sharpness:
    """Figures of a map; compare them only between maps of one log at one resolution.

    Poses that are wrong draw a wall twice, or as a band, and let beams pass through it: occupied cells
    multiply, and more cells are told to be both.

    Parameters
    ----------
    mean_entropy : float
        Mean binary entropy of the occupancy of the visited cells (bit, 0 to 1); lower is sharper.
    wall_area : float
        Area of the occupied cells (m^2); lower is sharper.
    visited_area : float
        Area of the visited cells (m^2); beams that pass through walls add to it.
    """

    mean_entropy: float
    wall_area: float
    visited_area: float


def sharpness(grid: OccupancyGrid, occupied: float = 0.65) -> Sharpness:
    """Measure how sharp a map is.

    The entropy is that of Blanco, Fernandez-Madrigal and Gonzalez, "A novel measure of uncertainty for mobile
    robot SLAM with Rao-Blackwellized particle filters" (2008), without their expectation over maps.

    Parameters
    ----------
    grid : OccupancyGrid
        An empty one gives zeros.
    occupied : float
        Probability over which a cell counts as occupied.
    """
    visited = grid.visited
    count = int(visited.sum())
    if count == 0:
        return Sharpness(0.0, 0.0, 0.0)
    p = np.clip(grid.probability[visited].astype(np.float64), 1e-12, 1.0 - 1e-12)
    entropy = -(p * np.log2(p) + (1.0 - p) * np.log2(1.0 - p))
    walls = int((p > occupied).sum())
    cell = grid.resolution**2
    return Sharpness(float(entropy.mean()), walls * cell, count * cell)
