"""Occupancy grid from scans and poses, built at once or kept up to date."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.mapping.cells import CellCounts, blocks
from hsslam.mapping.traversal import reach_of
from hsslam.scan import LaserScan
from hsslam.se2 import Poses

HIT = math.log(0.7 / 0.3)
"""What a return adds to the log odds of its cell."""

MISS = math.log(0.4 / 0.6)
"""What a beam adds to the log odds of each cell it passes."""

MAX_CELLS = 50_000_000
"""A larger grid is refused; poses that ran away ask for one."""

NOWHERE = np.array([np.inf, np.inf, -np.inf, -np.inf])
"""The rectangle (x_min, y_min, x_max, y_max) around nothing."""


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """Square cells and how likely each is occupied.

    Parameters
    ----------
    origin : float64 (2,)
        Corner of the grid with the least x and y (m).
    resolution : float
        Side of a cell (m).
    log_odds : float32 (H, W)
        log(p / (1 - p)) of the occupancy p. Row 0 has the least y, column 0 the least x.
    """

    origin: NDArray[np.float64]
    resolution: float
    log_odds: NDArray[np.float32]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows (along y) and columns (along x)."""
        rows, columns = self.log_odds.shape
        return rows, columns

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x_min, x_max, y_min, y_max (m), as matplotlib's ``imshow`` takes it."""
        rows, columns = self.shape
        x, y = float(self.origin[0]), float(self.origin[1])
        return x, x + columns * self.resolution, y, y + rows * self.resolution

    @property
    def visited(self) -> NDArray[np.bool_]:
        """Cells that some beam told something about, (H, W)."""
        return np.not_equal(self.log_odds, 0.0)

    @property
    def probability(self) -> NDArray[np.float32]:
        """Probability of occupancy, (H, W); 0.5 where nothing is known."""
        clipped = np.clip(self.log_odds, -30.0, 30.0)
        return (1.0 / (1.0 + np.exp(-clipped))).astype(np.float32)


