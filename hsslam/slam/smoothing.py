"""Last of all: the most probable way of the robot through everything that is known of its scans."""

from __future__ import annotations

from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Poses
from hsslam.slam.factors import FLOOR_STD_THETA, FLOOR_STD_XY, pose2
from hsslam.slam.fusion import rotated
from hsslam.slam.scan_pairs import ScanPairs

ROBUST_SCALE = 2.0
"""Scale of the Cauchy loss (standard deviations)."""

TOLERANCE = 1e-4
"""The iteration ends when the error shrinks by less than this share: no pose moves by more than 2 mm after that."""


def smooth(
    poses: Poses,
    covariances: NDArray[np.float64],
    matched: NDArray[np.bool_],
    pairs: ScanPairs,
    motions: Poses,
    noises: NDArray[np.float64],
) -> Poses:
    """The most probable way of the robot, given where its scans were matched and how odometry says it moved.

    All of it under a Cauchy loss but the first pose, which holds the frame: a scan that the map drew away is
    outvoted by those before and after it.

    Parameters
    ----------
    poses, covariances, matched : Poses (S, 3), float64 (S, 3, 3), bool (S,)
        As `hsslam.slam.rescan.match_scans` returns them; poses that were not matched are where the iteration
        starts, no more.
    pairs : ScanPairs
        Scans matched against scans.
    motions, noises : Poses (S, 3), float64 (S, 3, 3)
        Motion from the scan before to each scan, in the frame of the scan before, and its covariance in the
        frame of the scan itself.

    Returns
    -------
    Poses
        (S, 3)
    """
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    loss = gtsam.noiseModel.mEstimator.Cauchy.Create(ROBUST_SCALE)
    floor = np.diag([FLOOR_STD_XY**2, FLOOR_STD_XY**2, FLOOR_STD_THETA**2])

    def robust(covariance: NDArray[np.float64]) -> Any:
        return gtsam.noiseModel.Robust.Create(loss, gtsam.noiseModel.Gaussian.Covariance(covariance))

    for i, pose in enumerate(poses):
        here = pose2(pose)
        values.insert(i, here)
        known = rotated(covariances[i], pose[2]) + floor
        if i == 0:
            graph.add(gtsam.PriorFactorPose2(i, here, gtsam.noiseModel.Gaussian.Covariance(known)))
            continue
        if matched[i]:
            graph.add(gtsam.PriorFactorPose2(i, here, robust(known)))
        graph.add(gtsam.BetweenFactorPose2(i - 1, i, pose2(motions[i]), robust(noises[i])))
    for first, second, relative, covariance in pairs:
        noise = robust(rotated(covariance, relative[2]) + floor)
        graph.add(gtsam.BetweenFactorPose2(first, second, pose2(relative), noise))
    rules = gtsam.LevenbergMarquardtParams()
    rules.setRelativeErrorTol(TOLERANCE)
    solution = gtsam.LevenbergMarquardtOptimizer(graph, values, rules).optimize()
    out: Poses = np.ascontiguousarray(gtsam.utilities.extractPose2(solution))
    return out
