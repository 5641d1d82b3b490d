"""Scans become points: any beam count, invalid returns left out only then."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import pose, transform

READINGS = st.one_of(
    st.floats(0.01, 200.0), st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0, 81.83, 8.0, 0.1])
)


@settings(deadline=None, max_examples=100)
@given(st.lists(READINGS, max_size=400), st.floats(-math.pi, math.pi), st.floats(1e-3, 0.1))
def test_points_are_the_valid_returns_in_beam_order(ranges: list[float], first: float, step: float) -> None:
    geometry = ScanGeometry(first, step, range_min=0.1, range_max=81.83)
    scan = LaserScan(1.0, np.array(ranges, dtype=np.float64), geometry)
    expected = [
        (r * math.cos(first + step * i), r * math.sin(first + step * i))
        for i, r in enumerate(ranges)
        if math.isfinite(r) and 0.1 <= r < 81.83
    ]
    assert scan.points.shape == (len(expected), 2)
    assert scan.points.dtype == np.float64
    assert np.allclose(scan.points, np.array(expected).reshape(-1, 2))
    assert int(scan.valid.sum()) == len(expected)
    assert len(scan.ranges) == len(ranges)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 0.0, -0.5, 0.04, 30.0, 81.83])
def test_each_kind_of_no_return_is_left_out(bad: float) -> None:
    geometry = ScanGeometry(0.0, 0.1, range_min=0.05, range_max=30.0)
    scan = LaserScan(0.0, np.array([1.0, bad, 2.0]), geometry)
    assert scan.valid.tolist() == [True, False, True]
    assert np.allclose(np.hypot(*scan.points.T), [1.0, 2.0])


def test_the_limits_themselves() -> None:
    geometry = ScanGeometry(0.0, 0.1, range_min=0.5, range_max=2.0)
    scan = LaserScan(0.0, np.array([0.5, np.nextafter(2.0, 0.0), 2.0]), geometry)
    assert scan.valid.tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("beams", "step"), [(180, 1.0), (181, 1.0), (361, 0.5), (1081, 0.25), (1, 1.0), (0, 1.0)]
)
def test_any_number_of_beams(beams: int, step: float) -> None:
    geometry = ScanGeometry(math.radians(-90.0), math.radians(step), range_max=10.0)
    scan = LaserScan(0.0, np.full(beams, 2.0), geometry)
    assert scan.points.shape == (beams, 2)
    if beams:
        assert scan.points[0] == pytest.approx([0.0, -2.0], abs=1e-12)
        last = math.radians(-90.0 + step * (beams - 1))
        assert scan.points[-1] == pytest.approx([2.0 * math.cos(last), 2.0 * math.sin(last)], abs=1e-9)


def test_scans_of_one_log_may_differ_in_beams() -> None:
    scans = [LaserScan(0.0, np.ones(n), ScanGeometry(0.0, 0.01)) for n in (1073, 918)]
    assert [len(scan.points) for scan in scans] == [1073, 918]


def test_robot_points_stand_in_the_robots_frame(room_scan: LaserScan) -> None:
    mount = pose(0.3, -0.05, math.radians(10.0))
    mounted = LaserScan(0.0, room_scan.ranges, room_scan.geometry, laser_pose=mount)
    assert np.allclose(mounted.robot_points, transform(mount, room_scan.points))
    assert np.array_equal(room_scan.robot_points, room_scan.points)


def test_points_are_made_once(room_scan: LaserScan) -> None:
    assert room_scan.points is room_scan.points


def test_default_poses_are_not_shared() -> None:
    one, other = (LaserScan(0.0, np.ones(3), ScanGeometry(0.0, 0.1)) for _ in range(2))
    one.odometry[0] = 5.0
    assert other.odometry.tolist() == [0.0, 0.0, 0.0]
    assert other.laser_pose.tolist() == [0.0, 0.0, 0.0]


def test_the_robots_points_go_round_counter_clockwise_whichever_way_the_beams_do() -> None:
    ranges = np.linspace(1.0, 2.0, 90)
    geometry = ScanGeometry(-0.5, 0.01, range_max=10.0, time_increment=1e-3)
    scan = LaserScan(0.0, ranges, geometry)
    backwards = LaserScan(
        0.0, ranges[::-1].copy(), replace(geometry, angle_min=-0.5 + 0.89, angle_increment=-0.01)
    )
    assert backwards.robot_points == pytest.approx(scan.robot_points)
    moving = replace(backwards, velocity=np.array([1.0, 0.0, 0.0]))
    assert moving.robot_points[-1] == pytest.approx(scan.robot_points[-1])
    assert moving.robot_points[0] == pytest.approx(scan.robot_points[0] + [0.089, 0.0])
