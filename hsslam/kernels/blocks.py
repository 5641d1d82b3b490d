"""A scan's points in blocks whose loops become vector instructions: what the refinement computes of each of them.

Blocks hold `LANES` points, a row for each quantity. All rows of a block lie in one array, at distances that are known
when it is compiled: so the compiler sees that no row overlaps another, and need not ask.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.surface import EMPTY
from hsslam.se2 import Points

LANES = 32
"""Points of a block."""

ROWS = 16
"""Quantities of a point: its coordinates; its line's normal and offset, in the scan's frame; the relative variance of
its range; one over its squared range; 1 where a segment is near, else 0; that segment's `Surface.pieces`."""

BLOCK = ROWS * LANES

X, Y, LINE_X, LINE_Y, LINE_OFFSET, VARIANCE, PER_SQUARED_RANGE, NEAR, PIECE = (
    LANES * row for row in range(9)
)
"""Where these rows begin in a block; `PIECE` is the first of eight."""

BEGIN_X, BEGIN_Y, ALONG_X, ALONG_Y, LENGTH, NORMAL_X, NORMAL_Y, OFFSET = (
    PIECE + LANES * row for row in range(8)
)

TERMS = 10
"""Of the normal equations: the upper triangle of the Hessian, row by row, then the gradient; at last the number of
points that count."""

XX, XY, XT, YY, YT, TT, GX, GY, GT, USED = (np.uint64(LANES * term) for term in range(TERMS))

AGAIN = -2
"""Instead of a segment's number: whatever is nearest, it is to be looked up."""

NOWHERE = 1e30
"""Coordinate of a lane without a point (m): no segment is near."""

LEAST_AGREEMENT = 0.5
"""Cosine of the angle between two lines that may be of the same surface, at least."""

ASIDE = 0.08
"""How far before a point its segment is looked for where the nearest is of the other side of a wall (m). Returns that
noise carries beyond the middle of a thin wall belong to the side that they were seen from: without them it would lie
nearer than it is."""


@kernel
def blocks_of(
    points: Points, lines: NDArray[np.float64]
) -> tuple[int, NDArray[np.float64], NDArray[np.int64]]:
    """Lay out points and their lines.

    Every other point comes first, in as many blocks as the others take: the first half of the blocks stands for all.

    Parameters
    ----------
    points : Points
        (N, 2) m.
    lines : float64 (N, 3) or (0, 3)
        As for `hsslam.kernels.refine.refine`.

    Returns
    -------
    half : int
        Number of blocks of each half.
    blocks : float64 (2 * half * BLOCK,)
        The blocks, one after the other. Lanes without a point are nowhere.
    known : int64 (2 * half * LANES,)
        Numbers of the segments that are in the blocks: none, -1; or `AGAIN`.
    """
    n = points.shape[0]
    half = (n + 2 * LANES - 1) // (2 * LANES)
    blocks = np.zeros(2 * half * BLOCK)
    for block in range(2 * half):
        for lane in range(LANES):
            blocks[block * BLOCK + X + lane] = NOWHERE
            blocks[block * BLOCK + VARIANCE + lane] = 1.0
    for i in range(n):
        at = lane_of(i, half)
        x, y = points[i, 0], points[i, 1]
        blocks[at + X], blocks[at + Y] = x, y
        blocks[at + PER_SQUARED_RANGE] = 1.0 / (x * x + y * y + 1e-12)
    for i in range(lines.shape[0]):
        at = lane_of(i, half)
        blocks[at + LINE_X], blocks[at + LINE_Y], blocks[at + LINE_OFFSET] = lines[i]
    return half, blocks, np.full(2 * half * LANES, -1, dtype=np.int64)


@kernel
def lane_of(i: int, half: int) -> int:
    """Where the lane of point ``i`` begins, given the number of blocks of each half."""
    block, lane = (i % 2) * half + i // (2 * LANES), i // 2 % LANES
    return block * BLOCK + lane


@kernel
def take_variances(variances: NDArray[np.float64], half: int, blocks: NDArray[np.float64]) -> None:
    """Lay out relative variances (N,) of the points' ranges."""
    for i in range(variances.shape[0]):
        blocks[lane_of(i, half) + VARIANCE] = variances[i]


