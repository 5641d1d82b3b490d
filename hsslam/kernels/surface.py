"""The surface through a reference's points, and which piece of it is nearest to any place.

Neighbouring returns that are close to one another are joined by a segment; a lone return is a segment of
length zero. Every segment carries a line fitted to the returns around it, since a segment between two noisy
returns a few centimetres apart points nowhere in particular. A raster answers "which segment is nearest?".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.growth import make_room
from hsslam.se2 import Points

GAP = 0.35
"""Neighbouring returns further apart than this (m) are not joined."""

FIT_SPAN = 0.2
"""A line is fitted to the returns within this stretch of surface around a segment (m)."""

FIT_ROUGHNESS = 0.03
"""Where the returns stray further from the fitted line than this (m, rms) there is a corner: no smoothing."""

REACH = 0.15
"""The raster knows the nearest segment up to this distance (m)."""

RESOLUTION = 0.05
"""Side of a raster cell (m), unless the reference is so large that cells must grow."""

MAXIMUM_CELLS_PER_SIDE = 2000


@dataclass(frozen=True, eq=False)
class Surface:
    """Segments of a reference, and a raster of the nearest one.

    Parameters
    ----------
    segments : float64 (S, 4)
        Ends ``ax, ay, bx, by`` (m); equal ends for a lone return.
    lines : float64 (S, 4)
        A point of the fitted line and its unit normal, ``mx, my, nx, ny``; a lone return's normal is zero.
    nearest : int32 (H, W)
        Number of the segment nearest to each cell's centre, -1 where none is within `REACH`.
    frame : float64 (3,)
        Position (m) of the corner of cell (0, 0), and cells per metre.
    """

    segments: NDArray[np.float64]
    lines: NDArray[np.float64]
    nearest: NDArray[np.int32]
    frame: NDArray[np.float64]

    @classmethod
    def build(cls, points: Points) -> Surface:
        """Make the surface of (N, 2) finite points in beam order; scans may follow one another."""
        if len(points) == 0:
            return cls(
                np.empty((0, 4)),
                np.empty((0, 4)),
                np.full((1, 1), -1, dtype=np.int32),
                np.array([0.0, 0.0, 1.0]),
            )
        return cls._of(*join(points, GAP, FIT_SPAN, FIT_ROUGHNESS))

    @classmethod
    def _of(cls, segments: NDArray[np.float64], lines: NDArray[np.float64]) -> Surface:
        ends = segments.reshape(-1, 2)
        low = ends.min(axis=0) - REACH
        extent = ends.max(axis=0) + REACH - low
        resolution = max(RESOLUTION, float(extent.max()) / MAXIMUM_CELLS_PER_SIDE)
        columns, rows = (int(v) for v in np.ceil(extent / resolution) + 1)
        frame = np.array([low[0], low[1], 1.0 / resolution])
        return cls(segments, lines, rasterise_nearest(segments, frame, rows, columns, REACH), frame)

    def extended(self, points: Points) -> Surface:
        """The surface with one more scan's (N, 2) points; takes over this one's raster, which is then void."""
        if len(self.segments) == 0 or len(points) == 0:
            return Surface.build(points) if len(points) else self
        added, lines = join(points, GAP, FIT_SPAN, FIT_ROUGHNESS)
        segments, lines = np.vstack((self.segments, added)), np.vstack((self.lines, lines))
        low, high = points.min(axis=0) - REACH, points.max(axis=0) + REACH
        room = make_room(self.nearest, self.frame, low, high, -1, MAXIMUM_CELLS_PER_SIDE)
        if room is None:
            return Surface._of(segments, lines)
        nearest, frame = room
        add_nearest(segments, len(self.segments), nearest, frame, REACH)
        return Surface(segments, lines, nearest, frame)


@kernel
def join(
    points: Points, gap: float, span: float, roughness: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Segments (S, 4) between neighbouring points closer than ``gap``, and their fitted lines (S, 4)."""
    n = points.shape[0]
    segments = np.empty((n, 4))
    lines = np.empty((n, 4))
    count = 0
    joined_before = False
    for i in range(n):
        joined = False
        if i + 1 < n:
            dx = points[i + 1, 0] - points[i, 0]
            dy = points[i + 1, 1] - points[i, 1]
            joined = dx * dx + dy * dy <= gap * gap
        if joined:
            segments[count, 0], segments[count, 1] = points[i, 0], points[i, 1]
            segments[count, 2], segments[count, 3] = points[i + 1, 0], points[i + 1, 1]
            fit_line(points, i, gap, span, roughness, lines[count])
            count += 1
        elif not joined_before:
            segments[count, 0], segments[count, 1] = points[i, 0], points[i, 1]
            segments[count, 2], segments[count, 3] = points[i, 0], points[i, 1]
            lines[count, 0], lines[count, 1] = points[i, 0], points[i, 1]
            lines[count, 2], lines[count, 3] = 0.0, 0.0
            count += 1
        joined_before = joined
    return segments[:count].copy(), lines[:count].copy()


