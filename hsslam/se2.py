"""Poses in the plane.

A pose is ``(x, y, theta)``: metres, metres, radians, ``theta`` in [-pi, pi). Pose ``b`` given in the frame of
pose ``a`` is written ``compose(a, b)`` in the frame in which ``a`` is given. The functions on one pose are
kernels, so other kernels may call them; the ``*_many`` functions work on (N, 3) arrays row by row.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

Pose: TypeAlias = NDArray[np.float64]
"""float64 (3,): x (m), y (m), theta (rad)."""

Poses: TypeAlias = NDArray[np.float64]
"""float64 (N, 3): one pose a row."""

Points: TypeAlias = NDArray[np.float64]
"""float64 (N, 2): x, y in metres."""


@kernel
def wrap(theta: float) -> float:
    """Bring an angle (rad) into [-pi, pi)."""
    wrapped = (theta + math.pi) % (2.0 * math.pi) - math.pi
    # The sum may round up to 2 pi for a tiny negative argument, whose remainder then reads as +pi.
    return wrapped if wrapped < math.pi else -math.pi


@kernel
def compose(a: Pose, b: Pose) -> Pose:
    """Pose ``b``, given in the frame of ``a``, in the frame in which ``a`` is given."""
    c, s = math.cos(a[2]), math.sin(a[2])
    out = np.empty(3)
    out[0] = a[0] + c * b[0] - s * b[1]
    out[1] = a[1] + s * b[0] + c * b[1]
    out[2] = wrap(a[2] + b[2])
    return out


@kernel
def inverse(a: Pose) -> Pose:
    """The pose that undoes ``a``: ``compose(a, inverse(a))`` is the origin."""
    c, s = math.cos(a[2]), math.sin(a[2])
    out = np.empty(3)
    out[0] = -(c * a[0] + s * a[1])
    out[1] = s * a[0] - c * a[1]
    out[2] = wrap(-a[2])
    return out


@kernel
def between(a: Pose, b: Pose) -> Pose:
    """Pose ``b`` seen from ``a``: ``compose(a, between(a, b))`` is ``b``."""
    c, s = math.cos(a[2]), math.sin(a[2])
    dx, dy = b[0] - a[0], b[1] - a[1]
    out = np.empty(3)
    out[0] = c * dx + s * dy
    out[1] = -s * dx + c * dy
    out[2] = wrap(b[2] - a[2])
    return out


@kernel
def interpolate(a: Pose, b: Pose, t: float) -> Pose:
    """The pose at share ``t`` of the way from ``a`` (0) to ``b`` (1), turning the short way round.

    Position and heading are interpolated apart; beyond [0, 1] the motion is extrapolated.
    """
    out = np.empty(3)
    out[0] = a[0] + t * (b[0] - a[0])
    out[1] = a[1] + t * (b[1] - a[1])
    out[2] = wrap(a[2] + t * wrap(b[2] - a[2]))
    return out


@kernel
def transform(pose: Pose, points: Points) -> Points:
    """Points (N, 2), given in the frame of ``pose``, in the frame in which ``pose`` is given."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out = np.empty((points.shape[0], 2))
    for i in range(points.shape[0]):
        out[i, 0] = pose[0] + c * points[i, 0] - s * points[i, 1]
        out[i, 1] = pose[1] + s * points[i, 0] + c * points[i, 1]
    return out


@kernel
def compose_many(a: Poses, b: Poses) -> Poses:
    """`compose` row by row: (N, 3) and (N, 3) to (N, 3)."""
    out = np.empty_like(a)
    for i in range(a.shape[0]):
        out[i] = compose(a[i], b[i])
    return out


@kernel
def inverse_many(a: Poses) -> Poses:
    """`inverse` row by row: (N, 3) to (N, 3)."""
    out = np.empty_like(a)
    for i in range(a.shape[0]):
        out[i] = inverse(a[i])
    return out


@kernel
def between_many(a: Poses, b: Poses) -> Poses:
    """`between` row by row: (N, 3) and (N, 3) to (N, 3)."""
    out = np.empty_like(a)
    for i in range(a.shape[0]):
        out[i] = between(a[i], b[i])
    return out


@kernel
def interpolate_many(a: Poses, b: Poses, t: NDArray[np.float64]) -> Poses:
    """`interpolate` row by row: (N, 3), (N, 3) and (N,) to (N, 3)."""
    out = np.empty_like(a)
    for i in range(a.shape[0]):
        out[i] = interpolate(a[i], b[i], t[i])
    return out


def pose(x: float, y: float, theta: float) -> Pose:
    """Build a pose from metres and radians; ``theta`` is wrapped."""
    return np.array([x, y, wrap(theta)], dtype=np.float64)


def matrix(a: Pose) -> NDArray[np.float64]:
    """The (3, 3) homogeneous matrix of a pose."""
    c, s = math.cos(a[2]), math.sin(a[2])
    return np.array([[c, -s, a[0]], [s, c, a[1]], [0.0, 0.0, 1.0]])


def from_matrix(m: NDArray[np.float64]) -> Pose:
    """The pose of a (3, 3) homogeneous matrix."""
    return pose(float(m[0, 2]), float(m[1, 2]), math.atan2(float(m[1, 0]), float(m[0, 0])))
