"""Final refinement: keyframes that see the same place are matched again from the optimised poses.

As Lu and Milios (1997) did: once the graph is nearly right, every overlapping pair is worth a constraint, not
only consecutive keyframes and loops.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hsslam.config import Config
from hsslam.matching.interface import Matcher, Reference, SearchWindow
from hsslam.se2 import Points, Poses, between
from hsslam.slam.events import Edge
from hsslam.slam.randomness import Purpose, generator


def overlapping_pairs(poses: Poses, radius: float, neighbours: int) -> list[tuple[int, int]]:
    """Pairs ``first < second`` of keyframes within ``radius`` (m): the nearest ``neighbours`` of each, not adjacent."""
    from scipy.spatial import KDTree

    tree = KDTree(poses[:, :2])
    pairs: set[tuple[int, int]] = set()
    for i in range(len(poses)):
        others = np.array(
            [j for j in tree.query_ball_point(poses[i, :2], radius) if j < i - 1], dtype=np.int64
        )
        if len(others) == 0:
            continue
        offsets = poses[others] - poses[i]
        turned = np.abs((offsets[:, 2] + math.pi) % (2 * math.pi) - math.pi)
        cost = np.hypot(offsets[:, 0], offsets[:, 1]) + 0.5 * turned
        for j in others[np.argsort(cost, kind="stable")[:neighbours]]:
            pairs.add((int(j), i))
    return sorted(pairs)


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