@kernel
def fit_line(
    points: Points, i: int, gap: float, span: float, roughness: float, out: NDArray[np.float64]
) -> None:
    """Fit a line to the points around segment ``i``, ``i + 1``; into ``out`` (4,): point, normal.

    The stretch grows by a point at each end in turn while it stays connected and within half of ``span`` of
    the segment's middle; with too rough a fit the segment itself is the line.
    """
    n = points.shape[0]
    mx = 0.5 * (points[i, 0] + points[i + 1, 0])
    my = 0.5 * (points[i, 1] + points[i + 1, 1])
    limit = 0.25 * span * span
    first, last = i, i + 1
    for step in (-1, 1):
        j = i if step < 0 else i + 1
        while 0 <= j + step < n:
            k = j + step
            gx, gy = points[k, 0] - points[j, 0], points[k, 1] - points[j, 1]
            rx, ry = points[k, 0] - mx, points[k, 1] - my
            if gx * gx + gy * gy > gap * gap or rx * rx + ry * ry > limit:
                break
            j = k
        if step < 0:
            first = j
        else:
            last = j
    count = last - first + 1
    if count > 2:
        cx = cy = 0.0
        for j in range(first, last + 1):
            cx += points[j, 0]
            cy += points[j, 1]
        cx /= count
        cy /= count
        xx = xy = yy = 0.0
        for j in range(first, last + 1):
            dx, dy = points[j, 0] - cx, points[j, 1] - cy
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
        half_trace = 0.5 * (xx + yy)
        root = math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
        if half_trace - root <= roughness * roughness * count and root > 0.0:
            angle = 0.5 * math.atan2(2.0 * xy, xx - yy)
            out[0], out[1] = cx, cy
            out[2], out[3] = -math.sin(angle), math.cos(angle)
            return
    dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
    length = math.sqrt(dx * dx + dy * dy)
    out[0], out[1] = mx, my
    if length > 0.0:
        out[2], out[3] = -dy / length, dx / length
    else:
        out[2], out[3] = 0.0, 0.0


@kernel
def squared_distance(segment: NDArray[np.float64], x: float, y: float) -> float:
    """Squared distance (m^2) of a place from a segment (4,)."""
    dx, dy = segment[2] - segment[0], segment[3] - segment[1]
    px, py = x - segment[0], y - segment[1]
    length = dx * dx + dy * dy
    t = 0.0
    if length > 0.0:
        t = min(max((px * dx + py * dy) / length, 0.0), 1.0)
    ex, ey = px - t * dx, py - t * dy
    squared: float = ex * ex + ey * ey
    return squared


@kernel
def rasterise_nearest(
    segments: NDArray[np.float64], frame: NDArray[np.float64], rows: int, columns: int, reach: float
) -> NDArray[np.int32]:
    """Number of the segment nearest to each cell's centre, int32 (rows, columns); -1 beyond ``reach``."""
    nearest = np.full((rows, columns), -1, dtype=np.int32)
    best = np.empty((rows, columns), dtype=np.float32)
    per_metre = frame[2]
    cell = 1.0 / per_metre
    for k in range(segments.shape[0]):
        ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
        left = max(int((min(ax, bx) - reach - frame[0]) * per_metre), 0)
        right = min(int((max(ax, bx) + reach - frame[0]) * per_metre), columns - 1)
        bottom = max(int((min(ay, by) - reach - frame[1]) * per_metre), 0)
        top = min(int((max(ay, by) + reach - frame[1]) * per_metre), rows - 1)
        dx, dy = bx - ax, by - ay
        length = dx * dx + dy * dy
        per_length = 1.0 / length if length > 0.0 else 0.0
        for row in range(bottom, top + 1):
            py = frame[1] + (row + 0.5) * cell - ay
            for column in range(left, right + 1):
                px = frame[0] + (column + 0.5) * cell - ax
                t = min(max((px * dx + py * dy) * per_length, 0.0), 1.0)
                ex, ey = px - t * dx, py - t * dy
                distance = np.float32(ex * ex + ey * ey)
                if distance <= reach * reach and (nearest[row, column] < 0 or distance < best[row, column]):
                    best[row, column] = distance
                    nearest[row, column] = k
    return nearest


@kernel
def add_nearest(
    segments: NDArray[np.float64],
    first: int,
    nearest: NDArray[np.int32],
    frame: NDArray[np.float64],
    reach: float,
) -> None:
    """Bring the segments from number ``first`` on into a raster of the earlier ones, in place.

    What stands in a cell stays unless the new segment is nearer to the cell's centre.
    """
    rows, columns = nearest.shape
    per_metre = frame[2]
    cell = 1.0 / per_metre
    for k in range(first, segments.shape[0]):
        ax, ay, bx, by = segments[k, 0], segments[k, 1], segments[k, 2], segments[k, 3]
        left = max(int((min(ax, bx) - reach - frame[0]) * per_metre), 0)
        right = min(int((max(ax, bx) + reach - frame[0]) * per_metre), columns - 1)
        bottom = max(int((min(ay, by) - reach - frame[1]) * per_metre), 0)
        top = min(int((max(ay, by) + reach - frame[1]) * per_metre), rows - 1)
        for row in range(bottom, top + 1):
            y = frame[1] + (row + 0.5) * cell
            for column in range(left, right + 1):
                x = frame[0] + (column + 0.5) * cell
                distance = squared_distance(segments[k], x, y)
                if distance > reach * reach:
                    continue
                other = nearest[row, column]
                if other < 0 or distance < squared_distance(segments[other], x, y):
                    nearest[row, column] = k


@kernel
def nearest_segment(nearest: NDArray[np.int32], frame: NDArray[np.float64], x: float, y: float) -> int:
    """Number of the segment nearest to a place, -1 where none is within reach."""
    u = (x - frame[0]) * frame[2]
    v = (y - frame[1]) * frame[2]
    if u < 0.0 or v < 0.0 or u >= nearest.shape[1] or v >= nearest.shape[0]:
        return -1
    found: int = nearest[int(v), int(u)]
    return found
