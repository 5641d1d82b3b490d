"""Final refinement: keyframes that see the same place are matched again from the optimised poses.

As Lu and Milios (1997) did: once the graph is nearly right, every overlapping pair is worth a constraint, not
only consecutive keyframes and loops.
"""

from __future__ import annotations

import math
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.jit import kernel
from hsslam.matching.interface import Matcher
from hsslam.se2 import Poses, between_many, wrap
from hsslam.slam.events import Edge
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.side_by_side import side_by_side, threads_for
from hsslam.slam.windows import overlap_window

SPREAD = 2
"""Keyframes between two that are matched with the same third, at least: neighbours in time tell the same."""


def overlapping_pairs(
    poses: Poses, radius: float, neighbours: int, sessions: NDArray[np.int64] | None = None
) -> list[tuple[int, int]]:
    """Pairs ``first < second`` of keyframes within ``radius`` (m): up to ``neighbours`` earlier ones of each.

    Only those of the same session (K,), where there are several.

    The nearest come first; of keyframes that follow one another only every other is taken, so that all visits
    to a place are tied together. Consecutive keyframes are no pair: they have a constraint.
    """
    one = np.zeros(len(poses), dtype=np.int64) if sessions is None else sessions
    by_x = np.argsort(poses[:, 0], kind="stable")
    pairs = nearest_apart(poses, by_x, one, radius, neighbours, SPREAD)
    return sorted(zip(pairs[:, 0].tolist(), pairs[:, 1].tolist(), strict=True))


@kernel
def nearest_apart(
    poses: Poses,
    by_x: NDArray[np.int64],
    sessions: NDArray[np.int64],
    radius: float,
    most: int,
    spread: int,
) -> NDArray[np.int64]:
    """Pairs (P, 2), in the order of their second: ``most`` of each at most, no two firsts of it nearer than ``spread``.

    ``by_x`` tells the order of the poses by x. One second at a time: of a place that was visited n times there are
    n squared pairs, too many to hold.
    """
    count = poses.shape[0]
    sorted_x = poses[by_x, 0]
    pairs = np.empty((count * most, 2), dtype=np.int64)
    found = 0
    for second in range(count):
        x, y, theta = poses[second, 0], poses[second, 1], poses[second, 2]
        low = np.searchsorted(sorted_x, x - radius)
        high = np.searchsorted(sorted_x, x + radius, side="right")
        near = np.sort(by_x[low:high])
        costs = np.empty(len(near))
        kept = 0
        for first in near:
            if first >= second - 1:
                break
            distance = math.hypot(poses[first, 0] - x, poses[first, 1] - y)
            if distance <= radius and sessions[first] == sessions[second]:
                near[kept] = first
                costs[kept] = distance + 0.5 * abs(wrap(poses[first, 2] - theta))
                kept += 1
        begin = found
        for k in np.argsort(costs[:kept], kind="mergesort"):
            if found - begin == most:
                break
            free = True
            for taken in pairs[begin:found, 0]:
                free = free and abs(taken - near[k]) >= spread
            if free:
                pairs[found, 0], pairs[found, 1] = near[k], second
                found += 1
    return pairs[:found]


def match_pairs(
    config: Config,
    matcher: Matcher[Any],
    keyframes: Keyframes,
    pairs: list[tuple[int, int]],
    stage: int,
) -> list[Edge]:
    """Match each pair from its current relative pose; constraints that were found are returned.

    The pairs, sorted, are matched side by side where the matcher can.
    """
    rules, points, poses = config.graph, keyframes.points, keyframes.poses
    window = overlap_window(rules)
    groups = [(first, [pair[1] for pair in group]) for first, group in groupby(pairs, itemgetter(0))]

    def matched(number: int) -> list[Edge]:
        first, seconds = groups[number]
        reference = matcher.prepare(points[first])
        guesses = between_many(np.tile(poses[first], (len(seconds), 1)), poses[seconds])
        rng = generator(config.seed, Purpose.OVERLAP, stage, first)
        found = matcher.match_many(reference, [points[second] for second in seconds], guesses, window, rng)
        good = found.converged & (found.scores >= rules.overlap_min_score)
        return [
            Edge(first, seconds[i], found.poses[i], found.covariances[i], "overlap")
            for i in np.flatnonzero(good).tolist()
        ]

    threads = threads_for(matcher, rules.threads)
    return [edge for edges in side_by_side(matched, len(groups), threads) for edge in edges]


def moved(pairs: list[tuple[int, int]], before: Poses, after: Poses) -> float:
    """Mean distance by which keyframes moved, seen from those that they overlap (m); 0 without pairs.

    A turn of the whole map, which no constraint but the first keyframe's minds, is no motion.
    """
    if not pairs:
        return 0.0
    first, second = np.array(pairs).T
    apart = between_many(before[first], before[second]) - between_many(after[first], after[second])
    return float(np.hypot(apart[:, 0], apart[:, 1]).mean())
