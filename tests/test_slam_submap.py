"""Submaps against the points that must be in them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.matching import create
from hsslam.se2 import between, compose, pose, transform
from hsslam.slam.submap import GrowingSubmap, LocalSubmap, merge

STEPS = [pose(0.5, 0.02 * i, 0.1 * (-1) ** i) for i in range(20)]


def way(steps: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    poses = [np.zeros(3)]
    for step in steps:
        poses.append(compose(poses[-1], step))
    return np.array(poses)


def points_of(keyframe: int) -> NDArray[np.float64]:
    """Three points that name their keyframe."""
    return np.column_stack((2.0 + np.arange(3.0), np.full(3, 0.01 * keyframe)))


def test_merge_sees_all_from_one_pose_and_keeps_the_order() -> None:
    poses, origin = way(STEPS[:3]), pose(1.0, -2.0, 0.7)
    merged = merge([points_of(k) for k in range(4)], poses, origin)
    assert merged.shape == (12, 2)
    world = np.concatenate([transform(poses[k], points_of(k)) for k in range(4)])
    np.testing.assert_allclose(transform(origin, merged), world, atol=1e-12)


def test_a_growing_submap_holds_every_keyframe_in_the_frame_of_the_first() -> None:
    submap = GrowingSubmap(create("hide"), points_of(0), np.zeros(3))
    for k, step in enumerate(STEPS[:4], start=1):
        submap.add(points_of(k), np.zeros(3), step)
    poses = way(STEPS[:4])
    assert submap.size == 5
    assert submap.newest == pytest.approx(poses[-1])
    expected = merge([points_of(k) for k in range(5)], poses, poses[0])
    np.testing.assert_allclose(submap.reference.points, expected, atol=1e-9)


@pytest.mark.parametrize("size", [1, 2, 5, 6])
def test_a_local_submap_holds_the_newest_keyframes_half_to_full(size: int) -> None:
    submap, poses = LocalSubmap(create("hide"), size), way(STEPS)
    for k in range(len(poses)):
        submap.add(points_of(k), np.zeros(3), STEPS[k - 1] if k else np.zeros(3))
        held = len(submap.current.reference.points) // 3
        assert min(k + 1, math.ceil(size / 2)) <= held <= size
        first = k + 1 - held
        newest = between(poses[first], poses[k])
        assert submap.newest == pytest.approx(newest, abs=1e-9)
        expected = merge([points_of(i) for i in range(first, k + 1)], poses[first : k + 1], poses[first])
        np.testing.assert_allclose(submap.current.reference.points, expected, atol=1e-9)
