"""Constraints and poses as GTSAM wants them, checked as GTSAM does not."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from hsslam.errors import HsslamError
from hsslam.se2 import Pose, compose
from hsslam.slam.events import Edge
from hsslam.slam.fusion import is_positive_definite, rotated

PRIOR_STD = 1e-4
"""Of the first keyframe (m, rad): it defines the frame of the map."""

FLOOR_STD_XY = 0.004
FLOOR_STD_THETA = math.radians(0.1)
"""No relative pose is trusted beyond this: errors that matches share do not show in their covariances."""


class GraphError(HsslamError):
    """A constraint or a solution is unusable."""


def body_covariance(edge: Edge) -> NDArray[np.float64]:
    """Covariance (3, 3) of an edge as GTSAM wants it: in the frame of the second pose, with a floor.

    Raises
    ------
    GraphError
        If the edge's pose is not finite, or its covariance not finite and positive definite; GTSAM itself
        accepts both without a word.
    """
    covariance = edge.covariance
    if not np.isfinite(edge.relative).all():
        raise GraphError(f"the constraint between keyframes {edge.first} and {edge.second} is not finite")
    if not is_positive_definite(covariance):
        raise GraphError(
            f"the covariance of the constraint between keyframes {edge.first} and {edge.second} "
            "is not positive definite"
        )
    turned = rotated(covariance, edge.relative[2])
    turned[0, 0] += FLOOR_STD_XY**2
    turned[1, 1] += FLOOR_STD_XY**2
    turned[2, 2] += FLOOR_STD_THETA**2
    return turned


def between_factor(edge: Edge, robust_scale: float | None) -> Any:
    """The factor of an edge; with a Cauchy loss of that scale, unless it is None or the edge is odometry."""
    noise = _noise(edge, robust_scale)
    return gtsam.BetweenFactorPose2(edge.first, edge.second, pose2(edge.relative), noise)


def pull_factor(edge: Edge, first: Pose, robust_scale: float | None) -> Any:
    """The factor of an edge whose first pose is not to move: it pulls at the second alone."""
    noise = _noise(edge, robust_scale)
    return gtsam.PriorFactorPose2(edge.second, pose2(compose(first, edge.relative)), noise)


def prior_factor(start: Pose) -> Any:
    """The factor that holds keyframe 0 where it is."""
    return gtsam.PriorFactorPose2(0, pose2(start), gtsam.noiseModel.Isotropic.Sigma(3, PRIOR_STD))


def pose2(pose: Pose) -> Any:
    """A pose of GTSAM's."""
    return gtsam.Pose2(pose[0], pose[1], pose[2])


@cache
def _cauchy(scale: float) -> Any:
    return gtsam.noiseModel.mEstimator.Cauchy.Create(scale)


def _noise(edge: Edge, robust_scale: float | None) -> Any:
    noise: Any = gtsam.noiseModel.Gaussian.Covariance(body_covariance(edge))
    if robust_scale is not None and edge.kind != "odometry":
        noise = gtsam.noiseModel.Robust.Create(_cauchy(robust_scale), noise)
    return noise
