"""Fitness of a pose: what a scan's points are worth on a raster (paper, equations 9 and 10)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.raster import ANY, EIGHTH, counts_sides, facing_of
from hsslam.se2 import Points

CHUNK = 32
"""Points counted between two looks at whether the candidate can still win."""

PARTS = 64
"""Steps of a cell's width in which places are interpolated."""

NOWHERE = 1e30
"""Coordinate of a point that is worth nothing wherever the scan is."""


_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@kernel
def scale(
    points: Points, lines: NDArray[np.float64], frame: NDArray[np.float64], most: int
) -> NDArray[np.float32]:
    """Points in cells, and the way they face, as `count_sided` wants them, float32 (3, M).

    ``most`` of them, or all if there are fewer. The way they face is told by (N, 3) lines of the scan, where sides
    count on the raster that ``frame`` is of.

    They come in an order in which any first part of them is spread over the whole scan, so that it stands for it.
    """
    n, used, per_metre = points.shape[0], min(most, points.shape[0]), frame[2]
    sided = counts_sides(frame) and lines.shape[0] == n
    stride = max(round(_GOLDEN * n), 1)
    while greatest_common_divisor(n, stride) > 1:
        stride += 1
    out = np.empty((3, -(-used // CHUNK) * CHUNK), dtype=np.float32)
    k = 0
    for i in range(used):
        out[0, i], out[1, i] = points[k, 0] * per_metre, points[k, 1] * per_metre
        out[2, i] = facing_of(lines[k, 0], lines[k, 1]) if sided else -1.0
        k += stride
        if k >= n:
            k -= n
    out[:2, used:] = NOWHERE
    out[2, used:] = -1.0
    return out


@kernel
def greatest_common_divisor(a: int, b: int) -> int:
    """By Euclid."""
    while b > 0:
        a, b = b, a % b
    return a


@kernel
def scratch() -> NDArray[np.uint32]:
    """Memory for `evaluate`, which a search makes once, uint32 (2 * CHUNK,)."""
    return np.empty(2 * CHUNK, dtype=np.uint32)


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
    """Sum of the points' worth on a raster (their hits, if it is a raster of squares) at a pose; no sides count.

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
    flat = cells.reshape(cells.size)
    return count_points(flat, cells.shape, frame, xs, ys, xs.shape[0], x, y, theta, at_least, scratch())


@kernel
def count_points(
    flat: NDArray[np.uint8],
    shape: tuple[int, int],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    count: int,
    x: float,
    y: float,
    theta: float,
    at_least: int,
    index: NDArray[np.uint32],
) -> int:
    """As `count_hits`, for the inner loop of a search.

    Parameters
    ----------
    flat, shape : uint8 (H * W,), (int, int)
        The cells row by row, and (H, W).
    frame, x, y, theta, at_least
        As for `count_hits`.
    xs, ys : float32 (N,)
        The scan's points, then as many at `NOWHERE` as make the last chunk whole: loops of a known length become
        vector instructions from the first point to the last.
    count : int
        How many are the scan's.
    index : uint32 (2 * CHUNK,)
        From `scratch`. Unsigned, so that the look-up needs no branch for indices counted from the end.
    """
    right, top = np.float32(shape[1] - 1), np.float32(shape[0] - 1)
    zero = np.float32(0.0)
    c, s = np.float32(math.cos(theta)), np.float32(math.sin(theta))
    tx = np.float32((x - frame[0]) * frame[2])
    ty = np.float32((y - frame[1]) * frame[2])
    stride = np.int32(shape[1])
    most = int(frame[3])
    whole = xs.shape[0] - CHUNK
    hits = 0
    start = 0
    while start < count:
        # Two plain loops: the first becomes vector instructions, which the look-up in the second cannot.
        if start <= whole:
            for i in range(CHUNK):
                px, py = xs[start + i], ys[start + i]
                u = min(max(c * px - s * py + tx, zero), right)
                v = min(max(s * px + c * py + ty, zero), top)
                index[i] = np.int32(v) * stride + np.int32(u)
            for i in range(CHUNK):
                hits += flat[index[i]]
        else:
            for i in range(start, count):
                u = min(max(c * xs[i] - s * ys[i] + tx, zero), right)
                v = min(max(s * xs[i] + c * ys[i] + ty, zero), top)
                hits += flat[np.uint32(np.int32(v) * stride + np.int32(u))]
        start += CHUNK
        if hits + most * max(count - start, 0) < at_least:
            return -1
    return hits


@kernel
def count_sided(
    flat: NDArray[np.uint8],
    shape: tuple[int, int],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    facing: NDArray[np.float32],
    count: int,
    x: float,
    y: float,
    theta: float,
    at_least: int,
    index: NDArray[np.uint32],
) -> int:
    """As `count_points`, on a raster on which sides count: points hit what faces the same way.

    ``facing``, float32 (N,), is how they do, seen from the scan, see `hsslam.kernels.raster.facing_of`: those of -1,
    which have no line, hit whatever there is. `scale` makes it, with the points.
    """
    right, top = np.float32(shape[1] - 1), np.float32(shape[0] - 1)
    zero = np.float32(0.0)
    c, s = np.float32(math.cos(theta)), np.float32(math.sin(theta))
    tx = np.float32((x - frame[0]) * frame[2])
    ty = np.float32((y - frame[1]) * frame[2])
    stride = np.int32(shape[1])
    turned = np.float32((theta / EIGHTH) % 8.0 + 0.5)
    one, seven, every = np.uint32(1), np.int32(7), np.uint32(ANY)
    hits = 0
    start = 0
    while start < count:
        # Points beyond the last are nowhere, on the raster's border, where nothing is to be hit.
        for i in range(CHUNK):
            px, py, way = xs[start + i], ys[start + i], facing[start + i]
            u = min(max(c * px - s * py + tx, zero), right)
            v = min(max(s * px + c * py + ty, zero), top)
            index[i] = np.int32(v) * stride + np.int32(u)
            side = one << np.uint32(np.int32(way + turned) & seven)
            index[CHUNK + i] = side if way >= zero else every
        for i in range(CHUNK):
            hits += (flat[index[i]] & index[CHUNK + i]) != 0
        start += CHUNK
        if hits + max(count - start, 0) < at_least:
            return -1
    return hits


@kernel
def interpolate_points(
    flat: NDArray[np.uint8],
    shape: tuple[int, int],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    count: int,
    x: float,
    y: float,
    theta: float,
    at_least: int,
    index: NDArray[np.uint32],
) -> int:
    """As `count_points`, with the worth of a place interpolated between the four cells whose centres surround it.

    What a smooth field is worth then has no steps at the borders of cells, and a pose is told from one a
    fraction of a cell away.
    """
    right, top = np.float32(shape[1] - 2), np.float32(shape[0] - 2)
    zero, parts = np.float32(0.0), np.float32(PARTS)
    c, s = np.float32(math.cos(theta)), np.float32(math.sin(theta))
    # Half a cell less, so that a cell's centre has whole coordinates.
    tx = np.float32((x - frame[0]) * frame[2] - 0.5)
    ty = np.float32((y - frame[1]) * frame[2] - 0.5)
    stride, below = np.int32(shape[1]), np.uint32(shape[1])
    most = int(frame[3])
    across, up = np.empty(CHUNK, dtype=np.int32), np.empty(CHUNK, dtype=np.int32)
    worth = 0
    start = 0
    while start < count:
        for i in range(CHUNK):
            px, py = xs[start + i], ys[start + i]
            u = min(max(c * px - s * py + tx, zero), right)
            v = min(max(s * px + c * py + ty, zero), top)
            column, row = np.int32(u), np.int32(v)
            index[i] = row * stride + column
            across[i] = np.int32((u - np.float32(column)) * parts)
            up[i] = np.int32((v - np.float32(row)) * parts)
        for i in range(CHUNK):
            k = index[i]
            p, q = across[i], up[i]
            near = flat[k] * (PARTS - p) + flat[k + np.uint32(1)] * p
            far = flat[k + below] * (PARTS - p) + flat[k + below + np.uint32(1)] * p
            worth += near * (PARTS - q) + far * q
        start += CHUNK
        if worth + PARTS * PARTS * most * max(count - start, 0) < PARTS * PARTS * at_least:
            return -1
    return worth // (PARTS * PARTS)


@kernel
def evaluate(
    flat: NDArray[np.uint8],
    shape: tuple[int, int],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    facing: NDArray[np.float32],
    count: int,
    x: float,
    y: float,
    theta: float,
    at_least: int,
    index: NDArray[np.uint32],
) -> int:
    """What the population searches maximise: hits counted on squares, likelihood interpolated in a smooth field."""
    if frame[3] > 1.0:
        return interpolate_points(flat, shape, frame, xs, ys, count, x, y, theta, at_least, index)
    if counts_sides(frame):
        return count_sided(flat, shape, frame, xs, ys, facing, count, x, y, theta, at_least, index)
    return count_points(flat, shape, frame, xs, ys, count, x, y, theta, at_least, index)
