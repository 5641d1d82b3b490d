"""Branch and bound over every pose of a window, not only over those of a lattice.

The fitness is constant on cells of poses whose borders lie anywhere, so that no lattice finds its largest value
for certain. A box of poses, however small, still has a bound: a point that moves by at most ``d`` about where
the box's centre puts it is worth at most the most that it finds there. Boxes are halved along each axis until
their bounds fall to the best pose known (best first; Land and Doig 1960).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.correlative import CHUNK, rounding_of, smallest
from hsslam.kernels.fitness import count_hits
from hsslam.kernels.heap import pop, push
from hsslam.se2 import Pose

LEVELS = 15
"""Sizes of boxes; the smallest is 16384 times smaller than the largest: under 0.02 mm for cells of 2.5 cm."""

FIRST_SIDE = 16.0
"""Side of the largest boxes, in cells, at most; in heading, what moves the farthest point so far."""


@kernel
def with_dominoes(pooled: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Slabs 1 x 1, 2 x 1, 1 x 2, 2 x 2, and the larger squares of pooled maxima, uint8 (K + 2, H, W)."""
    kinds, rows, columns = pooled.shape
    out = np.empty((kinds + 2, rows, columns), dtype=np.uint8)
    out[0] = pooled[0]
    out[3:] = pooled[1:]
    for row in range(rows):
        above = min(row + 1, rows - 1)
        for column in range(columns):
            right = min(column + 1, columns - 1)
            out[1, row, column] = max(pooled[0, row, column], pooled[0, row, right])
            out[2, row, column] = max(pooled[0, row, column], pooled[0, above, column])
    return out


@kernel
def bound(
    slabs: NDArray[np.uint8],
    base: NDArray[np.int32],
    straddle: NDArray[np.int32],
    reach: NDArray[np.float32],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    pose: Pose,
    at_least: int,
) -> int:
    """Largest worth that points can have within ``reach`` (cells) of where a pose puts them; -1 if too little."""
    rows, columns = slabs.shape[1], slabs.shape[2]
    flat = slabs.reshape(slabs.size)
    c, s = np.float32(math.cos(pose[2])), np.float32(math.sin(pose[2]))
    tx = np.float32((pose[0] - frame[0]) * frame[2])
    ty = np.float32((pose[1] - frame[1]) * frame[2])
    right, top, stride = np.int32(columns - 1), np.int32(rows - 1), np.int32(columns)
    zero, two = np.int32(0), np.int32(2)
    index = np.empty(CHUNK, dtype=np.uint32)
    n, most = xs.shape[0], int(frame[3])
    total = 0
    start = 0
    while start < n:
        stop = min(start + CHUNK, n)
        px, py, pr = xs[start:stop], ys[start:stop], reach[start:stop]
        pb, ps = base[start:stop], straddle[start:stop]
        for i in range(stop - start):
            u, v = c * px[i] - s * py[i] + tx, s * px[i] + c * py[i] + ty
            u0 = min(max(np.int32(np.floor(u - pr[i])), zero), right)
            u1 = min(max(np.int32(np.floor(u + pr[i])), zero), right)
            v0 = min(max(np.int32(np.floor(v - pr[i])), zero), top)
            v1 = min(max(np.int32(np.floor(v + pr[i])), zero), top)
            index[i] = pb[i] + ps[i] * ((u1 - u0) + two * (v1 - v0)) + v0 * stride + u0
        for i in range(stop - start):
            total += flat[index[i]]
        start = stop
        if total + most * (n - start) < at_least:
            return -1
    return total


