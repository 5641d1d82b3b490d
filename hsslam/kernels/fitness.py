"""Fitness of a pose: what a scan's points are worth on a raster (paper, equations 9 and 10)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

CHUNK = 64
"""Points counted between two looks at whether the candidate can still win."""


@kernel
def count_hits(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    x: float,
    y: float,
    theta: float,
    at_least: int,
) -> int:
    """Sum of the points' worth on a raster (their hits, if it is a raster of squares) at a pose.

    Gives up with -1 as soon as the sum can no longer reach ``at_least``.

    Parameters
    ----------
    cells : uint8 (H, W)
        A `Raster`'s cells; its border must be zero.
    frame : float64 (4,)
        The raster's frame.
    xs, ys : float32 (N,)
        The scan's points in cells (metres times ``frame[2]``).
    x, y, theta : float
        Candidate pose (m, m, rad).
    at_least : int
        Sum below which the answer is of no interest.
    """
    rows, columns = cells.shape
    flat = cells.reshape(rows * columns)
    right, top = np.float32(columns - 1), np.float32(rows - 1)
    zero = np.float32(0.0)
    c, s = np.float32(math.cos(theta)), np.float32(math.sin(theta))
    tx = np.float32((x - frame[0]) * frame[2])
    ty = np.float32((y - frame[1]) * frame[2])
    n = xs.shape[0]
    # Unsigned, so that the look-up needs no branch for indices counted from the end.
    index = np.empty(CHUNK, dtype=np.uint32)
    stride = np.int32(columns)
    most = int(frame[3])
    hits = 0
    start = 0
    while start < n:
        stop = min(start + CHUNK, n)
        px, py = xs[start:stop], ys[start:stop]
        # Two plain loops: the first becomes vector instructions, which the look-up in the second cannot.
        for i in range(stop - start):
            u = min(max(c * px[i] - s * py[i] + tx, zero), right)
            v = min(max(s * px[i] + c * py[i] + ty, zero), top)
            index[i] = np.int32(v) * stride + np.int32(u)
        for i in range(stop - start):
            hits += flat[index[i]]
        start = stop
        if hits + most * (n - start) < at_least:
            return -1
    return hits
