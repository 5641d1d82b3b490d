"""Final refinement: keyframes that see the same place are matched again from the optimised poses.

As Lu and Milios (1997) did: once the graph is nearly right, every overlapping pair is worth a constraint, not
only consecutive keyframes and loops.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.jit import kernel
from hsslam.matching.interface import Matcher, Reference, SearchWindow
from hsslam.se2 import Points, Poses, between
from hsslam.slam.events import Edge
from hsslam.slam.randomness import Purpose, generator

SPREAD = 3
"""Keyframes between two that are matched with the same third, at least: neighbours in time tell the same."""


def overlapping_pairs(poses: Poses, radius: float, neighbours: int) -> list[tuple[int, int]]:
    """Pairs ``first < second`` of keyframes within ``radius`` (m): up to ``neighbours`` earlier ones of each.

    The nearest come first; of keyframes that follow one another only every third is taken, so that all visits
    to a place are tied together. Consecutive keyframes are no pair: they have a constraint.
    """
    from scipy.spatial import KDTree

    near = KDTree(poses[:, :2]).query_pairs(radius, output_type="ndarray")
    first, second = np.sort(near.reshape(-1, 2), axis=1).T
    apart = second - first > 1
    first, second = first[apart].astype(np.int64), second[apart].astype(np.int64)
    offsets = poses[first] - poses[second]
    turned = np.abs((offsets[:, 2] + math.pi) % (2 * math.pi) - math.pi)
    cost = np.hypot(offsets[:, 0], offsets[:, 1]) + 0.5 * turned
    order = np.lexsort((first, cost, second))
    chosen = choose(first[order], second[order], neighbours, SPREAD)
    return sorted(zip(first[order][chosen].tolist(), second[order][chosen].tolist(), strict=True))


@kernel
def choose(first: NDArray[np.int64], second: NDArray[np.int64], most: int, spread: int) -> NDArray[np.bool_]:
    """Which pairs to take, the best of each ``second`` first, no two ``first`` of it nearer than ``spread``."""
    chosen = np.zeros(len(first), dtype=np.bool_)
    start = 0
    for k in range(len(first)):
        if second[k] != second[start]:
            start = k
        count = 0
        free = True
        for j in range(start, k):
            if chosen[j]:
                count += 1
                free = free and abs(first[j] - first[k]) >= spread
        chosen[k] = free and count < most
    return chosen


def match_pairs(
    config: Config,
    matcher: Matcher[Any],
    points: list[Points],
    poses: Poses,
    pairs: list[tuple[int, int]],
    stage: int,
) -> list[Edge]:
    """Match each pair from its current relative pose; constraints that were found are returned."""
    rules = config.graph
    window = SearchWindow(
        rules.overlap_half_xy, rules.overlap_half_xy, math.radians(rules.overlap_half_theta_deg)
    )
    edges: list[Edge] = []
    reference: Reference | None = None
    prepared = -1
    for first, second in pairs:
        if prepared != first or reference is None:
            reference = matcher.prepare(points[first])
            prepared = first
        guess = between(poses[first], poses[second])
        rng = generator(config.seed, Purpose.OVERLAP, stage, first, second)
        result = matcher.match(reference, points[second], guess, window, rng)
        if result.converged and result.score >= rules.overlap_min_score:
            edges.append(Edge(first, second, result.pose, result.covariance, "overlap"))
    return edges
