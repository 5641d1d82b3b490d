"""Rasters that a scan's points are looked up in: 1 where a point counts as a hit, 0 elsewhere.

Every raster has a border of zeros one cell wide, so that a look-up clamped to it needs no other check.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points

MAXIMUM_CELLS_PER_SIDE = 4000


@dataclass(frozen=True, eq=False)
class Raster:
    """Where a point counts as a hit.

    Parameters
    ----------
    cells : uint8 (H, W)
        1 for a hit.
    frame : float64 (3,)
        Position (m) of the corner of cell (0, 0), and cells per metre.
    half_side : float
        Of the squares (m).
    """

    cells: NDArray[np.uint8]
    frame: NDArray[np.float64]
    half_side: float

    @classmethod
    def build(cls, segments: NDArray[np.float64], half_side: float, resolution: float) -> Raster:
        """Squares of half side ``half_side`` (m) along (S, 4) segments; equal ends make a point."""
        if len(segments) == 0:
            return cls(np.zeros((3, 3), dtype=np.uint8), np.array([0.0, 0.0, 1.0]), half_side)
        ends = segments.reshape(-1, 2)
        extent = ends.max(axis=0) - ends.min(axis=0) + 2.0 * half_side
        resolution = max(resolution, float(extent.max()) / MAXIMUM_CELLS_PER_SIDE)
        low = ends.min(axis=0) - half_side - 1.5 * resolution
        columns, rows = (int(v) for v in np.ceil(extent / resolution) + 4)
        frame = np.array([low[0], low[1], 1.0 / resolution])
        return cls(stamp_squares(segments, frame, rows, columns, half_side), frame, half_side)

    @classmethod
    def of_points(cls, points: Points, half_side: float, resolution: float) -> Raster:
        """Squares around (N, 2) points."""
        return cls.build(np.hstack((points, points)), half_side, resolution)


@kernel
def stamp_squares(
    segments: NDArray[np.float64], frame: NDArray[np.float64], rows: int, columns: int, half_side: float
) -> NDArray[np.uint8]:
    """Set the cells whose centre is in a square around some place of a segment, uint8 (rows, columns).

    A segment is walked in steps of at most a cell, so the squares of its inner places overlap.
    """
    cells = np.zeros((rows, columns), dtype=np.uint8)
    per_metre = frame[2]
    half = half_side * per_metre
    for k in range(segments.shape[0]):
        # In cells, shifted so that a cell's centre has a whole number.
        ax = (segments[k, 0] - frame[0]) * per_metre - 0.5
        ay = (segments[k, 1] - frame[1]) * per_metre - 0.5
        dx = (segments[k, 2] - segments[k, 0]) * per_metre
        dy = (segments[k, 3] - segments[k, 1]) * per_metre
        steps = int(np.ceil(max(abs(dx), abs(dy))))
        for step in range(steps + 1):
            t = step / steps if steps > 0 else 0.0
            x, y = ax + t * dx, ay + t * dy
            left, right = int(np.ceil(x - half)), int(np.floor(x + half))
            for row in range(int(np.ceil(y - half)), int(np.floor(y + half)) + 1):
                for column in range(left, right + 1):
                    cells[row, column] = 1
    return cells
