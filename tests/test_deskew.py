"""Motion during a scan: a laser that spins sees its last beam from elsewhere than its first."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.config import load_config
from hsslam.datasets.simulator import EXACT, DriveModel, SimulatedDataset, laser_model
from hsslam.io.logs import read_log, write_log
from hsslam.mapping.occupancy import build_grid
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import between, between_many, compose, inverse, pose, transform
from hsslam.slam.pipeline import Slam

TURNING = DriveModel(rate=10.0, speed=0.5, turn_rate=math.radians(60.0))


@pytest.fixture(scope="module")
def log() -> SimulatedDataset:
    return SimulatedDataset("office", scans=260, laser="rplidar-a2", odometry=EXACT, motion=TURNING)


def test_returns_are_moved_to_where_the_robot_of_the_stamp_sees_them() -> None:
    """A post straight ahead of every beam's moment, seen by a robot that drives an arc."""
    post, velocity, laser = np.array([[4.0, 1.0]]), pose(0.5, 0.0, 1.0), pose(0.2, -0.1, 0.3)
    geometry = ScanGeometry(-3.0, 0.1, time_increment=0.01)
    ranges = np.full(60, np.nan)
    for beam, angle in enumerate(geometry.angles(60)):
        turn = velocity[2] * 0.01 * beam
        robot = pose(
            0.5 * math.sin(turn), 0.5 * (1.0 - math.cos(turn)), turn
        )  # a circle of radius v / w = 0.5
        (seen,) = transform(inverse(compose(robot, laser)), post)
        if abs(math.atan2(seen[1], seen[0]) - angle) < 0.05:
            ranges[beam] = math.hypot(*seen)
    scan = LaserScan(0.0, ranges, geometry, laser_pose=laser)
    (moved,) = replace(scan, velocity=velocity).robot_points
    (still,) = scan.robot_points
    assert moved == pytest.approx(post[0], abs=0.25)  # beams are 0.1 rad apart
    assert np.hypot(*(moved - post[0])) < 0.5 * np.hypot(*(still - post[0]))


def test_at_rest_or_all_at_once_nothing_moves(log: SimulatedDataset) -> None:
    scan = next(log.scans())
    instant = replace(scan.geometry, time_increment=0.0)
    assert (replace(scan, velocity=np.zeros(3)).robot_points == scan.points).all()
    assert (replace(scan, geometry=instant, velocity=pose(1.0, 0.0, 1.0)).robot_points == scan.points).all()


def test_a_sweep_begins_where_the_robot_is_and_ends_where_it_is_at_the_next_scan(
    log: SimulatedDataset,
) -> None:
    exact = replace(
        laser_model("rplidar-a2"), range_noise=0.0, range_noise_share=0.0, resolution=0.0, drop_out=0.0
    )
    swept = SimulatedDataset("office", scans=20, laser=exact, motion=TURNING)
    frozen = SimulatedDataset("office", scans=20, laser=replace(exact, time_increment=0.0), motion=TURNING)
    for a, b in zip(swept.scans(), frozen.scans(), strict=True):
        assert a.ranges[0] == pytest.approx(b.ranges[0])
    assert not np.allclose(a.ranges, b.ranges, atol=0.02)


def test_tracking_is_the_better_for_it(log: SimulatedDataset) -> None:
    errors = {}
    for deskew in (False, True):
        slam = Slam(load_config(overrides=[f"tracker.deskew={str(deskew).lower()}", "loops.enabled=false"]))
        found = [slam.process(scan)[0].pose for scan in log.scans()]  # type: ignore[union-attr]
        steps = between_many(np.array(found[:-10]), np.array(found[10:]))
        truth = between_many(log.poses[:-10], log.poses[10:])
        errors[deskew] = np.abs(
            np.array([between(t, s)[2] for t, s in zip(truth, steps, strict=True)])
        ).mean()
    assert errors[True] < 0.7 * errors[False]


