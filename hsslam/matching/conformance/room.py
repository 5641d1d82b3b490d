"""A small synthetic room, seen from two places: what the checks match."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Points, Pose, Poses

WALLS = np.array(
    [
        # ax, ay, bx, by (m): no turn and no shift maps the room onto itself.
        [-2.5, -2.2, 5.0, -2.2],
        [5.0, -2.2, 5.0, 1.6],
        [5.0, 1.6, 3.6, 2.8],
        [3.6, 2.8, 0.8, 2.8],
        [0.8, 2.8, 0.8, 2.0],
        [0.8, 2.0, -2.5, 2.0],
        [-2.5, 2.0, -2.5, -2.2],
        [1.8, -2.2, 1.8, -1.4],
        [1.8, -1.4, 2.7, -1.4],
        [2.7, -1.4, 2.7, -2.2],
        [3.2, 0.2, 3.6, 0.6],
    ]
)

RANGE_NOISE = 0.005
"""Standard deviation of a range (m)."""


@dataclass(frozen=True, eq=False)
class RoomPair:
    """Two scans of the room, and where the second was taken.

    Parameters
    ----------
    reference, scan : Points
        (N, 2) m, each in the frame of its own sensor, in beam order.
    truth : Pose
        Of the second sensor in the frame of the first.
    """

    reference: Points
    scan: Points
    truth: Pose


def room_pair(seed: int = 0, beams: int = 240) -> RoomPair:
    """Scan the room twice over 240 degrees, the second time from a place drawn from ``seed``."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3))
    return RoomPair(scan_room(np.zeros(3), beams, rng), scan_room(truth, beams, rng), truth)


def guesses(truth: Pose, half: NDArray[np.float64], count: int, seed: int = 0) -> Poses:
    """Draw (count, 3) guesses around the truth, uniform in four fifths of a box of half sides ``half``."""
    return truth + 0.8 * np.random.default_rng(seed).uniform(-half, half, (count, 3))


def scan_room(pose: Pose, beams: int, rng: np.random.Generator) -> Points:
    """Points (beams, 2) of a scan at ``pose``, in its own frame, with noise along the beams."""
    angles = np.linspace(-np.pi * 2.0 / 3.0, np.pi * 2.0 / 3.0, beams)
    ranges = cast_rays(pose, angles) + rng.normal(0.0, RANGE_NOISE, beams)
    return np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles)))


def cast_rays(pose: Pose, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Exact ranges (m) from ``pose`` to the nearest wall along ``angles`` (rad, from the pose's heading)."""
    dx, dy = np.cos(pose[2] + angles)[:, None], np.sin(pose[2] + angles)[:, None]
    start, along = WALLS[:, :2] - pose[:2], WALLS[:, 2:] - WALLS[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * along[:, 1] - dy * along[:, 0]
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * dy - start[:, 1] * dx) / cross
    ahead = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    nearest: NDArray[np.float64] = np.where(ahead, distance, np.inf).min(axis=1)
    return nearest
