"""The simulated worlds: exact where they must be, noisy where they should be, the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.datasets.simulator import (
    EXACT,
    LASERS,
    PLAN_NAMES,
    OdometryModel,
    SimulatedDataset,
    floor_plan,
    laser_model,
    raycast,
    simulate_pairs,
)
from hsslam.errors import ConfigError, DataError
from hsslam.scan import ScanGeometry
from hsslam.se2 import between, between_many, transform

coordinates = st.floats(-5.0, 5.0, allow_nan=False, width=32)


def ranges_twin(
    segments: NDArray[np.float64], pose: NDArray[np.float64], angles: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Every ray against every edge by solving two equations: the NumPy twin."""
    out = np.full(len(angles), np.inf)
    for k, angle in enumerate(angles + pose[2]):
        ray = np.array([np.cos(angle), np.sin(angle)])
        for x1, y1, x2, y2 in segments:
            edge = np.array([x2 - x1, y2 - y1])
            system = np.column_stack((ray, -edge))
            if abs(np.linalg.det(system)) < 1e-12:
                continue
            distance, share = np.linalg.solve(system, np.array([x1, y1]) - pose[:2])
            if distance > 0.0 and -1e-9 <= share <= 1.0 + 1e-9:
                out[k] = min(out[k], distance)
    return out


def squared_distances(segments: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distance (m^2) of a pose from every edge."""
    offset, edge = pose[:2] - segments[:, :2], segments[:, 2:] - segments[:, :2]
    share = np.clip((offset * edge).sum(1) / np.maximum((edge**2).sum(1), 1e-300), 0.0, 1.0)
    out: NDArray[np.float64] = ((offset - share[:, None] * edge) ** 2).sum(1)
    return out


@given(
    st.lists(st.tuples(coordinates, coordinates, coordinates, coordinates), min_size=1, max_size=6),
    st.tuples(coordinates, coordinates, st.floats(-3.0, 3.0)),
)
@settings(deadline=None, max_examples=40)
def test_ranges_agree_with_numpy(
    edges: list[tuple[float, float, float, float]], pose: tuple[float, float, float]
) -> None:
    segments, at = np.array(edges, dtype=np.float64), np.array(pose)
    assume(squared_distances(segments, at).min() > 1e-4)
    geometry = ScanGeometry(-np.pi / 2, np.pi / 30)
    found = raycast(segments, at, geometry, 31)
    expected = ranges_twin(segments, at, geometry.angles(31))
    # A ray along an edge, or through its very end, may go either way.
    assert np.mean(np.isclose(found, expected, rtol=1e-6, atol=1e-6) | (found == expected)) > 0.9


def test_ranges_in_a_square_room_are_exact() -> None:
    room = np.array([[-2.0, -2, 2, -2], [2, -2, 2, 2], [2, 2, -2, 2], [-2, 2, -2, -2]])
    ranges = raycast(room, np.zeros(3), ScanGeometry(0.0, np.pi / 4), 8)
    assert ranges == pytest.approx([2, 2 * np.sqrt(2)] * 4)


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_the_robot_keeps_clear_and_sees_enough(name: str) -> None:
    dataset = SimulatedDataset(name, seed=3)
    plan = floor_plan(name)
    assert not plan.inside_solid(dataset.poses[:, :2]).any()
    assert plan.clearance(dataset.poses[:, :2]).min() > 0.2
    assert min(len(scan.points) for scan in dataset.scans()) > 100


@pytest.mark.parametrize("name", PLAN_NAMES)
def test_points_lie_on_the_plan_at_the_true_pose(name: str) -> None:
    dataset = SimulatedDataset(name, scans=20)
    truth = dataset.truth()
    plan = floor_plan(name)
    noise = dataset.laser.range_noise
    for scan, pose in zip(dataset.scans(), truth.poses, strict=True):
        off = plan.clearance(transform(pose, scan.robot_points))
        assert np.median(off) < 2.0 * noise
        assert np.mean(off < 5.0 * noise) > 0.98


@pytest.mark.parametrize("name", ["office", "hall"])
def test_odometry_drifts_yet_each_step_predicts(name: str) -> None:
    dataset = SimulatedDataset(name)
    end = between(dataset.truth().poses[-1], dataset.odometry[-1])
    assert np.hypot(end[0], end[1]) > 1.0
    steps = between_many(dataset.poses[:-1], dataset.poses[1:])
    measured = between_many(dataset.odometry[:-1], dataset.odometry[1:])
    assert np.abs(steps - measured).max() < 0.1
    assert (dataset.odometry[0] == dataset.poses[0]).all()


def test_exact_odometry_is_the_truth() -> None:
    dataset = SimulatedDataset("office", scans=50, odometry=EXACT)
    assert dataset.odometry == pytest.approx(dataset.poses)
    assert not np.allclose(OdometryModel().measure(dataset.poses, np.random.default_rng(0)), dataset.poses)


def test_same_seed_same_log_and_a_longer_log_begins_the_same() -> None:
    first, again, longer, other = (
        list(SimulatedDataset("office", seed=seed, scans=count).scans())
        for seed, count in ((1, 30), (1, 30), (1, 300), (2, 30))
    )
    for a, b, c in zip(first, again, longer, strict=False):
        assert (a.ranges == b.ranges).all()
        assert (a.ranges == c.ranges).all()
        assert (a.odometry == c.odometry).all()
    assert len(longer) == 300
    assert not (first[5].ranges == other[5].ranges).all()


@pytest.mark.parametrize("name", sorted(LASERS))
def test_lasers_are_as_noisy_as_they_say(name: str) -> None:
    laser = laser_model(name)
    distance = 0.5 * min(laser.range_max, 6.0)
    readings = laser.measure(np.full((400, laser.beams), distance), np.random.default_rng(0))
    valid = np.isfinite(readings) & (readings < laser.range_max) & (readings > 0.0)
    expected = max(laser.range_noise, laser.range_noise_share * distance)
    assert np.std(readings[valid]) == pytest.approx(expected, rel=0.5)
    assert abs(np.mean(readings[valid]) - distance) < 0.3 * expected
    assert 1.0 - valid.mean() == pytest.approx(laser.drop_out, abs=0.005)
    assert len(laser.with_beams(91).geometry.angles(91)) == 91


@pytest.mark.parametrize("laser", sorted(LASERS))
def test_pairs_are_near_and_their_relative_pose_is_exact(laser: str) -> None:
    pairs = simulate_pairs("office", 10, laser, np.random.default_rng(1), max_distance=0.6)
    assert len(pairs) == 10
    plan = floor_plan("office")
    for pair in pairs:
        assert np.hypot(*pair.relative[:2]) <= 0.6
        assert pair.relative == pytest.approx(between(pair.reference.odometry, pair.scan.odometry))
        assert np.median(plan.clearance(transform(pair.scan.odometry, pair.scan_points))) < 0.05


def test_unknown_names_are_errors() -> None:
    with pytest.raises(DataError, match="office"):
        SimulatedDataset("offce")
    with pytest.raises(ConfigError, match="sick-lms200"):
        SimulatedDataset("office", laser="sick")
    with pytest.raises(ConfigError, match="at least one"):
        SimulatedDataset("office", scans=0)
