"""Kernels that trace the beams of scans through a grid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Poses


@kernel
def _reach(
    reading: float, range_min: float, range_max: float, max_range: float, no_return_range: float
) -> tuple[float, bool]:
    """How far a reading tells about free space, and whether something stands there."""
    if math.isfinite(reading) and reading > 0.0 and range_min <= reading < range_max:
        return min(reading, max_range), reading <= max_range
    # Only a reading at the far end says that the way was free; zero and NaN say nothing.
    if reading >= range_max:
        return min(no_return_range, max_range), False
    return 0.0, False


@kernel
def widen(
    bounds: NDArray[np.float64],
    ranges: NDArray[np.float64],
    poses: Poses,
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    range_min: float,
    range_max: float,
    max_range: float,
    no_return_range: float,
) -> None:
    """Stretch ``bounds`` (x_min, y_min, x_max, y_max) over the laser poses and all that their beams reach."""
    for i in range(ranges.shape[0]):
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        bounds[0], bounds[1] = min(bounds[0], poses[i, 0]), min(bounds[1], poses[i, 1])
        bounds[2], bounds[3] = max(bounds[2], poses[i, 0]), max(bounds[3], poses[i, 1])
        for k in range(ranges.shape[1]):
            reach, _ = _reach(ranges[i, k], range_min, range_max, max_range, no_return_range)
            x = poses[i, 0] + reach * (c * cosine[k] - s * sine[k])
            y = poses[i, 1] + reach * (s * cosine[k] + c * sine[k])
            bounds[0], bounds[1] = min(bounds[0], x), min(bounds[1], y)
            bounds[2], bounds[3] = max(bounds[2], x), max(bounds[3], y)


@kernel
def mark(
    log_odds: NDArray[np.float32],
    last_hit: NDArray[np.int32],
    origin: NDArray[np.float64],
    resolution: float,
    first: int,
    ranges: NDArray[np.float64],
    poses: Poses,
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    range_min: float,
    range_max: float,
    max_range: float,
    no_return_range: float,
    hit: float,
    miss: float,
) -> None:
    """Add what scans tell to ``log_odds``.

    ``last_hit`` holds, for each cell, the number of the last scan with a return in it; ``first`` is the number
    of the first scan of this block.
    """
    beams = ranges.shape[1]
    columns, rows = np.empty(beams, np.int64), np.empty(beams, np.int64)
    for i in range(ranges.shape[0]):
        number = first + i
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        column0 = math.floor((poses[i, 0] - origin[0]) / resolution)
        row0 = math.floor((poses[i, 1] - origin[1]) / resolution)
        for k in range(beams):
            reach, occupied = _reach(ranges[i, k], range_min, range_max, max_range, no_return_range)
            x = poses[i, 0] + reach * (c * cosine[k] - s * sine[k])
            y = poses[i, 1] + reach * (s * cosine[k] + c * sine[k])
            columns[k] = math.floor((x - origin[0]) / resolution)
            rows[k] = math.floor((y - origin[1]) / resolution)
            if occupied:
                log_odds[rows[k], columns[k]] += hit
                last_hit[rows[k], columns[k]] = number
        for k in range(beams):
            # Bresenham's line from the laser's cell up to, and without, the last one.
            column, row = column0, row0
            across, up = abs(columns[k] - column0), abs(rows[k] - row0)
            column_step = 1 if columns[k] > column0 else -1
            row_step = 1 if rows[k] > row0 else -1
            error = across - up
            while column != columns[k] or row != rows[k]:
                if last_hit[row, column] != number:
                    log_odds[row, column] += miss
                twice = 2 * error
                if twice > -up:
                    error -= up
                    column += column_step
                if twice < across:
                    error += across
                    row += row_step
