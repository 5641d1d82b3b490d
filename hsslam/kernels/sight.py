"""How far a scan saw in every direction, and what of another scan lies where it looked through.

A return that lies off the known surface says nothing against a pose where nobody had looked before: robots that back
out of a room see new walls beside them. It does where a scan saw that there is nothing, and so does a beam that went
through a known wall.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.surface import nearest_segment, squared_distance
from hsslam.se2 import Points, Pose, Poses

DIRECTIONS = 360
"""Directions that a scan's sight is kept for."""

PER_RADIAN = DIRECTIONS / (2.0 * math.pi)

WIDEST_GAP = math.radians(5.0)
"""Two neighbouring returns see what lies between them if their beams are no further apart than this (rad)."""

MARGIN = 0.15
"""A place counts as looked through if the beams around it reached further by more than this (m)."""


@kernel
def direction_of(dx: float, dy: float) -> int:
    """Which of the directions a vector points in."""
    return int((math.atan2(dy, dx) + math.pi) * PER_RADIAN) % DIRECTIONS


@kernel
def sight_of(points: Points, laser: Pose) -> NDArray[np.float64]:
    """How far the beams of a scan reached at least, direction by direction.

    Parameters
    ----------
    points : Points
        (N, 2) m, returns in the order of the beams, in the robot's frame.
    laser : Pose
        In that frame; its heading does not matter.

    Returns
    -------
    float64 (DIRECTIONS,)
        Range (m) up to which nothing is in the way, from -pi on, in the robot's frame; 0 where no beam went. A
        direction has the least range of the beams around it, so that an edge counts as the nearer side.
    """
    reach = np.full(DIRECTIONS, math.inf)
    last_bearing = last_range = 0.0
    for i in range(points.shape[0]):
        dx, dy = points[i, 0] - laser[0], points[i, 1] - laser[1]
        length, bearing = math.hypot(dx, dy), math.atan2(dy, dx)
        turn = bearing - last_bearing
        turn -= 2.0 * math.pi * round(turn / (2.0 * math.pi))
        if i > 0 and abs(turn) <= WIDEST_GAP:
            least = min(length, last_range)
            first = math.floor((last_bearing + min(turn, 0.0) + math.pi) * PER_RADIAN) - 1
            last = math.floor((last_bearing + max(turn, 0.0) + math.pi) * PER_RADIAN) + 1
            for k in range(first, last + 1):
                reach[k % DIRECTIONS] = min(reach[k % DIRECTIONS], least)
        last_bearing, last_range = bearing, length
    reach[np.isinf(reach)] = 0.0
    return reach


@kernel
def looked_through(reach: NDArray[np.float64], dx: float, dy: float) -> bool:
    """Whether a scan saw past a place (m), seen from its laser along the robot's axes."""
    limit = float(reach[direction_of(dx, dy)]) - MARGIN
    return limit > 0.0 and dx * dx + dy * dy < limit * limit


@kernel
def known_empty(reaches: NDArray[np.float64], lasers: Poses, x: float, y: float) -> bool:
    """Whether any of the known scans saw past a place (m)."""
    for j in range(reaches.shape[0]):
        c, s = math.cos(lasers[j, 2]), math.sin(lasers[j, 2])
        dx, dy = x - lasers[j, 0], y - lasers[j, 1]
        if looked_through(reaches[j], c * dx + s * dy, c * dy - s * dx):
            return True
    return False


@kernel
def through_walls(known: Points, points: Points, laser: Pose, pose: Pose) -> NDArray[np.bool_]:
    """In which directions a scan at a pose saw past known returns; parameters as those of `agreement`."""
    through = np.full(DIRECTIONS, False)
    reach = sight_of(points, laser)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for m in range(known.shape[0]):
        x, y = known[m, 0] - pose[0], known[m, 1] - pose[1]
        dx, dy = c * x + s * y - laser[0], c * y - s * x - laser[1]
        if looked_through(reach, dx, dy):
            through[direction_of(dx, dy)] = True
    return through


@kernel
def agreement(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    reaches: NDArray[np.float64],
    lasers: Poses,
    known: Points,
    points: Points,
    laser: Pose,
    pose: Pose,
    distance: float,
) -> float:
    """Share of a scan's returns that lie on the known surface, of those that do or should.

    Parameters
    ----------
    pieces, nearest, frame
        Of the reference's `Surface`.
    reaches : float64 (K, DIRECTIONS)
        What the reference's scans saw: see `sight_of`.
    lasers : Poses
        (K, 3) where from, in the reference's frame, turned as the robot was.
    known : Points
        (M, 2) m, the reference's returns.
    points : Points
        (N, 2) m, the scan, in the robot's frame, in the order of the beams.
    laser : Pose
        Where it comes from, there.
    pose : Pose
        Of the robot, in the reference's frame.
    distance : float
        Returns within it of the surface lie on it (m).

    Returns
    -------
    float
        Returns off the surface count if a known scan looked through their place, or if their beam went through a
        known wall; others are news. 1 where all that counts lies on the surface, 0 where nothing does.
    """
    on = against = 0
    through = through_walls(known, points, laser, pose)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        k = nearest_segment(nearest, frame, x, y)
        if k >= 0 and squared_distance(pieces, k, x, y) <= distance * distance:
            on += 1
        elif through[direction_of(points[i, 0] - laser[0], points[i, 1] - laser[1])] or known_empty(
            reaches, lasers, x, y
        ):
            against += 1
    return on / max(on + against, 1)