class GridBuilder:
    """An occupancy grid that follows its poses: a scan that moved is taken out and put in again, the others stay.

    Inverse sensor model (Moravec and Elfes 1985, in log odds): a return adds `HIT` to its cell and `MISS` to
    those between the laser and it; within one scan a cell that holds a return is not marked free by its
    neighbours' beams, so that walls seen at a flat angle stay. Returns and passing beams are counted, so the grid
    is the same to the bit as one that is built anew from `poses`.

    Parameters
    ----------
    resolution : float
        Side of a cell (m).
    max_range : float
        Beams are cut here (m): beyond it a return marks free space up to the cut, and nothing else.
    no_return_range : float
        Beams without a return mark free space this far (m). 0 ignores them: glass and black furniture give
        no return either.
    margin : float
        Unknown space left around the data (m).
    tolerance : float
        Part of a cell: a scan no beam of which ends farther than that from where it ended stays as it is.

    Raises
    ------
    ValueError
        A resolution or range is not positive.
    """

    def __init__(
        self,
        resolution: float = 0.05,
        max_range: float = 30.0,
        *,
        no_return_range: float = 0.0,
        margin: float = 0.5,
        tolerance: float = 0.25,
    ) -> None:
        if not (resolution > 0.0 and max_range > 0.0):
            raise ValueError("resolution and max_range must be positive")
        self._resolution, self._margin, self._tolerance = resolution, margin, tolerance
        self._ranges = (max_range, no_return_range)
        self._cells = CellCounts(resolution, max_range, no_return_range)
        self._scans: list[LaserScan] = []
        self._poses = np.zeros((0, 3))
        self._reach = np.zeros((0, 5))
        self._extent = NOWHERE

    def __len__(self) -> int:
        return len(self._scans)

    @property
    def poses(self) -> Poses:
        """(N, 3) where each scan is in the grid; within the tolerance of where it was last said to be."""
        return self._poses[: len(self._scans)].copy()

    def add(self, scans: Sequence[LaserScan], poses: Poses) -> None:
        """Add scans.

        Parameters
        ----------
        scans : sequence of LaserScan
            Any mix of beam counts and geometries.
        poses : Poses
            (N, 3) pose of the robot at each scan; the laser's is composed with ``scan.laser_pose``.

        Raises
        ------
        ValueError
            Not one finite pose per scan.
        DataError
            The grid would have more than `MAX_CELLS` cells; nothing was added.
        """
        poses = _checked(scans, poses)
        count = len(self._scans)
        reach = self._reaches(scans, poses)
        self._reserve(_around(reach, self._extent))
        while len(self._poses) < count + len(scans):
            room = max(len(self._poses), len(scans))
            self._poses = np.concatenate((self._poses, np.zeros((room, 3))))
            self._reach = np.concatenate((self._reach, np.zeros((room, 5))))
        self._scans += scans
        self._put(np.arange(count, len(self._scans)), poses, reach)

    def update(self, poses: Poses) -> int:
        """Move the scans that were added to where they are known to be by now.

        Parameters
        ----------
        poses : Poses
            (N, 3) of the robot at all scans.

        Returns
        -------
        int
            How many had moved by more than the tolerance, and were traced anew.

        Raises
        ------
        ValueError
            Not one finite pose per scan.
        DataError
            The grid would have more than `MAX_CELLS` cells; nothing was moved.
        """
        poses = _checked(self._scans, poses)
        before, reach = self._poses[: len(poses)], self._reach[: len(poses)]
        turned = np.abs((poses[:, 2] - before[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        shifts = np.hypot(*(poses - before)[:, :2].T) + reach[:, 4] * turned
        moved = np.flatnonzero(shifts > self._tolerance * self._resolution)
        if len(moved) == 0:
            return 0
        scans = [self._scans[k] for k in moved]
        found = self._reaches(scans, poses[moved])
        wanted = reach.copy()
        wanted[moved] = found
        self._reserve(_around(wanted, NOWHERE))
        for block in blocks(scans, before[moved]):
            self._cells.trace(block, -1)
        self._put(moved, poses[moved], found)
        return len(moved)

    def grid(self) -> OccupancyGrid:
        """The grid as it is now."""
        low, high = self._window(self._extent)
        self._cells.reserve(low, high)
        hits, misses = self._cells.window(low, high)
        log_odds = (hits * HIT + misses * MISS).astype(np.float32)
        return OccupancyGrid(low.astype(np.float64) * self._resolution, self._resolution, log_odds)

    def _put(self, numbers: NDArray[np.int64], poses: Poses, reach: NDArray[np.float64]) -> None:
        self._poses[numbers], self._reach[numbers] = poses, reach
        for block in blocks([self._scans[k] for k in numbers], poses):
            self._cells.trace(block, 1)

    def _reaches(self, scans: Sequence[LaserScan], poses: Poses) -> NDArray[np.float64]:
        """What each scan touches, (N, 5): x_min, y_min, x_max, y_max, and how far from the robot (m)."""
        parts = [reach_of(*block, *self._ranges) for block in blocks(scans, poses)]
        out = np.concatenate((np.zeros((0, 5)), *parts))
        out[:, 4] += [math.hypot(*scan.laser_pose[:2]) for scan in scans]
        return out

    def _reserve(self, extent: NDArray[np.float64]) -> None:
        low, high = self._window(extent)
        columns, rows = high - low
        if rows * columns > MAX_CELLS:
            raise DataError(
                f"the map would have {columns} x {rows} cells of {self._resolution} m, more than {MAX_CELLS:,}: "
                "either the trajectory ran away, or map.resolution is too fine"
            )
        self._cells.reserve(low, high)
        self._extent = extent

    def _window(self, extent: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """First cell (column, row) of the grid, and the one after the last."""
        if not np.isfinite(extent).all():
            extent = np.zeros(4)
        low = np.floor((extent[:2] - self._margin) / self._resolution)
        high = np.ceil((extent[2:] + self._margin) / self._resolution)
        return low.astype(np.int64), high.astype(np.int64)


def _around(reach: NDArray[np.float64], extent: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rectangle (x_min, y_min, x_max, y_max) around another and all that scans touch."""
    low = np.minimum(reach[:, :2].min(axis=0, initial=np.inf), extent[:2])
    high = np.maximum(reach[:, 2:4].max(axis=0, initial=-np.inf), extent[2:])
    return np.concatenate((low, high))


def build_grid(
    scans: Sequence[LaserScan],
    poses: Poses,
    resolution: float = 0.05,
    max_range: float = 30.0,
    *,
    no_return_range: float = 0.0,
    margin: float = 0.5,
) -> OccupancyGrid:
    """Build a grid of everything the scans saw; parameters and errors are those of `GridBuilder`.

    Parameters
    ----------
    scans, poses : sequence of LaserScan, Poses
        As for `GridBuilder.add`.
    resolution, max_range, no_return_range, margin : float
        As for `GridBuilder`.

    Raises
    ------
    ValueError
        Not one finite pose per scan, or a resolution or range that is not positive.
    DataError
        The grid would have more than `MAX_CELLS` cells.
    """
    builder = GridBuilder(resolution, max_range, no_return_range=no_return_range, margin=margin)
    builder.add(scans, poses)
    return builder.grid()


def _checked(scans: Sequence[LaserScan], poses: Poses) -> Poses:
    poses = np.ascontiguousarray(poses, dtype=np.float64).reshape(-1, 3)
    if len(poses) != len(scans):
        raise ValueError(f"one pose per scan: {len(scans)} scans, {len(poses)} poses")
    if not np.isfinite(poses).all():
        raise ValueError("the poses of a map must be finite")
    return poses
