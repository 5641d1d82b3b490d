"""Last step: every scan is matched once more, against all that was seen of its place.

While a run goes on a scan meets the submap of the moment; at the end there is a map, and it meets that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher, Reference, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose, Poses, between_many, compose_many
from hsslam.slam.fusion import rotated
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.scan_table import ScanTable
from hsslam.slam.side_by_side import side_by_side, threads_for
from hsslam.slam.windows import AGREEING, at_edges, differences, known_within, overlap_window

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


def surrounding(
    poses: Poses, sessions: NDArray[np.int64], first: int, last: int, radius: float, most: int
) -> NDArray[np.int64]:
    """Numbers of the keyframes that saw what keyframes ``first`` to ``last`` saw.

    These themselves and the two on either side, then the nearest others within ``radius`` (m), ``most`` in all, as far
    as they are of the same session (K,) as ``first``.
    """
    middle = poses[(first + last) // 2]
    low, high = max(first - 2, 0), min(last + 3, len(poses))
    own = np.arange(low, high)
    offsets = poses - middle
    turned = np.abs((offsets[:, 2] + math.pi) % (2 * math.pi) - math.pi)
    cost = np.hypot(offsets[:, 0], offsets[:, 1]) + 0.5 * turned
    cost[low:high] = np.inf
    cost[sessions != sessions[first]] = np.inf
    own = own[sessions[own] == sessions[first]]
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
    keyframes: Keyframes,
    scans: ScanTable,
    wanted: NDArray[np.bool_],
) -> tuple[Poses, NDArray[np.float64], NDArray[np.bool_]]:
    """Match scans against the surroundings of the keyframes they hang on.

    Parameters
    ----------
    config : Config
        Its ``graph`` section and its seed.
    matcher : Matcher
        The tracker's.
    keyframes : Keyframes
        As optimised.
    scans : ScanTable
        Their points, and where each was tracked.
    wanted : bool (S,)
        Which of them to match; the others stay where they are.

    Returns
    -------
    (Poses (S, 3), float64 (S, 3, 3), bool (S,))
        Poses in the map, their covariances in the axes of the map, and which of them were matched.
    """
    rules = config.graph
    window = overlap_window(rules)
    poses, sessions, anchors = keyframes.poses, keyframes.sessions.numbers, scans.anchors
    found = compose_many(poses[anchors], scans.relatives)
    covariances = np.zeros((len(scans), 3, 3))
    matched = np.zeros(len(scans), dtype=np.bool_)

    def match_block(number: int) -> None:
        first, last = blocks[number]
        start, stop = np.searchsorted(anchors, [first, last + 1])
        chosen = start + np.flatnonzero(wanted[start:stop])
        if not len(chosen):
            return
        around = surrounding(poses, sessions, first, last, rules.overlap_radius, rules.rescan_keyframes)
        origin: Pose = poses[(first + last) // 2].copy()
        origins = np.tile(origin, (len(chosen), 1))
        reference = matcher.prepare(keyframes.submap(around, origin))
        guesses, rng = between_many(origins, found[chosen]), generator(config.seed, Purpose.SCAN, first)
        points = [scans.points[i].astype(np.float64) for i in chosen]
        results = matcher.match_many(reference, points, guesses, window, rng)
        for k in np.flatnonzero(_apart(results.poses, guesses, AWAY)).tolist():
            near = _confirmed(matcher, reference, points[k], guesses[k], window, results.scores[k], rng)
            if near is not None:
                results.put(k, near)
        good = results.converged & (results.scores >= rules.overlap_min_score)
        good &= ~at_edges(differences(results.poses, guesses), window)
        matched[chosen] = good
        found[chosen[good]] = compose_many(origins, results.poses)[good]
        covariances[chosen] = [rotated(covariance, -origin[2]) for covariance in results.covariances]

    blocks = _blocks(sessions)
    for _ in side_by_side(match_block, len(blocks), threads_for(matcher, rules.threads)):
        pass
    return found, covariances, matched


def _blocks(sessions: NDArray[np.int64]) -> list[tuple[int, int]]:
    """The first and the last of every `BLOCK` keyframes in a row that are of one session."""
    starts = np.flatnonzero(np.diff(sessions, prepend=-1)).tolist()
    rows = zip(starts, [*starts[1:], len(sessions)], strict=True)
    return [(i, min(i + BLOCK, stop) - 1) for start, stop in rows for i in range(start, stop, BLOCK)]


def _confirmed(
    matcher: Matcher[Any],
    reference: Reference,
    points: Points,
    tracked: Pose,
    window: SearchWindow,
    score: float,
    rng: np.random.Generator,
) -> MatchResult | None:
    """A match right where the scan was tracked, if it confirms that and fits about as well as ``score``.

    People and clutter draw a scan away.
    """
    near = matcher.match(reference, points, tracked, AGREEING, rng)
    lower = near.score < score - STAYING_GAIN
    if not near.converged or lower or _apart(near.pose[None], tracked[None], STAYING)[0]:
        return None
    return known_within(matcher, window, reference, points, near)


def _apart(poses: Poses, others: Poses, least: tuple[float, float]) -> NDArray[np.bool_]:
    """Which poses (N, 3) differ from others by more than a distance (m) or an angle (rad), (N,)."""
    off = differences(poses, others)
    return (np.hypot(off[:, 0], off[:, 1]) > least[0]) | (np.abs(off[:, 2]) > least[1])
