"""Point-to-line ICP of our own."""

from __future__ import annotations

import numpy as np
import pytest

from hsslam.config import load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.errors import ConfigError
from hsslam.matching import SearchWindow, create
from hsslam.se2 import between
from hsslam.slam.pipeline import Slam

WINDOW = SearchWindow(0.2, 0.2, np.radians(10.0))


def test_it_moves_from_the_guess_to_the_truth(room_pair) -> None:
    first, second, truth = room_pair
    matcher = create("pl_icp")
    reference = matcher.prepare(first)
    for offset in np.random.default_rng(1).uniform(-WINDOW.half, WINDOW.half, (20, 3)):
        result = matcher.match(reference, second, truth + offset, WINDOW, np.random.default_rng(0))
        assert result.converged
        assert result.evaluations > 1
        assert result.pose[:2] == pytest.approx(truth[:2], abs=0.01)
        assert result.pose[2] == pytest.approx(truth[2], abs=np.radians(0.5))


def test_its_reach_sets_its_basin() -> None:
    wall = np.column_stack((np.linspace(0.0, 4.0, 80), np.zeros(80)))
    corner = np.vstack((wall[::-1], wall[1:, ::-1]))
    window = SearchWindow(1.0, 1.0, np.radians(20.0))
    errors = {}
    for reach in (0.2, 1.5):
        matcher = create("pl_icp", {"distance_start": reach})
        reference = matcher.prepare(corner)
        result = matcher.match(reference, corner, np.array([0.6, 0.6, 0.0]), window, np.random.default_rng(0))
        errors[reach] = np.abs(result.pose).max()
    assert errors[1.5] < 0.01 < errors[0.2]


def test_a_scan_beyond_reach_has_not_converged(room_pair) -> None:
    first, second, _ = room_pair
    matcher = create("pl_icp")
    result = matcher.match(
        matcher.prepare(first), second + 300.0, np.zeros(3), WINDOW, np.random.default_rng(0)
    )
    assert not result.converged
    assert result.pose.tolist() == [0.0, 0.0, 0.0]


def test_a_pose_that_swings_by_millimetres_has_converged() -> None:
    """Points that change lines to and fro kept 6 of 295 pairs from coming to rest: SLAM believed none of them."""
    office = SimulatedDataset("office", seed=2, scans=273)
    points = [scan.robot_points for scan in office.scans()]
    matcher = create("pl_icp")
    for i in (41, 46, 77, 169, 185, 266):
        truth = between(office.poses[i], office.poses[i + 3])
        reference = matcher.prepare(points[i])
        result = matcher.match(reference, points[i + 3], truth, WINDOW, np.random.default_rng(0))
        assert result.converged
        assert result.pose == pytest.approx(truth, abs=0.01)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [({"distance_start": 0.1}, "must not grow"), ({"robust_scale_end": 0.5}, "robust_scale_end is larger")],
)
def test_settings_that_make_no_sense(parameters, message) -> None:
    with pytest.raises(ConfigError, match=message):
        create("pl_icp", parameters)


def test_slam_finds_the_same_twice() -> None:
    """Of a submap that grew, lines were looked up by the numbers of another one's: some lay beyond the last."""
    scans = list(SimulatedDataset("office", seed=2, scans=120).scans())
    first, second = (Slam(load_config(overrides=["matcher=pl_icp"])).solve(scans) for _ in range(2))
    assert np.array_equal(first.trajectory.poses, second.trajectory.poses)
