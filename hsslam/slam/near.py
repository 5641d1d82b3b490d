"""Which keyframes are near: a grid of cells, so that the answer does not cost more the larger the map is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Pose, Poses

CELL = 0.5
"""Side of a cell (m)."""

_BUCKETS = 1 << 14
_ROOM = 1024


class NearIndex:
    """Keyframes by where they are."""

    def __init__(self) -> None:
        self._heads = np.full(_BUCKETS, -1, dtype=np.int64)
        self._next = np.empty(_ROOM, dtype=np.int64)
        self._poses = np.empty((_ROOM, 3))
        self._count = 0

    def add(self, pose: Pose) -> None:
        """Add the next keyframe."""
        if self._count == len(self._poses):
            self._next = np.concatenate((self._next, np.empty_like(self._next)))
            self._poses = np.concatenate((self._poses, np.empty_like(self._poses)))
        self._poses[self._count] = pose
        insert(self._heads, self._next, self._poses, self._count, self._count + 1)
        self._count += 1

    def rebuild(self, poses: Poses) -> None:
        """Take note of where all keyframes (K, 3) are now."""
        self._poses[: self._count] = poses
        self._heads.fill(-1)
        insert(self._heads, self._next, self._poses, 0, self._count)

    def of(
        self, keyframe: int, stop: int, radius: float, most: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Keyframes 0 to ``stop - 1`` within ``radius`` (m) of one, the ``most`` nearest, nearest first.

        Returns
        -------
        (int64 (N,), float64 (N,))
            Their numbers and distances (m); of two at the same distance the earlier comes first.
        """
        x, y, _ = self._poses[keyframe]
        found = around(self._heads, self._next, self._poses, x, y, stop, radius, most)
        offsets = self._poses[found, :2] - self._poses[keyframe, :2]
        distances = np.hypot(offsets[:, 0], offsets[:, 1])
        order = np.lexsort((found, distances))[:most]
        order = order[distances[order] <= radius]
        return found[order], distances[order]


@kernel
def _bucket(column: int, row: int, buckets: int) -> int:
    return (column * 73_856_093 ^ row * 19_349_663) & (buckets - 1)


@kernel
def insert(
    heads: NDArray[np.int64], following: NDArray[np.int64], poses: Poses, first: int, stop: int
) -> None:
    """Put keyframes ``first`` to ``stop - 1`` at the heads of the lists of their cells."""
    for k in range(first, stop):
        bucket = _bucket(math.floor(poses[k, 0] / CELL), math.floor(poses[k, 1] / CELL), len(heads))
        following[k] = heads[bucket]
        heads[bucket] = k


@kernel
def around(
    heads: NDArray[np.int64],
    following: NDArray[np.int64],
    poses: Poses,
    x: float,
    y: float,
    stop: int,
    radius: float,
    most: int,
) -> NDArray[np.int64]:
    """Numbers below ``stop`` of the keyframes in rings of cells, until ``most`` are nearer than what was not seen."""
    found = np.empty(4 * most, dtype=np.int64)
    count = 0
    column0, row0 = math.floor(x / CELL), math.floor(y / CELL)
    for ring in range(math.ceil(radius / CELL) + 1):
        for column in range(column0 - ring, column0 + ring + 1):
            edge = abs(column - column0) == ring
            for row in range(row0 - ring, row0 + ring + 1, 1 if edge else max(2 * ring, 1)):
                k = heads[_bucket(column, row, len(heads))]
                while k >= 0:
                    here = (
                        k < stop
                        and math.floor(poses[k, 0] / CELL) == column
                        and math.floor(poses[k, 1] / CELL) == row
                    )
                    if here:
                        if count == len(found):
                            found = np.concatenate((found, np.empty_like(found)))
                        found[count] = k
                        count += 1
                    k = following[k]
        nearer = 0
        for i in range(count):
            if math.hypot(poses[found[i], 0] - x, poses[found[i], 1] - y) < ring * CELL:
                nearer += 1
        if nearer >= most:
            break
    return found[:count]
