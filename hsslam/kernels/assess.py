"""How well a scan lies on a reference's surface at a pose: the same yardstick for every matcher."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.surface import Surface, nearest_segment, squared_distance
from hsslam.se2 import Points, Pose

RANGE_STD = 0.01
"""Standard deviation (m) of a return across the surface, at least: the noise of indoor scanners."""

CORRELATION = 2.8
"""Returns that share an error (a bent wall, a bad line fit) and so count as one independent return."""

DEGENERATE_SHARE = 0.1
"""Share of the window's variance that a direction must keep to count as open."""


def assess(
    surface: Surface, points: Points, pose: Pose, half: NDArray[np.float64], distance: float
) -> tuple[float, NDArray[np.float64], float]:
    """Score, covariance and degenerate direction of a scan at a pose.

    Parameters
    ----------
    surface : Surface
        Of the reference.
    points : Points
        (N, 2) m, the scan.
    pose : Pose
        Of the scan in the reference's frame.
    half : float64 (3,)
        Half sides of the search window (m, m, rad): what is known of a direction that the points leave open.
    distance : float
        Points within it of the surface count as matched (m), at most the surface's reach.

    Returns
    -------
    score : float
        Share of the points within ``distance`` of the surface.
    covariance : float64 (3, 3)
        Inverse of the information that the matched points hold about the pose across their lines (the
        Gauss-Newton Hessian of point-to-line distances over their variance), plus that of the window.
    direction : float
        See `degenerate_direction`.
    """
    return measure(surface.pieces, surface.nearest, surface.frame, points, pose, half, distance)


@kernel
def measure(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    pose: Pose,
    half: NDArray[np.float64],
    distance: float,
) -> tuple[float, NDArray[np.float64], float]:
    """See `assess`; ``pieces``, ``nearest`` and ``frame`` are the surface's."""
    matched, information = gather(pieces, nearest, frame, points, pose, distance)
    covariance = covariance_of(information, half)
    return matched / max(points.shape[0], 1), covariance, degenerate_direction(covariance, half)


@kernel
def covariance_of(information: NDArray[np.float64], half: NDArray[np.float64]) -> NDArray[np.float64]:
    """Covariance (3, 3) from the points' information and the window's, which keeps it positive definite.

    A truth uniform in a box of half side ``h`` has the variance ``h^2 / 3``.
    """
    a = information[0, 0] + 3.0 / max(half[0], 1e-3) ** 2
    b, c = information[0, 1], information[0, 2]
    d = information[1, 1] + 3.0 / max(half[1], 1e-3) ** 2
    e = information[1, 2]
    f = information[2, 2] + 3.0 / max(half[2], 1e-3) ** 2
    out = np.empty((3, 3))
    out[0, 0] = d * f - e * e
    out[0, 1] = out[1, 0] = c * e - b * f
    out[0, 2] = out[2, 0] = b * e - c * d
    out[1, 1] = a * f - c * c
    out[1, 2] = out[2, 1] = b * c - a * e
    out[2, 2] = a * d - b * b
    out /= a * out[0, 0] + b * out[0, 1] + c * out[0, 2]
    return out


@kernel
def degenerate_direction(covariance: NDArray[np.float64], half: NDArray[np.float64]) -> float:
    """Direction (rad, in [-pi/2, pi/2)) in which the position is hardly better known than the window; NaN if none.

    It is the long axis of the covariance's ellipse, where the variance along it is over `DEGENERATE_SHARE` of
    that of a truth uniform in the window.
    """
    a, b, d = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    largest = 0.5 * (a + d) + math.sqrt(0.25 * (a - d) * (a - d) + b * b)
    prior = max(half[0], half[1]) ** 2 / 3.0
    if largest < DEGENERATE_SHARE * prior:
        return math.nan
    angle = 0.5 * math.atan2(2.0 * b, a - d)
    return angle if angle < 0.5 * math.pi else -0.5 * math.pi


@kernel
def gather(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    pose: Pose,
    distance: float,
) -> tuple[int, NDArray[np.float64]]:
    """Count the points within ``distance`` of the surface, and sum their information (3, 3)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x0, y0 = pose[0], pose[1]
    matched = 0
    squared_residuals = xx = xy = xt = yy = yt = tt = 0.0
    for i in range(points.shape[0]):
        rx = c * points[i, 0] - s * points[i, 1]
        ry = s * points[i, 0] + c * points[i, 1]
        x, y = x0 + rx, y0 + ry
        k = nearest_segment(nearest, frame, x, y)
        if k < 0 or squared_distance(pieces, k, x, y) > distance * distance:
            continue
        matched += 1
        nx, ny = pieces[k, 5], pieces[k, 6]
        residual = nx * x + ny * y - pieces[k, 7]
        squared_residuals += min(residual * residual, distance * distance)
        nt = ny * rx - nx * ry
        xx += nx * nx
        xy += nx * ny
        xt += nx * nt
        yy += ny * ny
        yt += ny * nt
        tt += nt * nt
    information = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    if matched > 0:
        variance = max(squared_residuals / matched, RANGE_STD * RANGE_STD)
        information /= variance * CORRELATION
    return matched, information
