"""Which keyframes are near: a grid of cells, so that the answer does not cost more the larger the map is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Pose, Poses
from hsslam.slam.scan_table import Rows

CELL = 0.5
"""Side of a cell (m)."""

HEADINGS = 8
ENOUGH = 10
"""Keyframes of a cell that look about the same way, one of so many; those that come later are not remembered.

A robot that drives the same rounds for weeks sees no more of a place from its thousandth keyframe there. The
oldest are kept: the map has settled around them.
"""

_BUCKETS = 1 << 14
_ROOM = 1024


class NearIndex:
    """Keyframes by where they are; of a place that was visited often, the first so many."""

    def __init__(self) -> None:
        self._heads = np.full(_BUCKETS, -1, dtype=np.int64)
        self._next, self._numbers, self._poses = Rows(dtype=np.int64), Rows(dtype=np.int64), Rows(3)
        self._seen = 0

    def __len__(self) -> int:
        return len(self._numbers)

    def add(self, pose: Pose) -> None:
        """Add the next keyframe, unless there are enough like it."""
        poses = self._poses.values
        if alike(self._heads, self._next.values, poses, pose) < ENOUGH:
            self._numbers.append(self._seen)
            self._poses.append(pose)
            self._next.append(-1)
            insert(self._heads, self._next.values, self._poses.values, len(poses))
        self._seen += 1

    def rebuild(self, poses: Poses) -> None:
        """Take note of where all keyframes (K, 3) are now."""
        self._poses.values[:] = poses[self._numbers.values]
        self._heads.fill(-1)
        insert(self._heads, self._next.values, self._poses.values, 0)

    def of(
        self, pose: Pose, stop: int, radius: float, most: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Keyframes with numbers below ``stop`` within ``radius`` (m) of a pose, the ``most`` nearest, nearest first.

        Returns
        -------
        (int64 (N,), float64 (N,))
            Their numbers and distances (m); of two at the same distance the earlier comes first.
        """
        poses, below = self._poses.values, int(np.searchsorted(self._numbers.values, stop))
        found = around(self._heads, self._next.values, poses, pose, below, radius, most)
        distances = np.hypot(poses[found, 0] - pose[0], poses[found, 1] - pose[1])
        order = np.lexsort((found, distances))[:most]
        order = order[distances[order] <= radius]
        return self._numbers.values[found[order]], distances[order]


@kernel
def _bucket(column: int, row: int, buckets: int) -> int:
    return (column * 73_856_093 ^ row * 19_349_663) & (buckets - 1)


@kernel
def _heading(theta: float) -> int:
    return math.floor((theta + math.pi) / (2.0 * math.pi) * HEADINGS)


@kernel
def _in_cell(pose: Pose, column: int, row: int) -> bool:
    return bool(math.floor(pose[0] / CELL) == column and math.floor(pose[1] / CELL) == row)


@kernel
def insert(heads: NDArray[np.int64], following: NDArray[np.int64], poses: Poses, first: int) -> None:
    """Put keyframes from ``first`` on at the heads of the lists of their cells."""
    for k in range(first, len(poses)):
        bucket = _bucket(math.floor(poses[k, 0] / CELL), math.floor(poses[k, 1] / CELL), len(heads))
        following[k] = heads[bucket]
        heads[bucket] = k


@kernel
def alike(heads: NDArray[np.int64], following: NDArray[np.int64], poses: Poses, pose: Pose) -> int:
    """How many keyframes are in the cell of a pose and look about the same way."""
    column, row = math.floor(pose[0] / CELL), math.floor(pose[1] / CELL)
    count = 0
    k = heads[_bucket(column, row, len(heads))]
    while k >= 0:
        if _in_cell(poses[k], column, row) and _heading(poses[k, 2]) == _heading(pose[2]):
            count += 1
        k = following[k]
    return count


@kernel
def around(
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
    poses: Poses,
    pose: Pose,
    stop: int,
    radius: float,
    most: int,
) -> NDArray[np.int64]:
    """Rows below ``stop`` of the keyframes in rings of cells, until ``most`` are nearer than what was not seen."""
    found = np.empty(4 * most, dtype=np.int64)
    count = 0
    column0, row0 = math.floor(pose[0] / CELL), math.floor(pose[1] / CELL)
    for ring in range(math.ceil(radius / CELL) + 1):
        for column in range(column0 - ring, column0 + ring + 1):
            step = 1 if abs(column - column0) == ring else 2 * ring
            for row in range(row0 - ring, row0 + ring + 1, step):
                k = heads[_bucket(column, row, len(heads))]
                while k >= 0:
                    if k < stop and _in_cell(poses[k], column, row):
                        if count == len(found):
                            found = np.concatenate((found, np.empty_like(found)))
                        found[count] = k
                        count += 1
                    k = following[k]
        nearer = 0
        for i in range(count):
            k = found[i]
            if math.hypot(poses[k, 0] - pose[0], poses[k, 1] - pose[1]) < ring * CELL:
                nearer += 1
        if nearer >= most:
            break
    return found[:count]
