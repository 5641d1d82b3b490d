"""Exhaustive search of a lattice of poses by branch and bound on rasters pooled by their maximum.

What a scan's point is worth anywhere in a block of poses is at most the largest worth that a raster has in the
cells that the point may fall in. With those maxima pooled beforehand a bound costs as much as a fitness, and a
block whose bound does not beat the best pose known is done with (Olson, "Real-time correlative scan matching",
2009; Hess et al., "Real-time loop closure in 2D LIDAR SLAM", 2016).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.fitness import count_hits
from hsslam.kernels.heap import pop, push
from hsslam.se2 import Pose

SIDES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
"""Sides of the squares of cells that maxima are pooled over."""

BLOCKS = (16, 8, 4, 2, 1)
"""Lattice poses along each axis of a block, from the first level of the search to its last."""

CHUNK = 32
"""Points summed between two looks at whether a block can still win."""

ROUNDINGS = 16.0 * 2.0**-24
"""What single precision may shift two images of a point apart by, as a share of the coordinates passed through."""


@kernel
def pool(cells: NDArray[np.uint8], sides: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Largest worth in each square of ``sides[k]`` cells, named by its lowest corner, uint8 (K, H, W).

    Sides begin with 1, and each is at most twice its forerunner or the one before that; squares that stick out
    of the raster end at its border.
    """
    rows, columns = cells.shape
    pooled = np.empty((sides.shape[0], rows, columns), dtype=np.uint8)
    across = np.empty((rows, columns), dtype=np.uint8)
    pooled[0] = cells
    for k in range(1, sides.shape[0]):
        source = k - 1
        while source > 0 and 2 * sides[source - 1] >= sides[k]:
            source -= 1
        shift = sides[k] - sides[source]
        # What sticks out of the raster adds nothing: the square at hand reaches its border already.
        inner, below = max(columns - shift, 0), max(rows - shift, 0)
        low, out = pooled[source], pooled[k]
        for row in range(rows):
            for column in range(inner):
                across[row, column] = max(low[row, column], low[row, column + shift])
            across[row, inner:] = low[row, inner:]
        for row in range(below):
            for column in range(columns):
                out[row, column] = max(across[row, column], across[row + shift, column])
        out[below:] = across[below:]
    return pooled


@kernel
def smallest(sides: NDArray[np.int64], cells: int) -> int:
    """Number of the smallest square that is at least ``cells`` wide."""
    k = 0
    while sides[k] < cells:
        k += 1
    return k


@kernel
def rounding_of(pooled: NDArray[np.uint8], xs: NDArray[np.float32], ys: NDArray[np.float32]) -> float:
    """What single precision may shift a point by (cells), where its cell is in the raster at all."""
    largest = float(pooled.shape[1] + pooled.shape[2])
    farthest = 0.0
    for i in range(xs.shape[0]):
        farthest = max(farthest, math.hypot(xs[i], ys[i]))
    return ROUNDINGS * (largest + farthest)


@kernel
def rotate(
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    spill: NDArray[np.float32],
    tx: float,
    ty: float,
    theta: float,
    us: NDArray[np.int32],
    vs: NDArray[np.int32],
) -> None:
    """Lowest cells that points can fall in when they come ``spill`` cells short of a pose; into ``us``, ``vs``."""
    c, s = np.float32(math.cos(theta)), np.float32(math.sin(theta))
    tx32, ty32 = np.float32(tx), np.float32(ty)
    for i in range(xs.shape[0]):
        us[i] = np.int32(np.floor(c * xs[i] - s * ys[i] + tx32 - spill[i]))
        vs[i] = np.int32(np.floor(s * xs[i] + c * ys[i] + ty32 - spill[i]))


@kernel
def look_up(
    pooled: NDArray[np.uint8],
    slab: NDArray[np.int32],
    us: NDArray[np.int32],
    vs: NDArray[np.int32],
    column: int,
    row: int,
    most: int,
    at_least: int,
) -> int:
    """Sum of the points' worth, each in its own slab, moved by whole cells; -1 if it is under ``at_least``."""
    rows, columns = pooled.shape[1], pooled.shape[2]
    flat = pooled.reshape(pooled.size)
    right, top, stride = np.int32(columns - 1), np.int32(rows - 1), np.int32(columns)
    du, dv, zero = np.int32(column), np.int32(row), np.int32(0)
    index = np.empty(CHUNK, dtype=np.uint32)
    n = us.shape[0]
    total = 0
    start = 0
    while start < n:
        stop = min(start + CHUNK, n)
        pu, pv, ps = us[start:stop], vs[start:stop], slab[start:stop]
        # Two plain loops: the first becomes vector instructions, which the look-up in the second cannot.
        for i in range(stop - start):
            u = min(max(pu[i] + du, zero), right)
            v = min(max(pv[i] + dv, zero), top)
            index[i] = ps[i] + v * stride + u
        for i in range(stop - start):
            total += flat[index[i]]
        start = stop
        if total + most * (n - start) < at_least:
            return -1
    return total


