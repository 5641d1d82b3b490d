"""The last step: every scan against the map, and its way smoothed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import room_scan_at
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hsslam.config import Config, load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.matching import create
from hsslam.se2 import between, between_many, compose, compose_many, pose
from hsslam.slam.factors import FLOOR_STD_THETA, FLOOR_STD_XY
from hsslam.slam.rescan import match_scans, smooth, surrounding

Array = NDArray[np.float64]
FLOOR = np.diag([FLOOR_STD_XY**2, FLOOR_STD_XY**2, FLOOR_STD_THETA**2])


def covariance(rng: np.random.Generator, std: float) -> Array:
    root = rng.normal(size=(3, 3))
    out: Array = std**2 * (root @ root.T / 3.0 + 0.2 * np.eye(3))
    return out


def dense(
    poses: Array, covariances: Array, matched: NDArray[np.bool_], motions: Array, noises: Array
) -> Array:
    """The same estimate by dense least squares: Gauss for matches, Cauchy (2) for motions."""
    wanted = [np.linalg.cholesky(np.linalg.inv(c + FLOOR)).T for c in covariances]
    driven = [np.linalg.cholesky(np.linalg.inv(n)).T for n in noises]

    def residuals(flat: Array) -> Array:
        way = flat.reshape(-1, 3)
        out = []
        for i, here in enumerate(way):
            if matched[i] or i == 0:
                error = here - poses[i]
                error[2] = math.remainder(error[2], 2.0 * math.pi)
                out.append(wanted[i] @ error)
            if i > 0:
                error = driven[i] @ between(motions[i], between(way[i - 1], here))
                length = math.sqrt(error @ error)
                out.append(error * 2.0 * math.sqrt(math.log1p((length / 2.0) ** 2)) / max(length, 1e-12))
        return np.concatenate(out)

    found: Array = least_squares(residuals, poses.ravel(), xtol=1e-9, ftol=1e-9).x
    return found.reshape(-1, 3)


def test_smooth_is_the_least_squares_solution(rng: np.random.Generator) -> None:
    count = 8
    truth = [pose(1.0, 2.0, 3.0)]  # headings pass the seam on the way
    for _ in range(count - 1):
        truth.append(compose(truth[-1], pose(0.15, 0.01, 0.05)))
    motions = np.zeros((count, 3))
    motions[1:] = between_many(np.array(truth[:-1]), np.array(truth[1:]))
    motions[1:] += rng.normal(0.0, [0.01, 0.01, 0.005], (count - 1, 3))
    motions[5] += [0.5, 0.0, 0.3]  # odometry slipped: the loss has to let it go
    poses = np.array(truth) + rng.normal(0.0, [0.02, 0.02, 0.01], (count, 3))
    poses[:, 2] = (poses[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    covariances = np.array([covariance(rng, 0.02) for _ in range(count)])
    noises = np.array([covariance(rng, 0.01) for _ in range(count)])
    matched = np.ones(count, dtype=np.bool_)
    matched[[2, 3, 6]] = False
    found = smooth(poses, covariances, matched, motions, noises)
    expected = dense(poses, covariances, matched, motions, noises)
    error = between_many(expected, found)
    assert np.abs(error).max() < 1e-3
    assert np.abs(between_many(poses, found)).max() > 0.01


def test_surrounding_keeps_the_stretch_and_takes_the_nearest_others() -> None:
    poses = np.array(
        [pose(float(i), 0.0, 0.0) for i in range(20)] + [pose(5.2, 0.1, 0.0), pose(5.0, 50.0, 0)]
    )
    assert surrounding(poses, 5, 6, 3.0, 7).tolist() == [3, 4, 5, 6, 7, 8, 20]
    assert surrounding(poses, 5, 6, 3.0, 3).tolist() == [3, 4, 5, 6, 7, 8]
    assert 21 not in surrounding(poses, 5, 6, 3.0, 50)
    assert surrounding(poses, 0, 1, 0.1, 50).tolist() == [0, 1, 2, 3]


def test_scans_that_were_disturbed_are_matched_back(rng: np.random.Generator) -> None:
    office = SimulatedDataset("office", seed=2, scans=40)
    scans = [scan.robot_points for scan in office.scans()]
    truth = office.poses
    anchors = 2 * (np.arange(40) // 2)
    keyframes, points = truth[::2], scans[::2]
    true = between_many(truth[anchors], truth)
    disturbed = compose_many(true, rng.uniform([-0.06, -0.06, -0.04], [0.06, 0.06, 0.04], (40, 3)))
    found, covariances, matched = match_scans(
        Config(), create("hide"), points, keyframes, scans, anchors // 2, disturbed
    )
    assert matched.all()
    assert (np.linalg.eigvalsh(covariances)[:, 0] > 0.0).all()

    def errors(poses: Array) -> Array:
        out: Array = np.hypot(*(poses - truth)[:, :2].T)
        return out

    before = errors(compose_many(truth[anchors], disturbed))
    assert errors(found).mean() < 0.25 * before.mean()
    assert errors(found).max() < 0.03


def test_a_scan_that_sees_nothing_known_stays_where_it_was() -> None:
    office = SimulatedDataset("office", seed=2, scans=3)
    known = [scan.robot_points for scan in office.scans()]
    relative = pose(0.05, 0.02, 0.1)
    blank = np.column_stack((np.linspace(60.0, 70.0, 30), np.full(30, 60.0)))
    found, _, matched = match_scans(
        Config(),
        create("hide"),
        known[:1],
        office.poses[:1],
        [known[0], blank],
        np.zeros(2, dtype=np.int64),
        np.array([np.zeros(3), relative]),
    )
    assert matched.tolist() == [True, False]
    np.testing.assert_allclose(found[1], compose(office.poses[0], relative))


def test_a_person_who_walks_along_does_not_draw_a_scan_away() -> None:
    # A corridor whose far end tells how far the robot is, and a person one metre ahead of it in every scan, who is
    # more of the scan than the corridor's end: 22 cm on, the person fits best where the robot was.
    along = np.linspace(-3.0, 6.0, 181)
    end = np.column_stack((np.full(16, 6.0), np.linspace(-0.95, 0.95, 16)))
    arc = np.linspace(0.6 * math.pi, 1.4 * math.pi, 24)
    person = np.array([1.2, 0.0]) + 0.25 * np.column_stack((np.cos(arc), np.sin(arc)))[::-1]
    walls = [np.column_stack((along, np.full(181, -1.0))), np.column_stack((along[::-1], np.full(181, 1.0)))]

    def seen_from(x: float) -> Array:
        return np.concatenate((walls[0] - [x, 0.0], person, end - [x, 0.0], walls[1] - [x, 0.0]))

    relative = pose(0.22, 0.0, 0.0)
    found, _, matched = match_scans(
        load_config(overrides=["graph.overlap_half_xy=0.3"]),
        create("hide"),
        [seen_from(0.0)],
        np.zeros((1, 3)),
        [seen_from(0.0).astype(np.float32), seen_from(0.22).astype(np.float32)],
        np.zeros(2, dtype=np.int64),
        np.array([np.zeros(3), relative]),
    )
    assert matched.all()
    np.testing.assert_allclose(found[1], relative, atol=0.01)


@pytest.mark.parametrize(("off", "believed"), [(0.1, True), (0.145, False)])
def test_what_is_found_at_the_edge_of_the_window_is_not_believed(off: float, believed: bool) -> None:
    """A scan was hardly tracked that badly: what fits there fits better still beyond, or by chance."""
    first, second = room_scan_at(np.zeros(3)).points, room_scan_at(pose(off, 0.0, 0.0)).points
    found, _, matched = match_scans(
        Config(),
        create("hide"),
        [first],
        np.zeros((1, 3)),
        [first.astype(np.float32), second.astype(np.float32)],
        np.zeros(2, dtype=np.int64),
        np.zeros((2, 3)),
    )
    assert matched.tolist() == [True, believed]
    np.testing.assert_allclose(found[1], pose(off if believed else 0.0, 0.0, 0.0), atol=0.01)
