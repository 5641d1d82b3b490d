"""Covariances of poses in the plane: turned into other frames, and weighed against each other."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Pose, wrap

GATE = 16.27
"""Chi-square of 3 degrees of freedom, 99.9 %: two estimates further apart contradict each other."""

GATE_ALONG = 10.83
"""Chi-square of 1 degree of freedom, 99.9 %."""


@kernel
def rotated(covariance: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """A covariance (3, 3) of a pose, in a frame that is turned by ``angle`` (rad) against the old one."""
    c, s = math.cos(angle), math.sin(angle)
    xx, xy, yy = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    xt, yt = covariance[0, 2], covariance[1, 2]
    out = np.empty((3, 3))
    out[0, 0] = c * c * xx + 2.0 * c * s * xy + s * s * yy
    out[1, 1] = s * s * xx - 2.0 * c * s * xy + c * c * yy
    out[0, 1] = out[1, 0] = c * s * (yy - xx) + (c * c - s * s) * xy
    out[0, 2] = out[2, 0] = c * xt + s * yt
    out[1, 2] = out[2, 1] = c * yt - s * xt
    out[2, 2] = covariance[2, 2]
    return out


@kernel
def inverse3(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of a symmetric positive definite (3, 3) matrix."""
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
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
def squared_mahalanobis(deviation: Pose, covariance: NDArray[np.float64]) -> float:
    """Squared length of a deviation (3,) in standard deviations."""
    information = inverse3(covariance)
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += deviation[i] * information[i, j] * deviation[j]
    return total


@kernel
def fuse(
    predicted: Pose, prior: NDArray[np.float64], matched: Pose, covariance: NDArray[np.float64]
) -> tuple[Pose, NDArray[np.float64]]:
    """Weigh two estimates of a pose by their covariances: a Kalman update.

    Parameters
    ----------
    predicted, matched : Pose
        In one frame.
    prior, covariance : float64 (3, 3)
        Of the one and of the other.

    Returns
    -------
    (Pose, float64 (3, 3))
        The weighed pose and its covariance; where the two contradict each other what `along_the_open` says.
    """
    innovation = matched - predicted
    innovation[2] = wrap(innovation[2])
    information = inverse3(prior + covariance)
    distance = 0.0
    for i in range(3):
        for j in range(3):
            distance += innovation[i] * information[i, j] * innovation[j]
    if distance > GATE:
        return along_the_open(predicted, prior, matched, covariance)
    pose = predicted.copy()
    out = prior.copy()
    gain = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                gain[i, j] += prior[i, k] * information[k, j]
    for i in range(3):
        for j in range(3):
            pose[i] += gain[i, j] * innovation[j]
            for k in range(3):
                out[i, j] -= gain[i, k] * prior[k, j]
    pose[2] = wrap(pose[2])
    for i in range(3):
        for j in range(i):
            out[i, j] = out[j, i] = 0.5 * (out[i, j] + out[j, i])
    return pose, out


@kernel
def along_the_open(
    predicted: Pose, prior: NDArray[np.float64], matched: Pose, covariance: NDArray[np.float64]
) -> tuple[Pose, NDArray[np.float64]]:
    """Make one of two estimates that contradict each other: the matched one, moved along its long axis if that is open.

    A corridor may deny odometry's heading, and knows nothing of the place along it: there odometry has a say, if it
    knows more of that than the match does, and the two agree on it.

    Parameters
    ----------
    predicted, prior, matched, covariance
        As for `fuse`.

    Returns
    -------
    (Pose, float64 (3, 3))
        ``matched``, updated with the predicted pose's coordinate along the long axis of its covariance.
    """
    a, b, d = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    angle = 0.5 * math.atan2(2.0 * b, a - d)
    ux, uy = math.cos(angle), math.sin(angle)
    known = ux * ux * prior[0, 0] + 2.0 * ux * uy * prior[0, 1] + uy * uy * prior[1, 1]
    left = ux * ux * a + 2.0 * ux * uy * b + uy * uy * d
    off = ux * (predicted[0] - matched[0]) + uy * (predicted[1] - matched[1])
    pose, out = matched.copy(), covariance.copy()
    if known >= left or off * off > GATE_ALONG * (known + left):
        return pose, out
    along = np.empty(3)
    for i in range(3):
        along[i] = covariance[i, 0] * ux + covariance[i, 1] * uy
    for i in range(3):
        pose[i] += along[i] * off / (known + left)
        for j in range(3):
            out[i, j] -= along[i] * along[j] / (known + left)
    pose[2] = wrap(pose[2])
    return pose, out


@kernel
def is_positive_definite(matrix: NDArray[np.float64]) -> bool:
    """Whether a symmetric (3, 3) matrix is finite and positive definite (Sylvester's criterion)."""
    if not np.isfinite(matrix).all():
        return False
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 1], matrix[1, 2], matrix[2, 2]
    second = a * d - b * b
    third = a * (d * f - e * e) - b * (b * f - e * c) + c * (b * e - d * c)
    return bool(a > 0.0 and second > 0.0 and third > 0.0)


def largest_variance(covariance: NDArray[np.float64]) -> float:
    """Variance of the position along the direction in which it is least known (m^2), of a (3, 3) covariance."""
    mean = 0.5 * (covariance[0, 0] + covariance[1, 1])
    return float(mean + math.hypot(0.5 * (covariance[0, 0] - covariance[1, 1]), covariance[0, 1]))


def of_inverse(covariance: NDArray[np.float64], pose: Pose) -> NDArray[np.float64]:
    """Covariance (3, 3) of the inverse of a pose that has a given one: the first seen from the second."""
    x, y, theta = pose
    c, s = math.cos(theta), math.sin(theta)
    change = np.array([[-c, -s, s * x - c * y], [s, -c, c * x + s * y], [0.0, 0.0, -1.0]])
    inverted: NDArray[np.float64] = change @ covariance @ change.T
    return inverted


def share_left(prior: NDArray[np.float64], posterior: NDArray[np.float64]) -> float:
    """Share of a position's variance along the direction in which it is least known that an update left: 1 for none.

    Both covariances are (3, 3), in one frame; the direction is the posterior's.
    """
    a, b, d = float(posterior[0, 0]), float(posterior[0, 1]), float(posterior[1, 1])
    angle = 0.5 * math.atan2(2.0 * b, a - d)
    along = np.array([math.cos(angle), math.sin(angle), 0.0])
    return float((along @ posterior @ along) / (along @ prior @ along))
