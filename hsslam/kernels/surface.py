"""The surface through a reference's points, and which piece of it is nearest to any place.

Neighbouring returns of the same surface are joined by a segment; a lone return is a segment of length zero. Every
segment carries a line fitted to the returns around it, since a segment between two noisy returns a few centimetres
apart points nowhere in particular. A raster answers "which segment is nearest?".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.growth import make_room
from hsslam.kernels.joints import joints_of
from hsslam.kernels.lines import fit_line, noise_of
from hsslam.se2 import Points

FIT_SPAN = 0.15
"""A line is fitted to the returns within this stretch of surface around a segment (m), or more if they are noisy."""

FIT_ROUGHNESS = 0.03
"""Where the returns stray further from the fitted line than this (m, rms) there is a corner: no smoothing."""

REACH = 0.15
"""The raster knows the nearest segment up to this distance (m)."""

RESOLUTION = 0.05
"""Side of a raster cell (m), unless the reference is so large that cells must grow."""

MAXIMUM_CELLS_PER_SIDE = 2000

LANES = 16
"""Cells rasterised at a time."""

NUMBER_BITS = 16
"""Bits of a segment's number in a cell of the raster, unless there are more segments; the others are its distance."""

EMPTY = np.uint32(0xFFFFFFFF)
"""A cell with no segment within reach."""


@dataclass(frozen=True, eq=False)
class Surface:
    """Segments of a reference, and a raster of the nearest one.

    Parameters
    ----------
    segments : float64 (S, 4)
        Ends ``ax, ay, bx, by`` (m); equal ends for a lone return.
    pieces : float64 (S, 8)
        What the distance of a place from a segment and from its line is computed from, side by side in memory: a
        segment's beginning ``ax, ay``, unit direction ``ux, uy`` and length, then the fitted line's unit normal
        and offset, ``nx * x + ny * y = offset``; a lone return's direction and normal are zero.
    tilts : float64 (S, 2)
        Variance of the fitted line's direction per variance of a return across it (1 / m^2), and that variance as
        the returns that it was fitted to tell it (m^2; 0 where they are two); both 0 for a lone return.
    nearest : uint32 (H, W)
        For each cell's centre the nearest segment: see `nearest_segment`.
    frame : float64 (4,)
        Position (m) of the corner of cell (0, 0), cells per metre, and the bits of a segment's number in a cell.
    """

    segments: NDArray[np.float64]
    pieces: NDArray[np.float64]
    tilts: NDArray[np.float64]
    nearest: NDArray[np.uint32]
    frame: NDArray[np.float64]

    @classmethod
    def build(cls, points: Points) -> Surface:
        """Make the surface of (N, 2) finite points in beam order; scans may follow one another."""
        segments, pieces, tilts = join(points, FIT_SPAN, FIT_ROUGHNESS)
        return cls(segments, pieces, tilts, *rasterise_nearest(segments, RESOLUTION, REACH))

    def extended(self, points: Points) -> Surface:
        """The surface with one more scan's (N, 2) points; takes over this one's raster, which is then void."""
        if len(points) == 0:
            return self
        added, pieces, tilts = join(points, FIT_SPAN, FIT_ROUGHNESS)
        segments = np.concatenate((self.segments, added))
        pieces, tilts = np.concatenate((self.pieces, pieces)), np.concatenate((self.tilts, tilts))
        left, bottom, right, top = bounds(added)
        low, margin = (left - REACH, bottom - REACH), REACH + LANES / float(self.frame[2])
        high = (right + margin, top + margin)
        room = None
        if len(self.segments) > 0 and len(segments) < 2 ** int(self.frame[3]):
            room = make_room(self.nearest, self.frame, low, high, int(EMPTY), MAXIMUM_CELLS_PER_SIDE)
        if room is None:
            return Surface(segments, pieces, tilts, *rasterise_nearest(segments, RESOLUTION, REACH))
        add_nearest(segments, len(self.segments), *room, REACH)
        return Surface(segments, pieces, tilts, *room)


