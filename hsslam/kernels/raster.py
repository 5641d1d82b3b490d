"""Rasters that a scan's points are looked up in: what a point is worth where it falls.

Every raster has a border of zeros one cell wide, so that a look-up clamped to it needs no other check.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.growth import make_room
from hsslam.kernels.surface import squared_distance
from hsslam.se2 import Points

MAXIMUM_CELLS_PER_SIDE = 4000

FIELD_REACH = 2.5
"""A smooth field ends at this many standard deviations."""


@dataclass(frozen=True, eq=False)
class Raster:
    """What a point is worth where it falls.

    Parameters
    ----------
    cells : uint8 (H, W)
        From 0 to ``top``.
    frame : float64 (4,)
        Position (m) of the corner of cell (0, 0), cells per metre, and the largest worth: 1 where hits are
        counted, 255 for a smooth field.
    half_side : float
        Of the squares, or standard deviation of the field (m).
    """

    cells: NDArray[np.uint8]
    frame: NDArray[np.float64]
    half_side: float

    @classmethod
    def build(cls, segments: NDArray[np.float64], half_side: float, resolution: float) -> Raster:
        """Squares of half side ``half_side`` (m) along (S, 4) segments; equal ends make a point."""
        frame, rows, columns = _layout(segments, half_side, resolution, 1)
        cells = np.zeros((rows, columns), dtype=np.uint8)
        stamp_squares(segments, frame, cells, half_side)
        return cls(cells, frame, half_side)

    @classmethod
    def of_points(cls, points: Points, half_side: float, resolution: float) -> Raster:
        """Squares around (N, 2) points."""
        return cls.build(np.hstack((points, points)), half_side, resolution)

    @classmethod
    def smooth(cls, segments: NDArray[np.float64], deviation: float, resolution: float) -> Raster:
        """Likelihood of a return at a distance from (S, 4) segments: a Gaussian of ``deviation`` (m)."""
        reach = FIELD_REACH * deviation
        frame, rows, columns = _layout(segments, reach, resolution, 255)
        cells = np.zeros((rows, columns), dtype=np.uint8)
        stamp_field(segments, frame, cells, deviation, reach)
        return cls(cells, frame, deviation)

    def extended(self, segments: NDArray[np.float64]) -> Raster | None:
        """The raster with more (S, 4) segments; takes over this one's cells. None where it would be too large."""
        if len(segments) == 0:
            return self
        smooth = self.frame[3] > 1
        reach = FIELD_REACH * self.half_side if smooth else self.half_side
        ends = segments.reshape(-1, 2)
        low, high = ends.min(axis=0) - reach, ends.max(axis=0) + reach
        room = make_room(self.cells, self.frame, low, high, 0, MAXIMUM_CELLS_PER_SIDE)
        if room is None:
            return None
        cells, frame = room
        if smooth:
            stamp_field(segments, frame, cells, self.half_side, reach)
        else:
            stamp_squares(segments, frame, cells, self.half_side)
        return Raster(cells, frame, self.half_side)


def _layout(
    segments: NDArray[np.float64], reach: float, resolution: float, top: int
) -> tuple[NDArray[np.float64], int, int]:
    """Frame, rows and columns of a raster that holds ``reach`` (m) around segments, and a border."""
    if len(segments) == 0:
        return np.array([0.0, 0.0, 1.0, top]), 3, 3
    ends = segments.reshape(-1, 2)
    extent = ends.max(axis=0) - ends.min(axis=0) + 2.0 * reach
    resolution = max(resolution, float(extent.max()) / MAXIMUM_CELLS_PER_SIDE)
    low = ends.min(axis=0) - reach - 1.5 * resolution
    columns, rows = (int(v) for v in np.ceil(extent / resolution) + 4)
    return np.array([low[0], low[1], 1.0 / resolution, top]), rows, columns


@kernel
def stamp_field(
    segments: NDArray[np.float64],
    frame: NDArray[np.float64],
    cells: NDArray[np.uint8],
    deviation: float,
    reach: float,
) -> None:
    """Raise each cell to the likelihood of its centre's distance from the nearest segment, in place."""
    per_metre, top = frame[2], frame[3]
    cell = 1.0 / per_metre
    for k in range(segments.shape[0]):
        ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
        left = int((min(ax, bx) - reach - frame[0]) * per_metre)
        right = int((max(ax, bx) + reach - frame[0]) * per_metre)
        bottom = int((min(ay, by) - reach - frame[1]) * per_metre)
        above = int((max(ay, by) + reach - frame[1]) * per_metre)
        for row in range(bottom, above + 1):
            for column in range(left, right + 1):
                x, y = frame[0] + (column + 0.5) * cell, frame[1] + (row + 0.5) * cell
                squared = squared_distance(segments[k], x, y)
                if squared <= reach * reach:
                    worth = np.uint8(top * math.exp(-0.5 * squared / (deviation * deviation)) + 0.5)
                    if worth > cells[row, column]:
                        cells[row, column] = worth


@kernel
def stamp_squares(
    segments: NDArray[np.float64], frame: NDArray[np.float64], cells: NDArray[np.uint8], half_side: float
) -> None:
    """Set the cells whose centre is in a square around some place of a segment to 1, in place.

    A segment is walked in steps of at most a cell, so the squares of its inner places overlap.
    """
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
