"""Last step: every scan is matched once more, against all that was seen of its place.

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
from hsslam.se2 import Points, Pose, Poses, between, compose, compose_many
from hsslam.slam.fusion import rotated
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.submap import merge
from hsslam.slam.windows import AGREEING, at_edge, difference, known_within, overlap_window

BLOCK = 4
"""Keyframes in a row whose scans are matched against the same submap."""

AWAY = (0.02, math.radians(1.0))
"""A match this far (m, rad) from where the scan was tracked is tried against a match right there."""

STAYING = (0.006, math.radians(0.5))
"""A match right there that is no further off than this (m, rad) confirms that the scan belongs there."""

STAYING_GAIN = 0.05
"""What was tracked and confirmed is given up only for a score that is this much higher."""

ENOUGH_PARTNERS = 2
"""Scans that were matched with this many others need the map less."""


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


def worth_a_match(anchors: NDArray[np.int64], partners: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which scans to match against the map: keyframes', every other one, and those that few others tell of.

    What lies between two scans that the map holds in place, and is tied to keyframes on either side, is held as well:
    Intel and CSAIL lose 0.03 mm.

    Parameters
    ----------
    anchors : int64 (S,)
        Number of the keyframe each scan hangs on.
    partners : int64 (S,)
        How many other scans each was matched with.
    """
    keyframes = np.diff(anchors, prepend=-1) > 0
    wanted: NDArray[np.bool_] = keyframes | (np.arange(len(anchors)) % 2 == 1) | (partners < ENOUGH_PARTNERS)
    return wanted


def match_scans(
    config: Config,
    matcher: Matcher[Any],
    keyframe_points: Sequence[Points],
    poses: Poses,
    scans: Sequence[NDArray[np.float32]],
    anchors: NDArray[np.int64],
    relatives: Poses,
    wanted: NDArray[np.bool_],
) -> tuple[Poses, NDArray[np.float64], NDArray[np.bool_]]:
    """Match scans against the surroundings of the keyframes they hang on.

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
    wanted : bool (S,)
        Which of them to match; the others stay where they are.

    Returns
    -------
    (Poses (S, 3), float64 (S, 3, 3), bool (S,))
        Poses in the map, their covariances in the axes of the map, and which of them were matched.
    """
    rules = config.graph
    window = overlap_window(rules)
    found = compose_many(poses[anchors], relatives)
    covariances = np.zeros((len(scans), 3, 3))
    matched = np.zeros(len(scans), dtype=np.bool_)
    for first in range(0, len(poses), BLOCK):
        last = min(first + BLOCK, len(poses)) - 1
        start, stop = np.searchsorted(anchors, [first, last + 1])
        chosen = start + np.flatnonzero(wanted[start:stop])
        if not len(chosen):
            continue
        around = surrounding(poses, first, last, rules.overlap_radius, rules.rescan_keyframes)
        origin: Pose = poses[(first + last) // 2].copy()
        reference = matcher.prepare(merge([keyframe_points[k] for k in around], poses[around], origin))
        for i in chosen.tolist():
            guess = between(origin, found[i])
            rng = generator(config.seed, Purpose.SCAN, i)
            points = scans[i].astype(np.float64)
            result = matcher.match(reference, points, guess, window, rng)
            if _apart(result.pose, guess, AWAY):
                result = _unless_confirmed(matcher, reference, points, guess, window, result, rng)
            inside = not at_edge(difference(result.pose, guess), window)
            matched[i] = result.converged and inside and result.score >= rules.overlap_min_score
            if matched[i]:
                found[i] = compose(origin, result.pose)
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