@pytest.mark.parametrize(
    ("name", "kind"), [("a.bag", "ros1"), ("a.mcap", "mcap"), ("a.csv", "csv"), ("a.npz", "npz")]
)
def test_logs_keep_the_time_from_beam_to_beam(
    tmp_path: Path, log: SimulatedDataset, name: str, kind: str
) -> None:
    if kind in ("ros1", "mcap"):
        pytest.importorskip("rosbags")
    scans = [scan for scan, _ in zip(log.scans(), range(3), strict=False)]
    write_log(tmp_path / name, scans, kind)
    for back, scan in zip(read_log(tmp_path / name), scans, strict=True):
        assert back.geometry.time_increment == pytest.approx(scan.geometry.time_increment, rel=1e-6)


@settings(max_examples=20, deadline=None)
@given(
    velocity=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
    mounting=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0)),
)
def test_the_map_has_walls_where_the_returns_are(
    velocity: tuple[float, float, float], mounting: tuple[float, float, float]
) -> None:
    geometry = ScanGeometry(-3.0, 0.06, time_increment=0.002)
    ranges = np.linspace(1.0, 4.0, 100)
    scan = LaserScan(0.0, ranges, geometry, laser_pose=pose(*mounting), velocity=pose(*velocity))
    at = pose(0.3, -0.2, 0.7)
    grid = build_grid([scan], at[None], 0.05)
    places = transform(at, scan.robot_points)
    columns, rows = np.floor((places - grid.origin) / 0.05).astype(int).T
    # A place on the edge of two cells may be rounded into either.
    seen = np.count_nonzero(grid.log_odds[rows, columns] > 0.0)
    assert seen >= 98
    assert np.count_nonzero(grid.log_odds > 0.0) <= 100


def test_a_map_is_the_sharper_for_it(log: SimulatedDataset) -> None:
    scans = list(log.scans())[:-1]
    steps = between_many(log.poses[:-1], log.poses[1:])
    seconds = np.diff([scan.stamp for scan in log.scans()])
    moving = [
        replace(scan, velocity=step / time) for scan, step, time in zip(scans, steps, seconds, strict=True)
    ]
    occupied = [np.count_nonzero(build_grid(kind, log.poses[:-1]).log_odds > 0.0) for kind in (moving, scans)]
    assert occupied[0] < 0.9 * occupied[1]


@given(velocity=st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_the_middle_of_a_sweep_is_half_of_it_twice(velocity: tuple[float, float, float]) -> None:
    geometry = ScanGeometry(-3.0, 0.06, time_increment=0.002)
    scan = LaserScan(0.0, np.ones(100), geometry, velocity=pose(*velocity))
    whole = replace(scan, ranges=np.ones(200)).middle
    assert compose(scan.middle, scan.middle) == pytest.approx(whole, abs=1e-9)
    assert replace(scan, velocity=np.zeros(3)).middle.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("every", [2, 4, 1000], ids=["every second scan", "every fourth scan", "none"])
def test_velocities_do_not_swing_where_odometry_comes_with_some_scans_only(
    log: SimulatedDataset, every: int
) -> None:
    """A sweep moved by too much velocity is matched too far back, and the next one would be moved by too little."""
    slam = Slam(load_config(overrides=["loops.enabled=false"]))
    scans = list(log.scans())
    held = [replace(scan, odometry=scans[i - i % every].odometry) for i, scan in enumerate(scans)]
    found = np.array([slam.process(scan)[0].pose for scan in held])  # type: ignore[union-attr]
    off = between_many(between_many(log.poses[:-1], log.poses[1:]), between_many(found[:-1], found[1:]))
    # Every second: 12 cm. None: more than a metre, and 33 degrees.
    assert np.hypot(off[:, 0], off[:, 1]).max() < 0.06
    assert np.degrees(np.abs(off[:, 2])).max() < 3.0
