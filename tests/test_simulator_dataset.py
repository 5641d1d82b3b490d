"""Simulated logs and pairs."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from hsslam.datasets.simulator import (
    PLAN_NAMES,
    DriveModel,
    OdometryModel,
    SimulatedDataset,
    floor_plan,
    laser_model,
    raycast,
    simulate_pairs,
)
from hsslam.errors import ConfigError
from hsslam.scan import ScanGeometry
from hsslam.se2 import between, between_many, compose, transform, wrap


def test_scans_start_anew_each_time() -> None:
    dataset = SimulatedDataset("hall", scans=5)
    once, twice = list(dataset.scans()), list(dataset.scans())
    for a, b in zip(once, twice, strict=True):
        np.testing.assert_array_equal(a.ranges, b.ranges)


def test_a_longer_log_begins_like_a_shorter_one() -> None:
    short, long = SimulatedDataset("office", scans=300), SimulatedDataset("office", scans=700)
    for a, b in zip(short.scans(), itertools.islice(long.scans(), 300), strict=True):
        np.testing.assert_array_equal(a.ranges, b.ranges)
        np.testing.assert_array_equal(a.odometry, b.odometry)
        assert a.stamp == b.stamp
    np.testing.assert_array_equal(short.truth().poses, long.truth().poses[:300])


def test_info_truth_and_stamps_agree() -> None:
    dataset = SimulatedDataset("corridor", scans=50)
    truth, scans = dataset.truth(), list(dataset.scans())
    assert dataset.info.kind == "simulated"
    assert dataset.info.name == "corridor"
    assert dataset.info.scan_count == len(scans) == len(truth) == 50
    assert [scan.index for scan in scans] == truth.indices.tolist() == list(range(50))
    assert [scan.stamp for scan in scans] == truth.stamps.tolist()
    assert np.diff(truth.stamps) == pytest.approx(1.0 / dataset.motion.rate)
    assert dataset.relations() is None


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_the_robot_is_never_inside_anything_and_passes_through_nothing(name: str) -> None:
    for seed in (0, 1):
        dataset = SimulatedDataset(name, seed=seed, scans=2500)
        plan, poses = dataset.plan, dataset.truth().poses
        assert not plan.inside_solid(poses[:, :2]).any()
        assert plan.clearance(poses[:, :2]).min() > 0.2
        step = np.diff(poses[:, :2], axis=0)
        looks = np.column_stack((poses[:-1, :2], np.arctan2(step[:, 1], step[:, 0])))
        ahead = raycast(plan.segments, looks, ScanGeometry(0.0, 1.0), 2)[:, 0]
        assert (ahead > np.hypot(step[:, 0], step[:, 1])).all()


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_the_robot_moves_as_a_robot_does_and_comes_back(name: str) -> None:
    dataset = SimulatedDataset(name, scans=2500)
    steps = between_many(dataset.poses[:-1], dataset.poses[1:])
    model = dataset.motion
    assert np.hypot(steps[:, 0], steps[:, 1]).max() <= model.speed / model.rate + 1e-9
    assert np.abs(steps[:, 2]).max() <= model.turn_rate / model.rate + 1e-9
    # A differential drive slides sideways no more than its arc bends.
    assert np.abs(steps[:, 1]).max() < 0.03
    to_start = np.hypot(*(dataset.poses[:, :2] - dataset.poses[0, :2]).T)
    assert to_start.max() > 10.0
    farthest = int(np.argmax(to_start[:800]))
    assert to_start[farthest:].min() < 1.0


@pytest.mark.parametrize("laser", ["sick-lms200", "urg-04lx"])
@pytest.mark.parametrize("name", PLAN_NAMES)
def test_every_scan_sees_enough(name: str, laser: str) -> None:
    seen = [scan.valid.mean() for scan in SimulatedDataset(name, scans=400, laser=laser).scans()]
    # In the hall much is beyond the 4 m of the URG.
    assert min(seen) > (0.9 if laser == "sick-lms200" else 0.05)


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_odometry_alone_goes_visibly_wrong_yet_each_step_is_fair(name: str) -> None:
    for seed in range(3):
        dataset = SimulatedDataset(name, seed=seed)
        truth, odometry = dataset.truth().poses, dataset.odometry
        np.testing.assert_array_equal(odometry[0], truth[0])
        assert np.hypot(*(odometry - truth).T[:2]).max() > 1.0
        steps = between_many(between_many(truth[:-1], truth[1:]), between_many(odometry[:-1], odometry[1:]))
        assert np.hypot(steps[:, 0], steps[:, 1]).max() < 0.05
        assert np.abs(steps[:, 2]).max() < math.radians(4.0)


def test_biases_do_what_they_say() -> None:
    model = OdometryModel(0.0, 0.0, 0.0, scale_bias=0.1, turn_bias=0.0, drift=0.05)
    straight = np.column_stack((np.arange(11.0), np.zeros(11), np.zeros(11)))
    measured = model.measure(straight, np.random.default_rng(0))
    np.testing.assert_allclose(np.hypot(*np.diff(measured[:, :2], axis=0).T), 1.1)
    assert measured[-1, 2] == pytest.approx(0.5)


def test_slip_grows_with_travel_whatever_the_rate() -> None:
    model = OdometryModel(scale_bias=0.0, turn_bias=0.0, drift=0.0)

    def spread(steps: int) -> float:
        straight = np.column_stack(
            (np.linspace(0.0, 4.0, steps + 1), np.zeros(steps + 1), np.zeros(steps + 1))
        )
        ends = [model.measure(straight, np.random.default_rng(seed))[-1, 2] for seed in range(400)]
        return float(np.std(ends))

    assert spread(4) == pytest.approx(2.0 * model.slip_heading, rel=0.15)
    assert spread(40) == pytest.approx(2.0 * model.slip_heading, rel=0.15)


def test_points_lie_on_the_walls_seen_from_the_laser() -> None:
    laser = laser_model("sick-lms200")
    mount = np.array([0.2, -0.1, 0.3])
    dataset = SimulatedDataset(
        "hall",
        scans=30,
        laser=replace(laser, range_noise=0.0, drop_out=0.0, resolution=0.0),
        laser_pose=mount,
    )
    for scan, robot in zip(dataset.scans(), dataset.truth().poses, strict=True):
        np.testing.assert_array_equal(scan.laser_pose, mount)
        world = transform(compose(robot, mount), scan.points)
        assert len(world) > 100
        assert dataset.plan.clearance(world).max() < 1e-6
        assert dataset.plan.clearance(transform(robot, scan.robot_points)).max() < 1e-6


def test_readings_of_the_sick_are_whole_centimetres() -> None:
    scan = next(SimulatedDataset("office", scans=1).scans())
    np.testing.assert_array_equal(scan.ranges, np.round(scan.ranges, 2))


def test_a_robot_can_be_slower() -> None:
    slow = SimulatedDataset("office", scans=50, motion=DriveModel(speed=0.2))
    fast = SimulatedDataset("office", scans=50)
    assert slow.poses[-1, 0] - slow.poses[0, 0] < 0.5 * (fast.poses[-1, 0] - fast.poses[0, 0])


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_pairs_are_near_one_another_and_free(name: str) -> None:
    pairs = simulate_pairs(
        name, 60, "sick-lms200", np.random.default_rng(5), max_distance=0.5, max_angle_deg=30.0
    )
    plan = floor_plan(name)
    assert len(pairs) == 60
    for pair in pairs:
        assert np.hypot(*pair.relative[:2]) <= 0.5 + 1e-9
        assert abs(pair.relative[2]) <= math.radians(30.0) + 1e-9
        np.testing.assert_allclose(pair.relative, between(pair.reference.odometry, pair.scan.odometry))
        for scan in (pair.reference, pair.scan):
            assert not plan.inside_solid(scan.odometry[None, :2])[0]
            assert plan.clearance(scan.odometry[None, :2])[0] >= 0.3
    turns = np.array([pair.relative[2] for pair in pairs])
    assert turns.min() < -0.2
    assert turns.max() > 0.2


def test_both_scans_of_a_pair_see_the_same_world_through_the_true_pose() -> None:
    for pair in simulate_pairs("office", 20, "sick-lms200", np.random.default_rng(2)):
        plan = floor_plan("office")
        at_reference = transform(pair.relative, pair.scan_points)
        world = transform(pair.reference.odometry, at_reference)
        # Five standard deviations of the noise and half a centimetre of rounding.
        assert plan.clearance(world).max() < 0.06
        assert plan.clearance(transform(pair.reference.odometry, pair.reference_points)).max() < 0.06


def test_pairs_follow_from_the_generator() -> None:
    first, again = (simulate_pairs("hall", 4, "urg-04lx", np.random.default_rng(9)) for _ in range(2))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.scan.ranges, b.scan.ranges)
        np.testing.assert_array_equal(a.relative, b.relative)
    assert first[0].relative[2] == wrap(first[0].relative[2])
    assert simulate_pairs("hall", 0, "urg-04lx", np.random.default_rng(9)) == []
    with pytest.raises(ConfigError, match="negative"):
        simulate_pairs("hall", 4, "urg-04lx", np.random.default_rng(9), max_distance=-1.0)
