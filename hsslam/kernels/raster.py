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
from hsslam.kernels.surface import Surface, bounds
from hsslam.se2 import Points

MAXIMUM_CELLS_PER_SIDE = 4000

FIELD_REACH = 2.5
"""A smooth field ends at this many standard deviations."""

EIGHTH = 0.25 * math.pi
"""An eighth of a turn (rad): directions that surfaces face are told apart in as many steps."""

ANY = 255
"""Mark of a cell that points hit whichever way they face."""

BESIDE = 2
"""Eighths of a turn by which a point may face another way than the surface that it hits: the other side of a wall
faces four."""


@dataclass(frozen=True, eq=False)
class Raster:
    """What a point is worth where it falls.

    Parameters
    ----------
    cells : uint8 (H, W)
        From 0 to ``top``; where sides count, a bit for each of eight directions that a point may face, seen from its
        surface, to hit what is here.
    frame : float64 (4,) or (5,)
        Position (m) of the corner of cell (0, 0), cells per metre, and the largest worth: 1 where hits are
        counted, 255 for a smooth field. A fifth number says that sides count.
    half_side : float
        Of the squares, or standard deviation of the field (m).
    """

    cells: NDArray[np.uint8]
    frame: NDArray[np.float64]
    half_side: float

    @classmethod
    def build(cls, segments: NDArray[np.float64], half_side: float, resolution: float) -> Raster:
        """Squares of half side ``half_side`` (m) along (S, 4) segments; equal ends make a point."""
        marks = np.ones(len(segments), dtype=np.uint8)
        return cls(*rasterise_squares(segments, marks, half_side, resolution), half_side)

    @classmethod
    def of_sides(cls, surface: Surface, half_side: float, resolution: float) -> Raster:
        """Squares along a surface's segments, which only points hit that face the same way."""
        marks = marks_of(surface.pieces)
        cells, frame = rasterise_squares(surface.segments, marks, half_side, resolution)
        return cls(cells, np.append(frame, 1.0), half_side)

    @property
    def sided(self) -> bool:
        """Whether sides count."""
        return counts_sides(self.frame)

    @classmethod
    def of_points(cls, points: Points, half_side: float, resolution: float) -> Raster:
        """Squares around (N, 2) points."""
        return cls.build(np.concatenate((points, points), axis=1), half_side, resolution)

    @classmethod
    def smooth(cls, segments: NDArray[np.float64], deviation: float, resolution: float) -> Raster:
        """Likelihood of a return at a distance from (S, 4) segments: a Gaussian of ``deviation`` (m)."""
        cells, frame = blank(segments, FIELD_REACH * deviation, resolution, 255.0)
        stamp_field(segments, frame, cells, deviation, FIELD_REACH * deviation)
        return cls(cells, frame, deviation)

    def extended(self, segments: NDArray[np.float64], pieces: NDArray[np.float64]) -> Raster | None:
        """The raster with more segments; takes over this one's cells. None where it would be too large.

        (S, 4) segments and (S, 8) pieces are those of a `Surface`; of points, pieces that are zero.
        """
        if len(segments) == 0:
            return self
        smooth = self.frame[3] > 1
        reach = FIELD_REACH * self.half_side if smooth else self.half_side
        left, bottom, right, top = bounds(segments)
        low, high = (left - reach, bottom - reach), (right + reach, top + reach)
        room = make_room(self.cells, self.frame, low, high, 0, MAXIMUM_CELLS_PER_SIDE)
        if room is None:
            return None
        cells, frame = room
        if smooth:
            stamp_field(segments, frame, cells, self.half_side, reach)
        else:
            marks = marks_of(pieces) if self.sided else np.ones(len(segments), dtype=np.uint8)
            stamp_squares(segments, marks, frame, cells, self.half_side)
        return Raster(cells, frame, self.half_side)


@kernel
def counts_sides(frame: NDArray[np.float64]) -> bool:
    """Whether sides count on the raster of this frame."""
    return len(frame) > 4


@kernel
def facing_of(nx: float, ny: float) -> float:
    """Which way a surface of this normal faces, in eighths of a turn from 0 to 8; -1 where it has none."""
    if nx == 0.0 and ny == 0.0:
        return -1.0
    return (math.atan2(ny, nx) / EIGHTH) % 8.0


