"""What the plugins over 3D point-cloud libraries share: planar input in, planar pose out, window kept."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hsslam.matching import MatcherConfig, Points, Pose


class LocalConfig(MatcherConfig):
    """Parameters of a method that starts at the guess and knows no window."""

    window_slack: float = Field(
        default=0.2,
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
