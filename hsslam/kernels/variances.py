"""How far ranges err, near and far, told from how far a scan's points lie from the surface that they match."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.histogram import BINS, median_of
from hsslam.kernels.lines import MEDIAN
from hsslam.kernels.surface import nearest_segment
from hsslam.se2 import Points, Pose

GRAZING = 0.35
"""Squared cosine of the angle between a beam and the normal of the line that it meets, at least, while nothing is told
of the noise: the spot of a real beam that grazes a wall is long."""

EVENNESS = 0.0045
"""Standard deviation (m) across a wall of what is no noise of the ranges: no wall is even, no line is quite right."""

LEAST_GRAZING = 0.05
"""The least squared cosine, however noisy the ranges are."""

FASTEST = 2.0
"""Power of the range with which a range's variance grows, at most: noise in proportion to the range."""

NEARBY = 0.5
"""Way from where the reference was seen from to where the scan was, at most, as a share of the near half's mean range:
there the reference's returns are about as far away as the scan's, and as noisy."""

ENOUGH = 20
"""Points, of the near and of the far half each, that tell of noise."""


@kernel
def variances_of(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    pose: Pose,
    distance: float,
    out: NDArray[np.float64],
) -> float:
    """Tell the variances of a scan's ranges, relative to each other.

    Points nearer than the mean range are one half, those beyond the other; each half's noise is the median of its
    distances across the lines of the surface. Where the far half's is more, the variance is taken to grow with a
    power of the range, from the near half's mean range on; but only where the scan was seen from `NEARBY`.

    Parameters
    ----------
    pieces, nearest, frame : arrays
        Of a `Surface`.
    points : Points
        (N, 2) m, seen from their frame's origin.
    pose : Pose
        Of the points' frame, near the truth.
    distance : float
        Points further than this from their line tell nothing (m).
    out : float64 (N,)
        Takes the variances, 1 for the near half's mean range and nearer.

    Returns
    -------
    float
        Square of the cosine between beam and normal under which a return's variance across the line shrinks no
        further: there `EVENNESS` is what counts.
    """
    n = points.shape[0]
    out[:] = 1.0
    total = 0.0
    for i in range(n):
        total += math.sqrt(points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1])
    split = total / max(n, 1)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    counts = np.zeros((2, BINS), dtype=np.int64)
    matched = np.zeros(2, dtype=np.int64)
    ranges = np.zeros(2)
    for i in range(n):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        k = nearest_segment(nearest, frame, x, y)
        if k < 0:
            continue
        residual = abs(pieces[k, 5] * x + pieces[k, 6] * y - pieces[k, 7])
        if residual >= distance:
            continue
        reading = math.sqrt(points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1])
        half = 1 if reading > split else 0
        counts[half, int(residual / distance * BINS)] += 1
        matched[half] += 1
        ranges[half] += reading
    if matched[0] < ENOUGH or matched[1] < ENOUGH:
        return GRAZING
    near = max(median_of(counts[0], matched[0]), 0.5) * distance / BINS / MEDIAN
    far = max(median_of(counts[1], matched[1]), 0.5) * distance / BINS / MEDIAN
    start = ranges[0] / matched[0]
    if far > near and pose[0] * pose[0] + pose[1] * pose[1] < NEARBY * NEARBY * start * start:
        growth = min(2.0 * math.log(far / near) / math.log(ranges[1] / matched[1] / start), FASTEST)
        for i in range(n):
            squared = (points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1]) / (start * start)
            if squared > 1.0:
                out[i] = squared ** (0.5 * growth)
    return min(max((2.0 * EVENNESS / (near + far)) ** 2, LEAST_GRAZING), 1.0)
