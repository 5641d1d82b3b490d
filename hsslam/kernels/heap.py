"""A heap of blocks of poses that gives the most promising first: what best-first branch and bound runs on.

A row of the heap is its rank, its level, and three numbers that name the block.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

LEVELS = 64.0
"""More levels than any search has: a level counts less than a hit."""


@kernel
def push(
    heap: NDArray[np.float64], size: int, worth: int, level: int, a: float, b: float, c: float
) -> NDArray[np.float64]:
    """Add a block; of equal worth, the later level comes first. Return the heap, which may have moved."""
    if size == heap.shape[0]:
        larger = np.empty((2 * size, 5))
        larger[:size] = heap
        heap = larger
    rank = worth + level / LEVELS
    child = size
    while child > 0:
        parent = (child - 1) // 2
        if heap[parent, 0] >= rank:
            break
        for k in range(5):
            heap[child, k] = heap[parent, k]
        child = parent
    heap[child, 0], heap[child, 1] = rank, level
    heap[child, 2], heap[child, 3], heap[child, 4] = a, b, c
    return heap


@kernel
def pop(heap: NDArray[np.float64], size: int) -> None:
    """Take the first row off a heap of ``size`` rows."""
    last = size - 1
    rank = heap[last, 0]
    parent = 0
    while True:
        child = 2 * parent + 1
        if child >= last:
            break
        if child + 1 < last and heap[child + 1, 0] > heap[child, 0]:
            child += 1
        if heap[child, 0] <= rank:
            break
        for k in range(5):
            heap[parent, k] = heap[child, k]
        parent = child
    for k in range(5):
        heap[parent, k] = heap[last, k]