@kernel
def certify(
    slabs: NDArray[np.uint8],
    sides: NDArray[np.int64],
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    guess: Pose,
    half: NDArray[np.float64],
    turn: float,
    known: Pose,
    known_worth: int,
    slack: int,
    budget: int,
) -> tuple[Pose, int, int, int]:
    """Find the best pose of a window, and bound what any other could be worth.

    Parameters
    ----------
    slabs, sides : arrays
        From `with_dominoes`, and `SIDES` of the pooled maxima it was made from.
    cells, frame, xs, ys : arrays
        Of a `HitFitness`.
    guess : Pose
        Centre of the window.
    half : float64 (3,)
        Its half sides (m, m, rad).
    turn : float
        Turn that moves the farthest point by a cell (rad).
    known, known_worth : Pose, int
        A good pose to begin with, in the window, and what it is worth.
    slack : int
        Worth by which the bound may stay above the best pose.
    budget : int
        Boxes looked at, at most.

    Returns
    -------
    (Pose, int, int, int)
        Best pose, its worth, a bound of the worth of every pose in the window, and boxes looked at.
    """
    n, rounding = xs.shape[0], rounding_of(slabs, xs, ys)
    counts, box = np.empty(3, dtype=np.int64), np.empty(3)
    for axis in range(3):
        largest = FIRST_SIDE * turn if axis == 2 else FIRST_SIDE / frame[2]
        counts[axis] = max(math.ceil(2.0 * half[axis] / largest - 1e-9), 1)
        box[axis] = half[axis] / counts[axis]
    reach = np.empty((LEVELS, n), dtype=np.float32)
    base, straddle = np.zeros((LEVELS, n), dtype=np.int32), np.zeros((LEVELS, n), dtype=np.int32)
    slab = slabs.shape[1] * slabs.shape[2]
    for level in range(LEVELS):
        shrunk = 0.5**level
        for i in range(n):
            distance = max(box[0], box[1]) * frame[2] + box[2] * math.hypot(xs[i], ys[i])
            reach[level, i] = shrunk * distance + rounding
            if 2.0 * reach[level, i] < 1.0:
                straddle[level, i] = slab
            else:
                k = smallest(sides, int(2.0 * reach[level, i]) + 2)
                base[level, i] = slab * (k + 2)
    best, best_worth = known.copy(), known_worth
    pose, centre = np.empty(3), np.empty(3)
    # A box has the level of its parts; the first is the whole window, and is divided as ``counts`` says.
    heap = push(np.empty((1024, 5)), 0, int(frame[3]) * n + 1, 0, guess[0], guess[1], guess[2])
    size = 1
    evaluations = ceiling = 0
    while size > 0 and heap[0, 0] >= best_worth + slack + 1 and evaluations < budget:
        worth, level = int(heap[0, 0]), int(heap[0, 1])
        for axis in range(3):
            centre[axis] = heap[0, 2 + axis]
        pop(heap, size)
        size -= 1
        if level == LEVELS:
            ceiling = max(ceiling, worth)
            continue
        shrunk = 0.5**level
        if level == 1:
            counts[:] = 2
        nx, ny = counts[0], counts[1]
        for part in range(nx * ny * counts[2]):
            pose[0] = centre[0] + shrunk * box[0] * (2 * (part % nx) + 1 - nx)
            pose[1] = centre[1] + shrunk * box[1] * (2 * (part // nx % ny) + 1 - ny)
            pose[2] = centre[2] + shrunk * box[2] * (2 * (part // (nx * ny)) + 1 - counts[2])
            enough = best_worth + slack + 1
            worth = bound(slabs, base[level], straddle[level], reach[level], frame, xs, ys, pose, enough)
            evaluations += 1
            if worth < enough:
                continue
            heap = push(heap, size, worth, level + 1, pose[0], pose[1], pose[2])
            size += 1
            found = count_hits(cells, frame, xs, ys, pose[0], pose[1], pose[2], best_worth + 1)
            if found > best_worth:
                best_worth = found
                for axis in range(3):
                    best[axis] = pose[axis]
    ceiling = max(ceiling, best_worth + slack)
    if size > 0:
        ceiling = max(ceiling, int(heap[0, 0]))
    return best, best_worth, ceiling, evaluations
