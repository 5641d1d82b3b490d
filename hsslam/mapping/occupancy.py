"""Occupancy grid from scans and poses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.mapping.traversal import mark, widen
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Poses, compose_many

HIT = math.log(0.7 / 0.3)
"""What a return adds to the log odds of its cell."""

MISS = math.log(0.4 / 0.6)
"""What a beam adds to the log odds of each cell it passes."""

MAX_CELLS = 50_000_000
"""A larger grid is refused; poses that ran away ask for one."""

_BLOCK = 512


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


def build_grid(
    scans: Sequence[LaserScan],
    poses: Poses,
    resolution: float = 0.05,
    max_range: float = 30.0,
    *,
    no_return_range: float = 0.0,
    margin: float = 0.5,
) -> OccupancyGrid:
    """Build a grid of everything the scans saw.

    Inverse sensor model (Moravec and Elfes 1985, in log odds): a return adds `HIT` to its cell and `MISS` to
    those between the laser and it; within one scan a cell that holds a return is not marked free by its
    neighbours' beams, so that walls seen at a flat angle stay.

    Parameters
    ----------
    scans : sequence of LaserScan
        Any mix of beam counts and geometries.
    poses : Poses
        (N, 3) pose of the robot at each scan; the laser's is composed with ``scan.laser_pose``.
    resolution : float
        Side of a cell (m).
    max_range : float
        Beams are cut here (m): beyond it a return marks free space up to the cut, and nothing else.
    no_return_range : float
        Beams without a return mark free space this far (m). 0 ignores them: glass and black furniture give
        no return either.
    margin : float
        Unknown space left around the data (m).

    Raises
    ------
    ValueError
        Not one finite pose per scan, or a resolution or range that is not positive.
    DataError
        The grid would have more than `MAX_CELLS` cells.
    """
    poses = np.ascontiguousarray(poses, dtype=np.float64).reshape(-1, 3)
    if len(poses) != len(scans):
        raise ValueError(f"one pose per scan: {len(scans)} scans, {len(poses)} poses")
    if not np.isfinite(poses).all():
        raise ValueError("the poses of a map must be finite")
    if not (resolution > 0.0 and max_range > 0.0):
        raise ValueError("resolution and max_range must be positive")
    bounds = np.array([np.inf, np.inf, -np.inf, -np.inf])
    for block in _blocks(scans, poses):
        widen(bounds, *block, max_range, no_return_range)
    if not np.isfinite(bounds).all():
        bounds[:] = 0.0
    # The origin is a whole number of cells, so that grids of one world line up.
    low = np.floor((bounds[:2] - margin) / resolution)
    columns, rows = (np.ceil((bounds[2:] + margin) / resolution) - low).astype(np.int64)
    if rows * columns > MAX_CELLS:
        raise DataError(
            f"the map would have {columns} x {rows} cells of {resolution} m, more than {MAX_CELLS:,}: either "
            "the trajectory ran away, or map.resolution is too fine"
        )
    origin = low * resolution
    log_odds = np.zeros((rows, columns), dtype=np.float32)
    last_hit = np.full((rows, columns), -1, dtype=np.int32)
    first = 0
    for block in _blocks(scans, poses):
        mark(log_odds, last_hit, origin, resolution, first, *block, max_range, no_return_range, HIT, MISS)
        first += len(block[0])
    return OccupancyGrid(origin, resolution, log_odds)


_Block = tuple[NDArray[np.float64], Poses, NDArray[np.float64], NDArray[np.float64], float, float]


def _blocks(scans: Sequence[LaserScan], poses: Poses) -> Iterator[_Block]:
    """Group scans alike in geometry into ranges (n, B), laser poses, cosines, sines, range limits."""
    first = 0
    for (geometry, beams), run in groupby(scans, key=_kind):
        alike = list(run)
        angles = geometry.angles(beams)
        cosine, sine = np.cos(angles), np.sin(angles)
        for start in range(0, len(alike), _BLOCK):
            part = alike[start : start + _BLOCK]
            robot = poses[first : first + len(part)]
            laser = compose_many(robot, np.array([scan.laser_pose for scan in part], dtype=np.float64))
            ranges = np.array([scan.ranges for scan in part], dtype=np.float64).reshape(len(part), beams)
            yield ranges, laser, cosine, sine, float(geometry.range_min), float(geometry.range_max)
            first += len(part)


def _kind(scan: LaserScan) -> tuple[ScanGeometry, int]:
    return scan.geometry, len(scan.ranges)