@kernel
def find_segments(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    x0: float,
    y0: float,
    c: float,
    s: float,
    noisy: bool,
    block: int,
    blocks: NDArray[np.float64],
    known: NDArray[np.int64],
) -> None:
    """Bring the segments nearest to a block's points into it.

    Parameters
    ----------
    pieces, nearest, frame : arrays
        Of a `Surface`.
    x0, y0, c, s : float
        Pose of the points' frame: its position, cosine and sine of its angle.
    noisy : bool
        Whether noise may carry a return through a wall: see `ASIDE`.
    block : int
        Number of the block.
    blocks, known : arrays
        From `blocks_of`, both brought up to date.
    """
    width, height = float(nearest.shape[1]), float(nearest.shape[0])
    number = (1 << int(frame[3])) - 1
    for lane in range(LANES):
        at = np.uint64(block * BLOCK + lane)
        x, y = blocks[at + np.uint64(X)], blocks[at + np.uint64(Y)]
        u = (x0 + (c * x - s * y) - frame[0]) * frame[2]
        v = (y0 + (s * x + c * y) - frame[1]) * frame[2]
        k = -1
        if u >= 0.0 and v >= 0.0 and u < width and v < height:
            key = nearest[np.uint64(v), np.uint64(u)]
            if key != EMPTY:
                k = int(key) & number
        # From one iteration to the next most stay the same.
        slot = np.uint64(block * LANES + lane)
        if k == known[slot]:
            continue
        known[slot] = k
        if noisy and k >= 0:
            lx, ly = blocks[at + np.uint64(LINE_X)], blocks[at + np.uint64(LINE_Y)]
            mx, my = c * lx - s * ly, s * lx + c * ly
            if pieces[np.uint64(k), 5] * mx + pieces[np.uint64(k), 6] * my < -LEAST_AGREEMENT:
                # Which one is before the point may change while the nearest stays: it is asked again.
                known[slot] = AGAIN
                u, v = u + ASIDE * mx * frame[2], v + ASIDE * my * frame[2]
                if u >= 0.0 and v >= 0.0 and u < width and v < height:
                    key = nearest[np.uint64(v), np.uint64(u)]
                    other = np.uint64(int(key) & number)
                    if key != EMPTY and pieces[other, 5] * mx + pieces[other, 6] * my >= LEAST_AGREEMENT:
                        k = int(other)
        blocks[at + np.uint64(NEAR)] = 1.0 if k >= 0 else 0.0
        if k >= 0:
            for value in range(8):
                blocks[at + np.uint64(PIECE + LANES * value)] = pieces[np.uint64(k), value]


@kernel
def add_terms(
    x0: float,
    y0: float,
    c: float,
    s: float,
    squared_distance: float,
    squared_scale: float,
    least: float,
    noisy: bool,
    both: bool,
    block: int,
    blocks: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Add what each point of a block adds to the normal equations, lane by lane.

    Parameters
    ----------
    x0, y0, c, s : float
        As for `find_segments`.
    squared_distance : float
        Of the furthest points from their segments that count (m^2).
    squared_scale : float
        Of the Cauchy weight (m^2).
    least : float
        The least squared cosine between beam and normal, see `hsslam.kernels.variances`.
    noisy : bool
        Whether a point counts only if its line, where it has one, agrees with its segment's; else it must not deny it.
    both : bool
        Whether the places on the segments are to lie on the scan's lines, too.
    block : int
        Number of the block.
    blocks : float64 (B * BLOCK,)
        From `blocks_of`, with segments from `find_segments`.
    sums : float64 (TERMS * LANES,)
        Takes the terms.
    """
    begin = block * BLOCK
    agreement_least = LEAST_AGREEMENT if noisy else -LEAST_AGREEMENT
    for lane in range(LANES):
        to = np.uint64(lane)
        at = np.uint64(begin) + to
        px, py = blocks[at + np.uint64(X)], blocks[at + np.uint64(Y)]
        rx, ry = c * px - s * py, s * px + c * py
        x, y = x0 + rx, y0 + ry
        ux, uy = blocks[at + np.uint64(ALONG_X)], blocks[at + np.uint64(ALONG_Y)]
        qx, qy = x - blocks[at + np.uint64(BEGIN_X)], y - blocks[at + np.uint64(BEGIN_Y)]
        along = min(max(qx * ux + qy * uy, 0.0), blocks[at + np.uint64(LENGTH)])
        ex, ey = qx - along * ux, qy - along * uy
        nx, ny = blocks[at + np.uint64(NORMAL_X)], blocks[at + np.uint64(NORMAL_Y)]
        lx, ly = blocks[at + np.uint64(LINE_X)], blocks[at + np.uint64(LINE_Y)]
        mx, my = c * lx - s * ly, s * lx + c * ly
        agreement = nx * mx + ny * my
        counts = blocks[at + np.uint64(NEAR)]
        counts = counts if ex * ex + ey * ey <= squared_distance else 0.0
        lineless = lx == 0.0 and ly == 0.0
        counts = counts if lineless or agreement >= agreement_least else 0.0
        sums[USED + to] += counts
        residual = nx * x + ny * y - blocks[at + np.uint64(OFFSET)]
        across = nx * rx + ny * ry
        own = blocks[at + np.uint64(VARIANCE)]
        variance = own * max(across * across * blocks[at + np.uint64(PER_SQUARED_RANGE)], least)
        weight = counts * squared_scale / (variance * squared_scale + residual * residual)
        nt = ny * rx - nx * ry
        wx, wy, wt = weight * nx, weight * ny, weight * nt
        xx, xy, xt, yy, yt, tt = wx * nx, wx * ny, wx * nt, wy * ny, wy * nt, wt * nt
        gx, gy, gt = wx * residual, wy * residual, wt * residual
        if both:
            counts = counts if agreement >= LEAST_AGREEMENT else 0.0
            sx, sy = x - ex - x0, y - ey - y0
            residual = blocks[at + np.uint64(LINE_OFFSET)] - mx * sx - my * sy
            weight = counts * squared_scale / (own * squared_scale + residual * residual)
            nt = my * sx - mx * sy
            wx, wy, wt = weight * mx, weight * my, weight * nt
            xx += wx * mx
            xy += wx * my
            xt += wx * nt
            yy += wy * my
            yt += wy * nt
            tt += wt * nt
            gx += wx * residual
            gy += wy * residual
            gt += wt * residual
        sums[XX + to] += xx
        sums[XY + to] += xy
        sums[XT + to] += xt
        sums[YY + to] += yy
        sums[YT + to] += yt
        sums[TT + to] += tt
        sums[GX + to] += gx
        sums[GY + to] += gy
        sums[GT + to] += gt