@kernel
def marks_of(pieces: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Directions that points may face to hit each of (S, 8) pieces of a `Surface`, as bits, uint8 (S,)."""
    marks = np.empty(pieces.shape[0], dtype=np.uint8)
    for k in range(pieces.shape[0]):
        facing = facing_of(pieces[k, 5], pieces[k, 6])
        mark = ANY if facing < 0.0 else 0
        if facing >= 0.0:
            for step in range(-BESIDE, BESIDE + 1):
                mark |= 1 << ((int(facing + 0.5) + step) & 7)
        marks[k] = mark
    return marks


@kernel
def blank(
    segments: NDArray[np.float64], reach: float, resolution: float, top: float
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Cells, all zero, and frame of a raster that holds ``reach`` (m) around segments, and a border."""
    left, bottom, right, above = bounds(segments)
    width, height = right - left + 2.0 * reach, above - bottom + 2.0 * reach
    cell = max(resolution, max(width, height) / MAXIMUM_CELLS_PER_SIDE)
    columns, rows = math.ceil(width / cell) + 4, math.ceil(height / cell) + 4
    frame = np.array([left - reach - 1.5 * cell, bottom - reach - 1.5 * cell, 1.0 / cell, top])
    return np.zeros((rows, columns), dtype=np.uint8), frame


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
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        left = int((min(ax, bx) - reach - frame[0]) * per_metre)
        right = int((max(ax, bx) + reach - frame[0]) * per_metre)
        bottom = int((min(ay, by) - reach - frame[1]) * per_metre)
        above = int((max(ay, by) + reach - frame[1]) * per_metre)
        for row in range(bottom, above + 1):
            for column in range(left, right + 1):
                px, py = frame[0] + (column + 0.5) * cell - ax, frame[1] + (row + 0.5) * cell - ay
                t = min(max((px * dx + py * dy) / length, 0.0), 1.0) if length > 0.0 else 0.0
                squared = (px - t * dx) ** 2 + (py - t * dy) ** 2
                if squared <= reach * reach:
                    worth = np.uint8(top * math.exp(-0.5 * squared / (deviation * deviation)) + 0.5)
                    cells[row, column] = max(cells[row, column], worth)


@kernel
def rasterise_squares(
    segments: NDArray[np.float64], marks: NDArray[np.uint8], half_side: float, resolution: float
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Cells and frame of a raster of squares."""
    cells, frame = blank(segments, half_side, resolution, 1.0)
    stamp_squares(segments, marks, frame, cells, half_side)
    return cells, frame


@kernel
def stamp_squares(
    segments: NDArray[np.float64],
    marks: NDArray[np.uint8],
    frame: NDArray[np.float64],
    cells: NDArray[np.uint8],
    half_side: float,
) -> None:
    """Add a segment's mark, uint8 (S,), to the cells whose centre is in a square around some place of it, in place.

    In a row of cells these form one run: the columns of the places of the segment that are within half a side
    of the row, and half a side more at each end.
    """
    columns = cells.shape[1]
    flat = cells.reshape(cells.size)
    half = half_side * frame[2]
    for k in range(segments.shape[0]):
        # In cells, shifted so that a cell's centre has a whole number; from the lower end to the upper.
        ax, ay = (segments[k, 0] - frame[0]) * frame[2] - 0.5, (segments[k, 1] - frame[1]) * frame[2] - 0.5
        bx, by = (segments[k, 2] - frame[0]) * frame[2] - 0.5, (segments[k, 3] - frame[1]) * frame[2] - 0.5
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        slope = (bx - ax) / (by - ay) if by - ay > 1e-9 else 0.0
        low, high = min(ax, bx), max(ax, bx)
        for row in range(math.ceil(ay - half), math.floor(by + half) + 1):
            first, last = low, high
            if slope != 0.0:
                # Where the segment enters and leaves the strip of half a side above and below the row.
                enters, leaves = ax + slope * (row - half - ay), ax + slope * (row + half - ay)
                first, last = max(low, min(enters, leaves)), min(high, max(enters, leaves))
            start = np.uint64(row * columns + math.ceil(first - half))
            for column in range(math.floor(last + half) - math.ceil(first - half) + 1):
                flat[start + np.uint64(column)] |= marks[k]
