"""Last step: every scan is matched once more, against all that was seen of its place, and its way smoothed.

While a run goes on a scan meets the submap of the moment; at the end there is a map, and it meets that.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher, MatchResult, Reference, SearchWindow
from hsslam.se2 import Points, Pose, Poses, between, compose
from hsslam.slam.factors import FLOOR_STD_THETA, FLOOR_STD_XY
from hsslam.slam.fusion import rotated
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.submap import merge
from hsslam.slam.windows import AGREEING, at_edge, difference, known_within

BLOCK = 4
"""Keyframes in a row whose scans are matched against the same submap."""

AWAY = (0.02, math.radians(1.0))
"""A match this far (m, rad) from where the scan was tracked is tried against a match right there."""

STAYING = (0.006, math.radians(0.5))
"""A match right there that is no further off than this (m, rad) confirms that the scan belongs there."""

STAYING_GAIN = 0.05
"""What was tracked and confirmed is given up only for a score that is this much higher."""


def surrounding(poses: Poses, first: int, last: int, radius: float, most: int) -> NDArray[np.int64]:
    """Numbers of the keyframes that saw what keyframes ``first`` to ``last`` saw.

    These themselves and the two on either side, then the nearest others within ``radius`` (m), ``most`` in all.
    """
    middle = poses[(first + last) // 2]
    low, high = max(first - 2, 0), min(last + 3, len(poses))
    own = np.arange(low, high)
    offsets = poses - middle
    turned = np.abs((offsets[:, 2] + math.pi) % (2 * math.pi) - math.pi)
    cost = np.hypot(offsets[:, 0], offsets[:, 1]) + 0.5 * turned
    cost[low:high] = np.inf
    others = np.argsort(cost, kind="stable")[: max(most - len(own), 0)]
    return np.sort(np.concatenate((own, others[cost[others] <= radius])))


def match_scans(
    config: Config,
    matcher: Matcher[Any],
    keyframe_points: Sequence[Points],
    poses: Poses,
    scans: Sequence[NDArray[np.float32]],
    anchors: NDArray[np.int64],
    relatives: Poses,
) -> tuple[Poses, NDArray[np.float64], NDArray[np.bool_]]:
    """Match every scan against the surroundings of the keyframe it hangs on.

    Parameters
    ----------
    config : Config
        Its ``graph`` section and its seed.
    matcher : Matcher
        The tracker's.
    keyframe_points, poses : sequence, Poses
        Of the keyframes, as optimised.
    scans : sequence of float32 (N_i, 2)
        Returns of every scan in the robot's frame (m).
    anchors : int64 (S,)
        Number of the keyframe each scan hangs on; ascending.
    relatives : Poses
        (S, 3) each scan seen from that keyframe.

    Returns
    -------
    (Poses (S, 3), float64 (S, 3, 3), bool (S,))
        Poses in the map, their covariances in the axes of the map, and which of them were matched.
    """
    rules = config.graph
    window = SearchWindow(
        rules.overlap_half_xy, rules.overlap_half_xy, math.radians(rules.overlap_half_theta_deg)
    )
    found = np.empty((len(scans), 3))
    covariances = np.zeros((len(scans), 3, 3))
    matched = np.zeros(len(scans), dtype=np.bool_)
    for first in range(0, len(poses), BLOCK):
        last = min(first + BLOCK, len(poses)) - 1
        start, stop = np.searchsorted(anchors, [first, last + 1])
        if start == stop:
            continue
        around = surrounding(poses, first, last, rules.overlap_radius, rules.rescan_keyframes)
        origin: Pose = poses[(first + last) // 2].copy()
        reference = matcher.prepare(merge([keyframe_points[k] for k in around], poses[around], origin))
        for i in range(start, stop):
            expected = compose(poses[anchors[i]], relatives[i])
            guess = between(origin, expected)
            rng = generator(config.seed, Purpose.SCAN, i)
            points = scans[i].astype(np.float64)
            result = matcher.match(reference, points, guess, window, rng)
            if _apart(result.pose, guess, AWAY):
                result = _unless_confirmed(matcher, reference, points, guess, window, result, rng)
            inside = not at_edge(difference(result.pose, guess), window)
            matched[i] = result.converged and inside and result.score >= rules.overlap_min_score
            found[i] = compose(origin, result.pose) if matched[i] else expected
            covariances[i] = rotated(result.covariance, -origin[2])
    return found, covariances, matched


def _unless_confirmed(
    matcher: Matcher[Any],
    reference: Reference,
    points: Points,
    tracked: Pose,
    window: SearchWindow,
    found: MatchResult,
    rng: np.random.Generator,
) -> MatchResult:
    """What was found, unless the scan fits about as well where it was tracked: people and clutter draw it away."""
    near = matcher.match(reference, points, tracked, AGREEING, rng)
    lower = near.score < found.score - STAYING_GAIN
    if not near.converged or lower or _apart(near.pose, tracked, STAYING):
        return found
    return known_within(matcher, window, reference, points, near)


def _apart(pose: Pose, other: Pose, least: tuple[float, float]) -> bool:
    """Whether two poses differ by more than a distance (m) or an angle (rad)."""
    x, y, theta = difference(pose, other)
    return math.hypot(x, y) > least[0] or abs(theta) > least[1]


def smooth(
    poses: Poses,
    covariances: NDArray[np.float64],
    matched: NDArray[np.bool_],
    motions: Poses,
    noises: NDArray[np.float64],
) -> Poses:
    """The most probable way of the robot, given where its scans were matched and how odometry says it moved.

    Parameters
    ----------
    poses, covariances, matched : Poses (S, 3), float64 (S, 3, 3), bool (S,)
        As `match_scans` returns them; poses that were not matched are where the iteration starts, no more.
    motions, noises : Poses (S, 3), float64 (S, 3, 3)
        Motion from the scan before to each scan, in the frame of the scan before, and its covariance in the
        frame of the scan itself.

    Returns
    -------
    Poses
        (S, 3)
    """
    import gtsam

    graph = gtsam.NonlinearFactorGraph()
    values = gtsam.Values()
    loss = gtsam.noiseModel.mEstimator.Cauchy.Create(2.0)
    floor = np.diag([FLOOR_STD_XY**2, FLOOR_STD_XY**2, FLOOR_STD_THETA**2])
    for i, pose in enumerate(poses):
        here = gtsam.Pose2(*pose)
        values.insert(i, here)
        if matched[i] or i == 0:
            noise = gtsam.noiseModel.Gaussian.Covariance(rotated(covariances[i], pose[2]) + floor)
            graph.add(gtsam.PriorFactorPose2(i, here, noise))
        if i > 0:
            noise = gtsam.noiseModel.Gaussian.Covariance(noises[i])
            robust = gtsam.noiseModel.Robust.Create(loss, noise)
            graph.add(gtsam.BetweenFactorPose2(i - 1, i, gtsam.Pose2(*motions[i]), robust))
    solution = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    out: Poses = np.ascontiguousarray(gtsam.utilities.extractPose2(solution))
    return out
