"""Cells of the plane that count what beams tell of them, over a window that grows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.mapping.traversal import count
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Poses, compose_many

SLACK = 128
"""Cells beyond what is asked for on every side, when a window that is in use must grow: it will go on growing."""

_BLOCK = 512

Block: TypeAlias = tuple[
    NDArray[np.float64], Poses, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float, float
]
"""Scans alike in geometry: ranges (N, B), laser poses (N, 3) and their steps from beam to beam (N, 3), cosines and
sines (B,) of the beams, range limits."""


class CellCounts:
    """Returns and passing beams, counted cell by cell.

    Counts are whole numbers, and cells are numbered from the world's origin on. So what a scan added can be taken
    away again to the bit, in any order, whatever the window was when it was added.

    Parameters
    ----------
    resolution : float
        Side of a cell (m).
    max_range, no_return_range : float
        As for `hsslam.mapping.occupancy.GridBuilder`.
    """

    def __init__(self, resolution: float, max_range: float, no_return_range: float) -> None:
        self._resolution = resolution
        self._ranges = (max_range, no_return_range)
        self._low = np.zeros(2, dtype=np.int64)
        self._hits = np.zeros((0, 0), dtype=np.int32)
        self._misses = np.zeros((0, 0), dtype=np.int32)
        self._last_hit = np.zeros((0, 0), dtype=np.int32)
        self._scans = 0

    def reserve(self, low: NDArray[np.int64], high: NDArray[np.int64]) -> None:
        """Make room for the cells (column, row) from ``low`` on, up to and without ``high``."""
        size = np.array(self._hits.shape[::-1])
        if (low >= self._low).all() and (high <= self._low + size).all():
            return
        if size.any():
            low = np.where(low < self._low, low - SLACK, self._low)
            high = np.where(high > self._low + size, high + SLACK, self._low + size)
        columns, rows = high - low
        grown = [np.zeros((rows, columns), dtype=np.int32) for _ in range(2)]
        column, row = self._low - low if size.any() else (0, 0)
        for old, new in zip((self._hits, self._misses), grown, strict=True):
            new[row : row + old.shape[0], column : column + old.shape[1]] = old
        self._hits, self._misses = grown
        self._last_hit = np.full((rows, columns), -1, dtype=np.int32)
        self._low = low

    def trace(self, block: Block, sign: int) -> None:
        """Add what scans tell, or (``sign`` -1) take it away; all that they touch must be reserved."""
        first, scans = self._scans, len(block[0])
        if first + scans > np.iinfo(np.int32).max:
            self._last_hit.fill(-1)
            first = 0
        self._scans = first + scans
        ranges, poses, steps, cosine, sine, range_min, range_max = block
        count(
            self._hits,
            self._misses,
            self._last_hit,
            int(self._low[0]),
            int(self._low[1]),
            self._resolution,
            first,
            sign,
            ranges,
            poses,
            steps,
            cosine,
            sine,
            range_min,
            range_max,
            *self._ranges,
        )

    def window(
        self, low: NDArray[np.int64], high: NDArray[np.int64]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Returns and passing beams of the cells from ``low`` to ``high``, both (rows, columns); views."""
        (column, row), (column_stop, row_stop) = low - self._low, high - self._low
        part = np.s_[row:row_stop, column:column_stop]
        return self._hits[part], self._misses[part]


def blocks(scans: Sequence[LaserScan], poses: Poses) -> Iterator[Block]:
    """Group scans alike in geometry."""
    first = 0
    for (geometry, beams), run in groupby(scans, key=_kind):
        alike = list(run)
        angles = geometry.angles(beams)
        cosine, sine = np.cos(angles), np.sin(angles)
        for start in range(0, len(alike), _BLOCK):
            part = alike[start : start + _BLOCK]
            robot = poses[first : first + len(part)]
            mounted = np.array([scan.laser_pose for scan in part], dtype=np.float64)
            laser = compose_many(robot, mounted)
            velocities = np.array([scan.velocity for scan in part], dtype=np.float64)
            steps = geometry.time_increment * _seen_from_laser(velocities, mounted)
            ranges = np.array([scan.ranges for scan in part], dtype=np.float64).reshape(len(part), beams)
            limits = float(geometry.range_min), float(geometry.range_max)
            yield ranges, laser, steps, cosine, sine, *limits
            first += len(part)


def _seen_from_laser(velocities: NDArray[np.float64], mounted: Poses) -> NDArray[np.float64]:
    """Velocities (N, 3) of lasers in their own frames, from those of the robots that they are mounted on."""
    c, s = np.cos(mounted[:, 2]), np.sin(mounted[:, 2])
    x = velocities[:, 0] - velocities[:, 2] * mounted[:, 1]
    y = velocities[:, 1] + velocities[:, 2] * mounted[:, 0]
    return np.column_stack((c * x + s * y, c * y - s * x, velocities[:, 2]))


def _kind(scan: LaserScan) -> tuple[ScanGeometry, int]:
    return scan.geometry, len(scan.ranges)
