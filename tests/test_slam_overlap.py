"""Pairs of keyframes that are matched again at the end."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import keyframes_of, room_scan_at
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.config import Config
from hsslam.matching import create
from hsslam.se2 import between, compose, pose
from hsslam.slam.overlap import SPREAD, match_pairs, overlapping_pairs


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.floats(0.2, 3.0), st.integers(1, 6))
def test_pairs_are_the_nearest_that_are_apart_in_time(seed: int, radius: float, neighbours: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.column_stack((rng.uniform(0.0, 4.0, (40, 2)), rng.uniform(-math.pi, math.pi, 40)))
    expected = []
    for second in range(40):
        costs = []
        for first in range(second - 1):
            relative = between(poses[first], poses[second])
            distance = math.hypot(relative[0], relative[1])
            if distance <= radius:
                costs.append((distance + 0.5 * abs(relative[2]), first))
        taken: list[int] = []
        for _, first in sorted(costs):
            if len(taken) < neighbours and all(abs(first - other) >= SPREAD for other in taken):
                taken.append(first)
        expected += [(first, second) for first in taken]
    assert overlapping_pairs(poses, radius, neighbours) == sorted(expected)


def test_pairs_are_of_one_session() -> None:
    poses = np.column_stack((0.1 * np.arange(12.0), np.zeros(12), np.zeros(12)))
    sessions = np.array([0] * 4 + [4] * 4 + [0] * 4)
    pairs = overlapping_pairs(poses, 3.0, 6, sessions)
    assert {(sessions[first], sessions[second]) for first, second in pairs} == {(0, 0), (4, 4)}
    assert any(first < 4 and second >= 8 for first, second in pairs)


def test_heading_counts_the_short_way_round() -> None:
    poses = np.array([pose(0, 0, 3.1), pose(0.5, 0, 1.0), pose(9, 9, 0), pose(9, 7, 0), pose(0.2, 0, -3.1)])
    assert overlapping_pairs(poses, 1.0, 1) == [(0, 4)]


def test_far_keyframes_make_no_pairs() -> None:
    poses = np.column_stack((10.0 * np.arange(5.0), np.zeros(5), np.zeros(5)))
    assert overlapping_pairs(poses, 3.0, 6) == []
    assert overlapping_pairs(poses[:1], 3.0, 6) == []


def test_matched_pairs_correct_poses_that_are_off() -> None:
    truth = np.array([pose(0, 0, 0), pose(0.3, 0.1, 0.1), pose(0.5, 0.0, -0.1)])
    points = [room_scan_at(p, noise=0.005, seed=i).points for i, p in enumerate(truth)]
    disturbed = truth.copy()
    disturbed[2] = compose(truth[2], pose(0.06, -0.05, 0.04))
    edges = match_pairs(Config(), create("hide"), keyframes_of(points, disturbed), [(0, 2)], 0)
    (edge,) = edges
    assert (edge.first, edge.second, edge.kind) == (0, 2, "overlap")
    assert edge.relative == pytest.approx(between(truth[0], truth[2]), abs=0.01)


def test_what_does_not_match_is_no_constraint() -> None:
    points = [room_scan_at(np.zeros(3)).points, np.column_stack((np.linspace(20, 30, 50), np.zeros(50)))]
    poses = np.zeros((2, 3))
    assert match_pairs(Config(), create("hide"), keyframes_of(points, poses), [(0, 1)], 0) == []
