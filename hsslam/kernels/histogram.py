"""Medians from a histogram, without sorting."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

BINS = 50
"""Of the histogram of distances across lines, from which their median is told."""


@kernel
def median_of(counts: NDArray[np.int64], total: int) -> float:
    """Median of a histogram of ``total`` values, in bins from the beginning of the first; 0 where there are none."""
    below = 0
    for b in range(counts.shape[0]):
        if counts[b] > 0 and 2 * (below + counts[b]) >= total:
            return float(b + (0.5 * total - below) / counts[b])
        below += counts[b]
    return 0.0
