"""Where beams went through: a raster of what is known to be empty, and which returns lie in the middle of it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points, Pose

CELL = 0.1
"""Side of a cell (m)."""

MARGIN = 0.3
"""A beam says nothing of the last stretch before its return (m)."""

FARTHEST = 12.0
"""Nor of what is further away than this (m): neighbouring beams are too far apart there."""

WIDEST_GAP = math.radians(5.0)
"""Beams further apart than this (rad) are no neighbours."""

AROUND = 0.15
"""A return lies in the middle of free space if that reaches this far to all sides of it (m)."""

GAP = 0.35
"""Neighbouring returns further apart than this (m) are of different things."""

LEAST_POINTS = 3
"""Returns of a thing, at least: single ones tell too little."""

LEAST_SHARE = 0.25
"""A thing is in the middle of free space if more than this share of its returns is: of a wall that drift has moved a
few are."""

STRIDE = 0.7
"""Cells from one place that is marked along a beam to the next."""

FREE = 1
"""Bit of a cell that a beam went through."""

HIT = 2
"""Bit of a cell that a beam ended in."""

HIT_AGAIN = 4
"""Bit of a cell that beams of two scans ended in."""


@kernel
def mark(
    cells: NDArray[np.uint8], frame: NDArray[np.float64], points: Points, laser: Pose, pose: Pose
) -> None:
    """Mark, in place, the cells that a scan's beams went through, and those that they ended in.

    Parameters
    ----------
    cells : uint8 (H, W)
        `FREE`, `HIT` and `HIT_AGAIN` in any combination; room for all that is within `FARTHEST` of the laser.
    frame : float64 (3,)
        Position (m) of the corner of cell (0, 0), cells per metre.
    points : Points
        (N, 2) m, returns in the order of the beams, in the robot's frame.
    laser : Pose
        Where they were seen from, in that frame; its heading does not matter.
    pose : Pose
        Of the robot, in the raster's frame.
    """
    n = points.shape[0]
    rows, columns = cells.shape
    ranges, bearings = np.empty(n), np.empty(n)
    for i in range(n):
        dx, dy = points[i, 0] - laser[0], points[i, 1] - laser[1]
        ranges[i], bearings[i] = math.hypot(dx, dy), math.atan2(dy, dx)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x0 = (pose[0] + c * laser[0] - s * laser[1] - frame[0]) * frame[2]
    y0 = (pose[1] + s * laser[0] + c * laser[1] - frame[1]) * frame[2]
    for i in range(n):
        # As far as the nearest of a beam and its neighbours: what is beside an edge is not known.
        reach = ranges[i]
        for k in (i - 1, i + 1):
            if 0 <= k < n and abs(bearings[k] - bearings[i]) <= WIDEST_GAP:
                reach = min(reach, ranges[k])
        reach = min(reach - MARGIN, FARTHEST) * frame[2]
        ux, uy = math.cos(bearings[i] + pose[2]), math.sin(bearings[i] + pose[2])
        along = 0.0
        while along < reach:
            cells[int(y0 + along * uy), int(x0 + along * ux)] |= FREE
            along += STRIDE
    # All returns of a scan in one cell are one hit: it is only marked once they all have been looked at.
    for bit in (HIT_AGAIN, HIT):
        for i in range(n):
            x = (pose[0] + c * points[i, 0] - s * points[i, 1] - frame[0]) * frame[2]
            y = (pose[1] + s * points[i, 0] + c * points[i, 1] - frame[1]) * frame[2]
            if 0.0 <= x < columns and 0.0 <= y < rows and (bit == HIT or cells[int(y), int(x)] & HIT):
                cells[int(y), int(x)] |= bit


@kernel
def in_free_space(
    cells: NDArray[np.uint8], frame: NDArray[np.float64], points: Points, pose: Pose
) -> NDArray[np.bool_]:
    """Which of a scan's points (N, 2), seen from a pose, are of things in the middle of free space, (N,).

    Near where beams of two scans ended nothing is free, whatever else went through there: glass lets beams pass from
    some sides only, and who walks by does not stay. Parameters as those of `mark`.
    """
    rows, columns = cells.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    around = AROUND * frame[2]
    alone = np.empty(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        x = (pose[0] + c * points[i, 0] - s * points[i, 1] - frame[0]) * frame[2]
        y = (pose[1] + s * points[i, 0] + c * points[i, 1] - frame[1]) * frame[2]
        alone[i] = False
        if not (around <= x < columns - around and around <= y < rows - around):
            continue
        u, v = int(x), int(y)
        all_around = (
            cells[v, u]
            & cells[v, int(x + around)]
            & cells[v, int(x - around)]
            & cells[int(y + around), u]
            & cells[int(y - around), u]
        )
        if all_around & FREE:
            any_near = 0
            for row in range(v - 1, v + 2):
                for column in range(u - 1, u + 2):
                    any_near |= cells[row, column]
            alone[i] = not any_near & HIT_AGAIN
    by_things(points, alone)
    return alone


@kernel
def unseen(
    cells: NDArray[np.uint8], frame: NDArray[np.float64], points: Points, pose: Pose
) -> NDArray[np.bool_]:
    """Which of a scan's points (N, 2), seen from a pose, lie where no beam went or ended, (N,).

    Nor in any of the eight cells around. Parameters as those of `mark`.
    """
    rows, columns = cells.shape
    c, s = math.cos(pose[2]), math.sin(pose[2])
    new = np.ones(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        x = (pose[0] + c * points[i, 0] - s * points[i, 1] - frame[0]) * frame[2]
        y = (pose[1] + s * points[i, 0] + c * points[i, 1] - frame[1]) * frame[2]
        u, v = math.floor(x), math.floor(y)
        for row in range(max(v - 1, 0), min(v + 2, rows)):
            for column in range(max(u - 1, 0), min(u + 2, columns)):
                if cells[row, column] != 0:
                    new[i] = False
    return new


@kernel
def by_things(points: Points, chosen: NDArray[np.bool_]) -> None:
    """Choose, in place, all points of each thing of which enough are chosen, and none of the others."""
    first = chosen_here = 0
    for i in range(points.shape[0]):
        chosen_here += chosen[i]
        last = i + 1 == points.shape[0]
        if not last and math.hypot(points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]) <= GAP:
            continue
        size = i + 1 - first
        chosen[first : i + 1] = size >= LEAST_POINTS and chosen_here > LEAST_SHARE * size
        first, chosen_here = i + 1, 0
