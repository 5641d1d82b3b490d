"""How long the nearest return in each direction has stayed where it is, and how far the laser has gone meanwhile."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points, Pose

BINS = 360
"""Directions that are told apart."""

NEAREST = 1.0
"""Parts of a robot are nearer to its laser than this (m)."""

STAYS = 0.12
"""A return this far off the mean of those before is of something else (m)."""

DEVIATION = 0.04
"""Standard deviation of the ranges of a part, at most (m)."""

LEAST_COUNT = 10
"""Scans that must have seen a part, each from somewhere else."""

LEAST_WAY = 2.0
"""How far from the first place the laser must have been meanwhile (m)."""

LEAST_TURN = math.radians(90.0)
"""And between which headings it must have turned (rad): a wall stays where it is while one drives along it."""

COUNT, MEAN, SQUARES, X, Y, WAY, LOW, HIGH = range(8)
"""Columns: scans, their mean range and the sum of its squared deviations, where the first was taken, how far from there
the laser has been, and its least and greatest heading."""


@kernel
def direction(x: float, y: float) -> int:
    """Number of the direction of a point, from the laser."""
    return int((math.atan2(y, x) + math.pi) / math.tau * BINS) % BINS


@kernel
def watch(seen: NDArray[np.float64], points: Points, pose: Pose) -> None:
    """Take note, in place, of another scan.

    Parameters
    ----------
    seen : float64 (BINS, 8)
        A row per direction; zeros at first.
    points : Points
        (N, 2) m, returns in the laser's frame, in any order.
    pose : Pose
        Where the scan was taken, its heading unwrapped.
    """
    nearest = np.full(BINS, np.inf)
    for i in range(points.shape[0]):
        k = direction(points[i, 0], points[i, 1])
        nearest[k] = min(nearest[k], math.hypot(points[i, 0], points[i, 1]))
    for k in range(BINS):
        r, row = nearest[k], seen[k]
        if math.isinf(r):
            continue
        if r > NEAREST:
            row[COUNT] = 0.0
            continue
        if row[COUNT] == 0.0 or abs(r - row[MEAN]) > STAYS:
            row[:] = 0.0
            row[MEAN], row[X], row[Y], row[LOW], row[HIGH] = r, pose[0], pose[1], pose[2], pose[2]
        row[COUNT] += 1.0
        off = r - row[MEAN]
        row[MEAN] += off / row[COUNT]
        row[SQUARES] += off * (r - row[MEAN])
        row[WAY] = max(row[WAY], math.hypot(pose[0] - row[X], pose[1] - row[Y]))
        row[LOW], row[HIGH] = min(row[LOW], pose[2]), max(row[HIGH], pose[2])


@kernel
def ranges_of_parts(seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far the part is that is seen in each direction (m), (BINS,); NaN where there is none."""
    found = np.full(BINS, np.nan)
    for k in range(BINS):
        row = seen[k]
        if (
            row[COUNT] >= LEAST_COUNT
            and row[SQUARES] <= DEVIATION * DEVIATION * row[COUNT]
            and row[WAY] >= LEAST_WAY
            and row[HIGH] - row[LOW] >= LEAST_TURN
        ):
            found[k] = row[MEAN]
    return found


@kernel
def of_parts(parts: NDArray[np.float64], points: Points, reach: float) -> NDArray[np.bool_]:
    """Which points (N, 2), seen from the laser, are within ``reach`` (m) of a part in their direction or beside it."""
    theirs = np.zeros(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        k, r = direction(points[i, 0], points[i, 1]), math.hypot(points[i, 0], points[i, 1])
        for step in (-1, 0, 1):
            if abs(r - parts[(k + step) % BINS]) <= reach:
                theirs[i] = True
    return theirs
