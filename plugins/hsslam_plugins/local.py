"""What the plugins over 3D point-cloud libraries share: planar input in, planar pose out, window kept."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hsslam.matching import MatcherConfig, Points, Pose, SearchWindow


class LocalConfig(MatcherConfig):
    """Parameters of a method that starts at the guess and knows no window."""

    window_slack: float = Field(
        0.2,
        ge=0.0,
        le=1.0,
        description="an answer outside the search window by up to this share of its half sides is moved onto "
        "its edge (noise alone carries a truth near the edge across it); one further out is rejected",
    )


def in_space(points: Points) -> NDArray[np.float64]:
    """(N, 2) points of the plane as (N, 3) points with z = 0."""
    return np.column_stack((points, np.zeros(len(points))))


def transformation(pose: Pose) -> NDArray[np.float64]:
    """Make the (4, 4) matrix of a pose of the plane."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    out = np.eye(4)
    out[:2, :2] = (c, -s), (s, c)
    out[:2, 3] = pose[:2]
    return out


def planar_pose(matrix: NDArray[np.float64]) -> Pose:
    """Read the pose off the (4, 4) matrix of a motion in the plane."""
    return np.array([matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])])


def keep_in_window(pose: Pose, guess: Pose, window: SearchWindow, slack: float) -> Pose:
    """Move a pose that is just outside the window onto its edge; leave any other pose as it is.

    Parameters
    ----------
    pose, guess : Pose
        The answer, and the window's centre.
    window : SearchWindow
        Where the answer must be.
    slack : float
        How far outside counts as just outside, as a share of the half sides.
    """
    offset = pose - guess
    offset[2] = (offset[2] + math.pi) % (2.0 * math.pi) - math.pi
    if not (np.abs(offset) <= (1.0 + slack) * window.half).all():
        return pose
    return guess + np.clip(offset, -window.half, window.half)
