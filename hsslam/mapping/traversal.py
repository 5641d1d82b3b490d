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
def _while_moving(
    poses: Poses, steps: NDArray[np.float64], i: int, beam: int
) -> tuple[float, float, float, float]:
    """Where laser ``i`` is when it takes a beam, x and y, and where it looks, cosine and sine."""
    x, y = poses[i, 0], poses[i, 1]
    c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
    turn = beam * steps[i, 2]
    # The exponential map of SE(2).
    along = math.sin(turn) / turn if abs(turn) > 1e-9 else 1.0
    across = (1.0 - math.cos(turn)) / turn if abs(turn) > 1e-9 else 0.5 * turn
    dx = beam * (along * steps[i, 0] - across * steps[i, 1])
    dy = beam * (across * steps[i, 0] + along * steps[i, 1])
    ct, st = math.cos(turn), math.sin(turn)
    return x + c * dx - s * dy, y + s * dx + c * dy, c * ct - s * st, s * ct + c * st


@kernel
def reach_of(
    ranges: NDArray[np.float64],
    poses: Poses,
    steps: NDArray[np.float64],
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    range_min: float,
    range_max: float,
    max_range: float,
    no_return_range: float,
) -> NDArray[np.float64]:
    """What each scan touches, (N, 5): x_min, y_min, x_max, y_max of laser and beams, and the longest beam (m).

    ``poses`` are the lasers' at their first beams; ``steps`` (N, 3) m, m, rad, how they move from a beam to the
    next, in their own frames: twists of SE(2).
    """
    out = np.empty((ranges.shape[0], 5))
    for i in range(ranges.shape[0]):
        x0, y0 = poses[i, 0], poses[i, 1]
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        moves = steps[i, 0] != 0.0 or steps[i, 1] != 0.0 or steps[i, 2] != 0.0
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = x0, y0, x0, y0, 0.0
        for k in range(ranges.shape[1]):
            if moves:
                x0, y0, c, s = _while_moving(poses, steps, i, k)
            reach, _ = _reach(ranges[i, k], range_min, range_max, max_range, no_return_range)
            x = x0 + reach * (c * cosine[k] - s * sine[k])
            y = y0 + reach * (s * cosine[k] + c * sine[k])
            out[i, 0], out[i, 1] = min(out[i, 0], x, x0), min(out[i, 1], y, y0)
            out[i, 2], out[i, 3] = max(out[i, 2], x, x0), max(out[i, 3], y, y0)
            out[i, 4] = max(out[i, 4], math.hypot(x - poses[i, 0], y - poses[i, 1]))
    return out


@kernel
def count(
    hits: NDArray[np.int32],
    misses: NDArray[np.int32],
    last_hit: NDArray[np.int32],
    low_column: int,
    low_row: int,
    resolution: float,
    number: int,
    sign: int,
    ranges: NDArray[np.float64],
    poses: Poses,
    steps: NDArray[np.float64],
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
    range_min: float,
    range_max: float,
    max_range: float,
    no_return_range: float,
) -> None:
    """Add ``sign`` to the ``hits`` of each cell that holds a return, and to the ``misses`` of those on the way to it.

    Cells are numbered from that whose corner is the origin of the world; the arrays begin at ``low_column`` and
    ``low_row``. ``last_hit`` holds, for each cell, the number of the last scan with a return in it; ``number``
    is that of the first scan of this block. ``poses`` and ``steps`` are those of `reach_of`.
    """
    beams = ranges.shape[1]
    columns, rows = np.empty(beams, np.int64), np.empty(beams, np.int64)
    for i in range(ranges.shape[0]):
        x0, y0 = poses[i, 0], poses[i, 1]
        c, s = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        moves = steps[i, 0] != 0.0 or steps[i, 1] != 0.0 or steps[i, 2] != 0.0
        for k in range(beams):
            if moves:
                x0, y0, c, s = _while_moving(poses, steps, i, k)
            reach, occupied = _reach(ranges[i, k], range_min, range_max, max_range, no_return_range)
            x = x0 + reach * (c * cosine[k] - s * sine[k])
            y = y0 + reach * (s * cosine[k] + c * sine[k])
            columns[k] = math.floor(x / resolution) - low_column
            rows[k] = math.floor(y / resolution) - low_row
            if occupied:
                hits[rows[k], columns[k]] += sign
                last_hit[rows[k], columns[k]] = number + i
        for k in range(beams):
            # Bresenham's line from the laser's cell up to, and without, the last one.
            if moves:
                x0, y0, c, s = _while_moving(poses, steps, i, k)
            column = math.floor(x0 / resolution) - low_column
            row = math.floor(y0 / resolution) - low_row
            across, up = abs(columns[k] - column), abs(rows[k] - row)
            column_step = 1 if columns[k] > column else -1
            row_step = 1 if rows[k] > row else -1
            error = across - up
            while column != columns[k] or row != rows[k]:
                if last_hit[row, column] != number + i:
                    misses[row, column] += sign
                twice = 2 * error
                if twice > -up:
                    error -= up
                    column += column_step
                if twice < across:
                    error += across
                    row += row_step
