"""Local refinement of a pose: robust point-to-line Gauss-Newton on a reference's surface."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.blocks import AGAIN, LANES, TERMS, add_terms, blocks_of, find_segments, take_variances
from hsslam.kernels.variances import GRAZING, variances_of
from hsslam.se2 import Points, Pose, wrap

NOISY = 0.051
"""Returns are noisy where the least squared cosine is under this. Beside an edge the segment nearest to them may be of
another surface: they count only if their line agrees with it. A door post drew robots back by 2 cm in the doorway."""

NO_LINES: NDArray[np.float64] = np.empty((0, 3))
"""Point-to-line only."""


@kernel
def refine(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    start: Pose,
    iterations: int,
    settle: float,
    distances: tuple[float, float],
    scales: tuple[float, float],
) -> tuple[Pose, int, bool]:
    """Minimise the Cauchy-weighted distances of points from the lines of their nearest segments, and back.

    Where the scan's own lines are given, the place on the segment nearest to a point is also to lie on the line
    through the scan at that point: the noise of either scan then counts in one of the two distances only, and the
    lines of neither are taken for the truth. And a point whose line runs the other way is left out, unless a segment
    of its own side is near: it is of the other side of a wall, which two rooms show 10 to 20 cm apart.

    A range errs along its beam, from the origin of the points' frame, so the part of its variance that is across the
    line is the squared cosine between beam and normal: points count by its inverse, as far as walls are even. And
    where far ranges err more than near ones, they count for less: see `variances_of`, which is asked once the reach
    has shrunk to its end.

    Parameters
    ----------
    pieces, nearest, frame : arrays
        Of a `Surface`.
    points : Points
        (N, 2) m.
    lines : float64 (N, 3)
        Unit normals, to the left of who goes along the surface in the order of the points, and offsets of the
        scan's lines at its points, zero where it has none: see `lines_of`. (0, 3): point-to-line only.
    start : Pose
        Where to begin.
    iterations : int
        At most.
    settle : float
        Iterations in which reach and scale would shrink to zero, linearly, if they did not stop at their ends.
    distances : (float, float)
        Points further than this from the surface are left out (m), from the first to the last.
    scales : (float, float)
        Of the Cauchy weight ``1 / (1 + (r / scale)^2)`` (m), from the first to the last, where a beam meets its line
        upright.

    Returns
    -------
    (Pose, int, bool)
        The refined pose, iterations spent, and whether the last step was shorter than 0.1 mm and 0.1 mrad.
    """
    pose = start.copy()
    hessian = np.empty((3, 3))
    right = np.empty(3)
    step = np.empty(3)
    sums, totals = np.empty(TERMS * LANES), np.empty(TERMS)
    half, blocks, known = blocks_of(points, lines)
    both = lines.shape[0] > 0
    told = noisy = False
    least = GRAZING
    variances = np.ones(points.shape[0])
    for iteration in range(iterations):
        left = 1.0 - iteration / settle
        distance = max(distances[1], distances[0] * left)
        squared_scale = max(scales[1], scales[0] * left) ** 2
        settled = distance <= distances[1] and squared_scale <= scales[1] ** 2
        if settled and not told:
            least = variances_of(pieces, nearest, frame, points, pose, distance, variances)
            take_variances(variances, half, blocks)
            told, noisy = True, least < NOISY
            if noisy:
                known[:] = AGAIN
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x0, y0 = pose[0], pose[1]
        sums[:] = 0.0
        for block in range(2 * half if settled else half):
            find_segments(pieces, nearest, frame, x0, y0, c, s, noisy, block, blocks, known)
            add_terms(
                x0, y0, c, s, distance**2, squared_scale, least, noisy, settled and both, block, blocks, sums
            )
        for term in range(TERMS):
            totals[term] = sums[term * LANES : (term + 1) * LANES].sum()
        xx, xy, xt, yy, yt, tt, gx, gy, gt, used = totals
        if used < 3:
            return start.copy(), iteration, False
        # Damping in proportion to the whole: a direction that no line fixes (along a corridor) stays put.
        damping = 1e-3 * (xx + yy) + 1e-9
        hessian[0, 0], hessian[0, 1], hessian[0, 2] = xx + damping, xy, xt
        hessian[1, 1], hessian[1, 2], hessian[2, 2] = yy + damping, yt, tt + damping
        right[0], right[1], right[2] = -gx, -gy, -gt
        solve3(hessian, right, step)
        pose[0] += step[0]
        pose[1] += step[1]
        pose[2] = wrap(pose[2] + step[2])
        if settled and abs(step[0]) + abs(step[1]) < 3e-4 and abs(step[2]) < 1e-4:
            return pose, iteration + 1, True
    return pose, iterations, False


@kernel
def solve3(hessian: NDArray[np.float64], right: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Solve a symmetric positive definite 3 x 3 system given by its upper triangle; into ``out`` (3,)."""
    l00 = math.sqrt(hessian[0, 0])
    l10 = hessian[0, 1] / l00
    l20 = hessian[0, 2] / l00
    l11 = math.sqrt(max(hessian[1, 1] - l10 * l10, 1e-12))
    l21 = (hessian[1, 2] - l20 * l10) / l11
    l22 = math.sqrt(max(hessian[2, 2] - l20 * l20 - l21 * l21, 1e-12))
    y0 = right[0] / l00
    y1 = (right[1] - l10 * y0) / l11
    y2 = (right[2] - l20 * y0 - l21 * y1) / l22
    out[2] = y2 / l22
    out[1] = (y1 - l21 * out[2]) / l11
    out[0] = (y0 - l10 * out[1] - l20 * out[2]) / l00