@kernel
def best_of_lattice(
    pooled: NDArray[np.uint8],
    sides: NDArray[np.int64],
    blocks: NDArray[np.int64],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    guess: Pose,
    counts: NDArray[np.int64],
    turn: float,
    budget: int,
    least: int,
) -> tuple[Pose, int, int]:
    """Find the pose of a lattice where a scan's points are worth most, and prove it.

    The lattice is centred on the guess; its step is a cell along x and y, and ``turn`` in heading. A move by a
    cell moves every point by exactly one cell, so a block of one heading has no slack in its bound.

    Parameters
    ----------
    pooled : uint8 (K, H, W)
        From `pool`.
    sides, blocks : int64
        `SIDES`, `BLOCKS`.
    frame : float64 (4,)
        Of the `Raster`.
    xs, ys : float32 (N,)
        The scan's points in cells, best in an order that mixes them: what a block misses then shows early.
    guess : Pose
        Centre of the lattice.
    counts : int64 (3,)
        Steps from the guess to the lattice's edge, each way.
    turn : float
        Step in heading (rad); at most what moves the farthest point by a cell.
    budget : int
        Blocks and poses to look at before giving up, about.
    least : int
        Poses worth less than this are of no interest: the higher it is, the sooner the search ends.

    Returns
    -------
    (Pose, int, int)
        Best pose, its worth, and how many blocks and poses were looked at. With the budget spent, the best of those
        looked at; the guess, worth ``least`` - 1, if there was no pose among them.
    """
    n, levels, most = xs.shape[0], blocks.shape[0], int(frame[3])
    rounding = rounding_of(pooled, xs, ys)
    slabs, spills = np.zeros((levels, n), dtype=np.int32), np.zeros((levels, n), dtype=np.float32)
    for level in range(levels - 1):
        half_turn = 0.5 * (blocks[level] - 1) * turn
        for i in range(n):
            spill = half_turn * math.hypot(xs[i], ys[i]) + rounding
            spills[level, i] = spill
            k = smallest(sides, blocks[level] + int(2.0 * spill) + 1)
            slabs[level, i] = k * pooled.shape[1] * pooled.shape[2]
    cell = 1.0 / frame[2]
    low_x, low_y, low_theta = (
        guess[0] - counts[0] * cell,
        guess[1] - counts[1] * cell,
        guess[2] - counts[2] * turn,
    )
    tx, ty = (low_x - frame[0]) * frame[2], (low_y - frame[1]) * frame[2]
    us, vs = np.empty(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    best = counts.copy()
    best_worth, evaluations = least - 1, 0
    # A block is named by its lowest pose in steps, and has the level of its parts; the first is the whole lattice.
    heap = push(np.empty((1024, 5)), 0, most * n + 1, 0, 0.0, 0.0, 0.0)
    size = 1
    while size > 0 and heap[0, 0] >= best_worth + 1 and evaluations < budget:
        level = int(heap[0, 1])
        x0, y0, t0 = int(heap[0, 2]), int(heap[0, 3]), int(heap[0, 4])
        pop(heap, size)
        size -= 1
        side = blocks[level]
        x1, y1, t1 = 2 * counts[0] + 1, 2 * counts[1] + 1, 2 * counts[2] + 1
        if level > 0:
            x1, y1, t1 = min(x0 + 2 * side, x1), min(y0 + 2 * side, y1), min(t0 + 2 * side, t1)
        for t in range(t0, t1, side):
            theta = low_theta + (t + 0.5 * (side - 1)) * turn
            rotate(xs, ys, spills[level], tx, ty, theta, us, vs)
            for y in range(y0, y1, side):
                for x in range(x0, x1, side):
                    worth = look_up(pooled, slabs[level], us, vs, x, y, most, best_worth + 1)
                    evaluations += 1
                    if worth <= best_worth:
                        continue
                    if level == levels - 1:
                        best_worth = worth
                        best[0], best[1], best[2] = x, y, t
                    else:
                        heap = push(heap, size, worth, level + 1, x, y, t)
                        size += 1
    pose = np.empty(3)
    pose[0], pose[1] = low_x + best[0] * cell, low_y + best[1] * cell
    pose[2] = low_theta + best[2] * turn
    return pose, best_worth, evaluations


@kernel
def posterior_mean(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    best: Pose,
    guess: Pose,
    half: NDArray[np.float64],
    turn: float,
    temperature: float,
) -> Pose:
    """Mean of the poses around ``best``, each weighing ``exp(worth / temperature)`` (Olson 2009).

    Poses are half a cell and half a ``turn`` apart, up to two cells each way; those outside the window of half
    sides ``half`` around ``guess`` take no part.
    """
    reach, step, half_turn = 4, 0.5 / frame[2], 0.5 * turn
    most = count_hits(cells, frame, xs, ys, best[0], best[1], best[2], 0)
    # Poses of no weight to speak of are not counted to the end.
    least = int(most - 8.0 * temperature)
    total = sum_x = sum_y = sum_theta = 0.0
    for a in range(-reach, reach + 1):
        for b in range(-reach, reach + 1):
            for c in range(-reach, reach + 1):
                x, y, theta = best[0] + a * step, best[1] + b * step, best[2] + c * half_turn
                outside = (
                    abs(x - guess[0]) > half[0]
                    or abs(y - guess[1]) > half[1]
                    or abs(theta - guess[2]) > half[2]
                )
                here = a == 0 and b == 0 and c == 0
                if outside and not here:
                    continue
                worth = count_hits(cells, frame, xs, ys, x, y, theta, least)
                if worth < 0:
                    continue
                weight = math.exp((worth - most) / temperature)
                total += weight
                sum_x += weight * a * step
                sum_y += weight * b * step
                sum_theta += weight * c * half_turn
    mean = np.empty(3)
    mean[0], mean[1] = best[0] + sum_x / total, best[1] + sum_y / total
    mean[2] = best[2] + sum_theta / total
    return mean
