"""Local refinement of a pose: robust point-to-line Gauss-Newton on a reference's surface."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.surface import nearest_segment
from hsslam.kernels.variances import GRAZING, variances_of
from hsslam.se2 import Points, Pose, wrap

NO_LINES: NDArray[np.float64] = np.empty((0, 3))
"""Point-to-line only."""

LEAST_AGREEMENT = 0.5
"""Cosine of the angle between two lines that may be of the same surface, at least."""


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
    lines of neither are taken for the truth. And a point whose line runs the other way is left out: it is of the
    other side of a wall, which robots in neighbouring rooms see 10 to 20 cm apart.

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
    both = lines.shape[0] > 0
    told = False
    least = GRAZING
    variances = np.ones(points.shape[0])
    for iteration in range(iterations):
        left = 1.0 - iteration / settle
        distance = max(distances[1], distances[0] * left)
        squared_scale = max(scales[1], scales[0] * left) ** 2
        settled = distance <= distances[1] and squared_scale <= scales[1] ** 2
        if settled and not told:
            least = variances_of(pieces, nearest, frame, points, pose, distance, variances)
            told = True
        c, s = math.cos(pose[2]), math.sin(pose[2])
        x0, y0 = pose[0], pose[1]
        xx = xy = xt = yy = yt = tt = gx = gy = gt = 0.0
        used = 0
        for i in range(0, points.shape[0], 1 if settled else 2):
            rx = c * points[i, 0] - s * points[i, 1]
            ry = s * points[i, 0] + c * points[i, 1]
            x, y = x0 + rx, y0 + ry
            k = nearest_segment(nearest, frame, x, y)
            if k < 0:
                continue
            px, py = x - pieces[k, 0], y - pieces[k, 1]
            along = min(max(px * pieces[k, 2] + py * pieces[k, 3], 0.0), pieces[k, 4])
            ex, ey = px - along * pieces[k, 2], py - along * pieces[k, 3]
            if ex * ex + ey * ey > distance * distance:
                continue
            nx, ny = pieces[k, 5], pieces[k, 6]
            mx = my = agreement = 0.0
            if both:
                mx, my = c * lines[i, 0] - s * lines[i, 1], s * lines[i, 0] + c * lines[i, 1]
                agreement = nx * mx + ny * my
                if agreement < -LEAST_AGREEMENT:
                    continue
            residual = nx * x + ny * y - pieces[k, 7]
            across = nx * rx + ny * ry
            variance = variances[i] * max(across * across / (rx * rx + ry * ry + 1e-12), least)
            weight = squared_scale / (variance * squared_scale + residual * residual)
            nt = ny * rx - nx * ry
            wx, wy, wt = weight * nx, weight * ny, weight * nt
            used += 1
            xx += wx * nx
            xy += wx * ny
            xt += wx * nt
            yy += wy * ny
            yt += wy * nt
            tt += wt * nt
            gx += wx * residual
            gy += wy * residual
            gt += wt * residual
            if not (settled and both) or agreement < LEAST_AGREEMENT:
                continue
            sx, sy = x - ex - x0, y - ey - y0
            residual = lines[i, 2] - mx * sx - my * sy
            weight = squared_scale / (variances[i] * squared_scale + residual * residual)
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
