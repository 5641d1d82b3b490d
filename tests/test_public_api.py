"""hsslam from Python: three lines for a match, for a log, for a live source."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray

import hsslam
from hsslam import Config, LaserScan, ScanGeometry, SearchWindow, Slam, load_config, match, open_dataset
from hsslam.errors import ConfigError
from hsslam.slam.events import Tracked

Triple = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def test_importing_the_package_loads_nothing_heavy() -> None:
    code = (
        "import sys, hsslam; hsslam.__version__; dir(hsslam);"
        "print(*sorted({'numpy', 'numba', 'gtsam', 'pydantic', 'yaml'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


def test_every_public_name_is_there_and_others_are_not() -> None:
    for name in hsslam.__all__:
        assert getattr(hsslam, name) is not None
    assert set(hsslam.__all__) <= set(dir(hsslam))
    with pytest.raises(AttributeError, match="module 'hsslam' has no attribute 'mach'"):
        hsslam.mach  # noqa: B018


@pytest.mark.parametrize("method", ["hsl", "hide", "glasm", "pl_icp"])
def test_two_point_sets(room_pair: Triple, method: str) -> None:
    first, second, truth = room_pair
    result = match(first, second, method=method)
    np.testing.assert_allclose(result.pose, truth, atol=0.05)
    assert result.score > 0.9


def test_two_scans_begin_at_their_odometry_and_match_in_the_robots_frame() -> None:
    from conftest import room_scan_at

    laser = np.array([0.2, 0.1, 0.3])
    truth = np.array([2.0, 0.5, 0.6])

    def scan(pose: NDArray[np.float64], odometry: NDArray[np.float64]) -> LaserScan:
        from hsslam.se2 import compose

        seen = room_scan_at(compose(pose, laser), beams=360)
        return LaserScan(0.0, seen.ranges, seen.geometry, odometry, laser)

    a, b = scan(np.zeros(3), np.array([5.0, 5.0, 0.0])), scan(truth, np.array([7.1, 5.4, 0.55]))
    result = match(a, b)
    np.testing.assert_allclose(result.pose, truth, atol=0.01)
    # Without odometry the truth is far out of the window.
    assert not np.allclose(match(a.robot_points, b.robot_points).pose, truth, atol=0.1)
    again = match(a, b, guess=(2.1, 0.4, 0.55 + 2 * np.pi), window=(0.2, 0.2, 0.1), evaluations=400)
    np.testing.assert_allclose(again.pose, truth, atol=0.01)


def test_the_same_seed_gives_the_same_match(room_pair: Triple) -> None:
    first, second, _ = room_pair
    one, same, other = (match(first, second, refine=False, seed=seed).pose for seed in (1, 1, 2))
    assert one.tobytes() == same.tobytes() != other.tobytes()


def test_lists_do_too() -> None:
    square = [[x, 0.0] for x in np.linspace(0, 2, 30)] + [[2.0, y] for y in np.linspace(0, 2, 30)]
    assert match(square, square, window=SearchWindow(0.1, 0.1, 0.1)).score > 0.9


def test_what_cannot_be_matched_is_said(room_pair: Triple) -> None:
    first, second, _ = room_pair
    with pytest.raises(ConfigError, match="no matcher is named 'hyde'; did you mean 'hide'"):
        match(first, second, method="hyde")
    with pytest.raises(ConfigError, match="unknown setting"):
        match(first, second, evaluation=3)
    with pytest.raises(ValueError, match="window is three positive numbers"):
        match(first, second, window=(1.0, -1.0, 0.1))
    with pytest.raises(ValueError, match=r"shape \(N, 2\)"):
        match(first[:, :1], second)
    with pytest.raises(ValueError, match="guess is three finite numbers"):
        match(first, second, guess=(1.0, 2.0))


def test_a_log_in_three_lines() -> None:
    log = open_dataset("office", scans=40)
    result = Slam(load_config(presets=["office"])).solve(log.scans())
    truth = log.truth()
    assert truth is not None and len(result.trajectory) == 40
    np.testing.assert_allclose(result.trajectory.poses[:, :2], truth.poses[:, :2], atol=0.05)


def test_a_live_source_scan_by_scan_is_the_log() -> None:
    scans = list(open_dataset("hall", scans=30).scans())
    slam = Slam(Config())
    online = []
    for scan in scans:
        tracked, *_ = slam.process(scan)
        assert isinstance(tracked, Tracked)
        online.append(tracked.pose)
    before = slam.result().trajectory.poses
    assert len(before) == 30
    list(slam.finish())
    log = Slam().solve(scans)
    assert slam.result().trajectory.poses.tobytes() == log.trajectory.poses.tobytes()
    assert np.array(online).tobytes() == log.online.poses.tobytes()


def test_process_takes_the_scan_even_where_nobody_looks_at_the_events() -> None:
    slam = Slam()
    slam.process(LaserScan(0.0, np.full(180, 2.0), ScanGeometry(-1.5, 0.0175)))
    assert len(slam.result().trajectory) == 1