@kernel
def all_finite(points: Points) -> bool:
    """Whether all coordinates are."""
    # What is not finite makes the sum not finite either: it is cheaper to look at once.
    total = 0.0
    for i in range(points.shape[0]):
        total += 0.0 * points[i, 0] + 0.0 * points[i, 1]
    return total == 0.0


@kernel
def bounds(segments: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Smallest and largest coordinates of (S, 4) segments: left, bottom, right, top; all zero if there are none."""
    if segments.shape[0] == 0:
        return 0.0, 0.0, 0.0, 0.0
    left, bottom = right, top = segments[0, 0], segments[0, 1]
    for k in range(segments.shape[0]):
        for end in (0, 2):
            x, y = segments[k, end], segments[k, end + 1]
            left, right = min(left, x), max(right, x)
            bottom, top = min(bottom, y), max(top, y)
    return left, bottom, right, top


@kernel
def join(
    points: Points, span: float, roughness: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Segments (S, 4) between joined neighbours, see `joints_of`, `Surface.pieces` and `Surface.tilts`."""
    n = points.shape[0]
    segments = np.empty((n, 4))
    pieces = np.empty((n, 8))
    tilts = np.empty((n, 2))
    line = np.empty(6)
    joined = joints_of(points)
    noise = noise_of(points, joined)
    count = 0
    joined_before = False
    for i in range(n):
        dx = dy = length = 0.0
        if joined[i]:
            dx = points[i + 1, 0] - points[i, 0]
            dy = points[i + 1, 1] - points[i, 1]
            length = math.sqrt(dx * dx + dy * dy)
            fit_line(points, i, joined, span, roughness, noise, line)
        elif not joined_before:
            line[:] = 0.0
        if joined[i] or not joined_before:
            ax, ay = points[i, 0], points[i, 1]
            segments[count, 0], segments[count, 1] = ax, ay
            segments[count, 2], segments[count, 3] = ax, ay
            if joined[i]:
                segments[count, 2], segments[count, 3] = points[i + 1, 0], points[i + 1, 1]
            pieces[count, 0], pieces[count, 1] = ax, ay
            pieces[count, 2] = dx / length if length > 0.0 else 0.0
            pieces[count, 3] = dy / length if length > 0.0 else 0.0
            pieces[count, 4] = length
            pieces[count, 5], pieces[count, 6] = line[2], line[3]
            pieces[count, 7] = line[2] * line[0] + line[3] * line[1]
            tilts[count, 0], tilts[count, 1] = line[4], line[5]
            count += 1
        joined_before = joined[i]
    return segments[:count].copy(), pieces[:count].copy(), tilts[:count].copy()


@kernel
def lines_of(points: Points, span: float, roughness: float) -> NDArray[np.float64]:
    """Line through each point and its neighbours: unit normal and offset, (N, 3); zero where there are none."""
    n = points.shape[0]
    lines = np.empty((n, 3))
    line = np.zeros(6)
    joined = joints_of(points)
    noise = noise_of(points, joined)
    joined_before = False
    for i in range(n):
        if joined[i]:
            fit_line(points, i, joined, span, roughness, noise, line)
        elif not joined_before:
            line[:] = 0.0
        lines[i, 0], lines[i, 1] = line[2], line[3]
        lines[i, 2] = line[2] * line[0] + line[3] * line[1]
        joined_before = joined[i]
    return lines


@kernel
def scan_lines(points: Points) -> NDArray[np.float64]:
    """Lines through a scan's (N, 2) points, see `lines_of`: fitted as those of a reference's surface are."""
    return lines_of(points, FIT_SPAN, FIT_ROUGHNESS)


@kernel
def squared_distance(pieces: NDArray[np.float64], k: int, x: float, y: float) -> float:
    """Squared distance (m^2) of a place from segment ``k``, given `Surface.pieces`."""
    px, py = x - pieces[k, 0], y - pieces[k, 1]
    along = min(max(px * pieces[k, 2] + py * pieces[k, 3], 0.0), pieces[k, 4])
    ex, ey = px - along * pieces[k, 2], py - along * pieces[k, 3]
    squared: float = ex * ex + ey * ey
    return squared


@kernel
def rasterise_nearest(
    segments: NDArray[np.float64], resolution: float, reach: float
) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
    """Find the segment nearest to each cell's centre: `Surface.nearest` and `Surface.frame`."""
    left, bottom, right, top = bounds(segments)
    cell = max(resolution, (max(right - left, top - bottom) + 2.0 * reach) / (MAXIMUM_CELLS_PER_SIDE - LANES))
    # The last lanes of a row's last cells must not end up in the next row.
    columns = math.ceil((right - left + 2.0 * reach) / cell) + 1 + LANES
    rows = math.ceil((top - bottom + 2.0 * reach) / cell) + 1
    bits = NUMBER_BITS
    while segments.shape[0] >= 1 << (bits - 1):
        bits += 1
    frame = np.array([left - reach, bottom - reach, 1.0 / cell, float(bits)])
    nearest = np.full((rows, columns), EMPTY, dtype=np.uint32)
    add_nearest(segments, 0, nearest, frame, reach)
    return nearest, frame


@kernel
def add_nearest(
    segments: NDArray[np.float64],
    begin: int,
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    reach: float,
) -> None:
    """Bring the segments from number ``begin`` on into a raster of the earlier ones, in place.

    A cell holds its squared distance from the segment, in the upper bits, and the segment's number, so that the
    nearest is the smallest number: no branch, and `LANES` cells at a time. Right of every segment's reach a row
    must have as many cells more.
    """
    rows, columns = nearest.shape
    flat = nearest.reshape(nearest.size)
    cell = 1.0 / frame[2]
    bits = int(frame[3])
    shift, empty = np.uint32(bits), EMPTY
    limit = np.float32(reach * reach)
    steps = np.float32((2.0 ** (32 - bits) - 2.0) / (reach * reach))
    zero, one, wide = np.float32(0.0), np.float32(1.0), np.float32(cell)
    for k in range(begin, segments.shape[0]):
        ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
        first = int((min(ax, bx) - reach - frame[0]) * frame[2])
        last = int((max(ax, bx) + reach - frame[0]) * frame[2])
        low = max(int((min(ay, by) - reach - frame[1]) * frame[2]), 0)
        high = min(int((max(ay, by) + reach - frame[1]) * frame[2]), rows - 1)
        dx, dy = np.float32(bx - ax), np.float32(by - ay)
        length = dx * dx + dy * dy
        per_length = one / length if length > zero else zero
        number = np.uint32(k)
        for row in range(low, high + 1):
            py = np.float32(frame[1] + (row + 0.5) * cell - ay)
            start = max(first, 0)
            while start <= last:
                base = np.float32(frame[0] + (start + 0.5) * cell - ax)
                at = np.uint64(row * columns + start)
                for lane in range(LANES):
                    px = base + np.float32(lane) * wide
                    t = min(max((px * dx + py * dy) * per_length, zero), one)
                    ex, ey = px - t * dx, py - t * dy
                    squared = ex * ex + ey * ey
                    near = np.uint32(np.int32(min(squared, limit) * steps))
                    key = np.uint32(np.uint32(near << shift) | number)
                    found = key if squared <= limit else empty
                    flat[at + np.uint64(lane)] = min(flat[at + np.uint64(lane)], found)
                start += LANES


@kernel
def nearest_segment(nearest: NDArray[np.uint32], frame: NDArray[np.float64], x: float, y: float) -> int:
    """Number of the segment nearest to a place, -1 where none is within reach."""
    u = (x - frame[0]) * frame[2]
    v = (y - frame[1]) * frame[2]
    if u < 0.0 or v < 0.0 or u >= nearest.shape[1] or v >= nearest.shape[0]:
        return -1
    key = nearest[int(v), int(u)]
    if key == EMPTY:
        return -1
    return int(key) & ((1 << int(frame[3])) - 1)
