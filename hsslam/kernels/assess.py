"""How well a scan lies on a reference's surface at a pose: the same yardstick for every matcher."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.blocks import LEAST_AGREEMENT
from hsslam.kernels.histogram import BINS, median_of
from hsslam.kernels.lines import MEDIAN
from hsslam.kernels.matrix3 import deflate
from hsslam.kernels.surface import Surface, nearest_segment, scan_lines, squared_distance
from hsslam.se2 import Points, Pose

RANGE_STD = 0.01
"""Standard deviation (m) of a return across the surface, at least: the noise of indoor scanners."""

CORRELATION = 1.6
"""Returns that share an error (a bent wall, a bad line fit) and so count as one independent return."""

SPURIOUS = 2.0
"""How much of the information that noisy directions of lines feign is taken off: more than there is on average,
since what is left counts as knowledge of a direction that may be open."""

LARGEST_TILT = 0.5
"""Variance of a line's direction (rad^2) beyond which it points nowhere."""

DEGENERATE_SHARE = 0.1
"""Share of the window's variance that a direction must keep to count as open."""


def assess(
    surface: Surface,
    points: Points,
    pose: Pose,
    half: NDArray[np.float64],
    distance: float,
    lines: NDArray[np.float64] | None = None,
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
        Points within it of the surface count as matched (m), at most the surface's reach, unless their line runs the
        other way: they are of the other side of a wall.
    lines : float64 (N, 3), optional
        Through the points, see `scan_lines`; made if they are left out.

    Returns
    -------
    score : float
        Share of the points within ``distance`` of the surface.
    covariance : float64 (3, 3)
        What is known of the pose from the matched points and the window, as the framework's design tells it: see
        `covariance_of` and `measure`.
    direction : float
        See `degenerate_direction`.
    """
    if lines is None or len(lines) != len(points):
        lines = scan_lines(points)
    return measure(
        surface.pieces, surface.tilts, surface.nearest, surface.frame, points, lines, pose, half, distance
    )


@kernel
def measure(
    pieces: NDArray[np.float64],
    tilts: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    pose: Pose,
    half: NDArray[np.float64],
    distance: float,
) -> tuple[float, NDArray[np.float64], float]:
    """See `assess`; the surface's arrays come first.

    The information of the matched points is the Gauss-Newton Hessian of their distances across their lines, over
    the variance of these. Two things make it too good. A line fitted to noisy returns is tilted, so that a plain
    corridor seems to fix the direction along it: what the tilts feign on average is taken off. And a pose that is
    not at the bottom, where a method gave up early or counts hits, is off by about the step that leads there:
    the square of that step is added to the covariance.
    """
    matched, variance, hessian, feigned, gradient = gather(
        pieces, tilts, nearest, frame, points, lines, pose, distance
    )
    information = deflate(hessian, feigned, SPURIOUS) / (variance * CORRELATION)
    covariance = covariance_of(information, half)
    direction = degenerate_direction(covariance, half)
    known = covariance_of(hessian / variance, half)
    step = np.empty(3)
    for a in range(3):
        step[a] = (
            known[a, 0] * gradient[0] + known[a, 1] * gradient[1] + known[a, 2] * gradient[2]
        ) / variance
    for a in range(3):
        for b in range(3):
            covariance[a, b] += step[a] * step[b]
    return matched / max(points.shape[0], 1), covariance, direction


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
def lies_on(
    pieces: NDArray[np.float64], k: int, x: float, y: float, nx: float, ny: float, distance: float
) -> bool:
    """Whether a point is within ``distance`` (m) of a segment, and of its side: its line's normal is ``(nx, ny)``."""
    if squared_distance(pieces, k, x, y) > distance * distance:
        return False
    return bool(pieces[k, 5] * nx + pieces[k, 6] * ny >= -LEAST_AGREEMENT)


@kernel
def explained(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    pose: Pose,
    distance: float,
) -> NDArray[np.bool_]:
    """Which of the points count for the score that `measure` gives, (N,)."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out = np.zeros(points.shape[0], dtype=np.bool_)
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        k = nearest_segment(nearest, frame, x, y)
        nx, ny = c * lines[i, 0] - s * lines[i, 1], s * lines[i, 0] + c * lines[i, 1]
        out[i] = k >= 0 and lies_on(pieces, k, x, y, nx, ny, distance)
    return out


@kernel
def gather(
    pieces: NDArray[np.float64],
    tilts: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    pose: Pose,
    distance: float,
) -> tuple[int, float, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Look at the points within ``distance`` of the surface, those of the other side of a wall left out.

    Returns
    -------
    matched : int
        How many they are.
    variance : float
        Of their distances across their lines (m^2), at least that of `RANGE_STD`.
    hessian : float64 (3, 3)
        Of half the sum of these distances' squares.
    feigned : float64 (3, 3)
        What of it the tilts of the lines add on average. That goes by the noise of the returns, which clutter that
        only one of the scans saw must not add to: it is told by the median of the distances, or by how far the
        returns of each line stray from it, where that is more (far returns may be noisier than most).
    gradient : float64 (3,)
        Of half the sum, downhill.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x0, y0 = pose[0], pose[1]
    matched = 0
    most = LARGEST_TILT / (RANGE_STD * RANGE_STD)
    squares = xx = xy = xt = yy = yt = tt = gx = gy = gt = 0.0
    by_noise, by_lines = np.zeros(4), np.zeros(4)
    counts = np.zeros(BINS, dtype=np.int64)
    for i in range(points.shape[0]):
        rx = c * points[i, 0] - s * points[i, 1]
        ry = s * points[i, 0] + c * points[i, 1]
        x, y = x0 + rx, y0 + ry
        k = nearest_segment(nearest, frame, x, y)
        nx, ny = c * lines[i, 0] - s * lines[i, 1], s * lines[i, 0] + c * lines[i, 1]
        if k < 0 or not lies_on(pieces, k, x, y, nx, ny, distance):
            continue
        nx, ny = pieces[k, 5], pieces[k, 6]
        matched += 1
        residual = nx * x + ny * y - pieces[k, 7]
        counts[min(int(abs(residual) / distance * BINS), BINS - 1)] += 1
        squares += min(residual * residual, distance * distance)
        nt = ny * rx - nx * ry
        xx += nx * nx
        xy += nx * ny
        xt += nx * nt
        yy += ny * ny
        yt += ny * nt
        tt += nt * nt
        gx -= nx * residual
        gy -= ny * residual
        gt -= nt * residual
        # A tilt with variance v turns n n' into (1 - v) n n' + v t t', with t along the line; what is to be taken
        # off is v (n n' + t t'), for then the mean of n n' (1 - v) - v t t' is (1 - 2 v) n n'.
        tilt = min(tilts[k, 0], most)
        for told, share in ((by_noise, tilt), (by_lines, tilt * tilts[k, 1])):
            told[0] += share
            told[1] -= share * ry
            told[2] += share * rx
            told[3] += share * (rx * rx + ry * ry)
    hessian = np.array([[xx, xy, xt], [xy, yy, yt], [xt, yt, tt]])
    variance = max(squares / max(matched, 1), RANGE_STD * RANGE_STD)
    deviation = median_of(counts, matched) * distance / BINS / MEDIAN
    by_noise *= min(max(deviation * deviation, RANGE_STD * RANGE_STD), variance)
    f = by_noise if by_noise[0] > by_lines[0] else by_lines
    feigned = np.array([[f[0], 0.0, f[1]], [0.0, f[0], f[2]], [f[1], f[2], f[3]]])
    return matched, variance, hessian, feigned, np.array([gx, gy, gt])
