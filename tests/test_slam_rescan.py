"""The last step: every scan against the map, and its way smoothed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import keyframes_of, room_scan_at, scans_tracked
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hsslam.config import Config, load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.matching import Matches, MatchResult, create
from hsslam.se2 import between, between_many, compose, compose_many, pose
from hsslam.slam.factors import FLOOR_STD_THETA, FLOOR_STD_XY
from hsslam.slam.pipeline import Slam
from hsslam.slam.rescan import match_scans, surrounding, worth_a_match
from hsslam.slam.scan_pairs import ScanPairs, match_with_keyframes
from hsslam.slam.smoothing import smooth

Array = NDArray[np.float64]
FLOOR = np.diag([FLOOR_STD_XY**2, FLOOR_STD_XY**2, FLOOR_STD_THETA**2])


def covariance(rng: np.random.Generator, std: float) -> Array:
    root = rng.normal(size=(3, 3))
    out: Array = std**2 * (root @ root.T / 3.0 + 0.2 * np.eye(3))
    return out


def root(covariance: Array) -> Array:
    out: Array = np.linalg.cholesky(np.linalg.inv(covariance)).T
    return out


def cauchy(error: Array) -> Array:
    """A residual whose square is the Cauchy loss (2) of the error."""
    length = math.sqrt(error @ error)
    return error * 2.0 * math.sqrt(math.log1p((length / 2.0) ** 2)) / max(length, 1e-12)


def matches(relative: Array, covariance: Array) -> Matches:
    return Matches.of([MatchResult(relative, covariance, 1.0, True, 0)])


def dense(
    poses: Array,
    covariances: Array,
    matched: NDArray[np.bool_],
    pairs: ScanPairs,
    motions: Array,
    noises: Array,
) -> Array:
    """The same estimate by dense least squares: Gauss for the first pose, Cauchy for all else."""

    def residuals(flat: Array) -> Array:
        way = flat.reshape(-1, 3)
        out = []
        for i, here in enumerate(way):
            if matched[i] or i == 0:
                error = here - poses[i]
                error[2] = math.remainder(error[2], 2.0 * math.pi)
                error = root(covariances[i] + FLOOR) @ error
                out.append(cauchy(error) if i else error)
            if i > 0:
                out.append(cauchy(root(noises[i]) @ between(motions[i], between(way[i - 1], here))))
        for first, second, relative, known in pairs:
            turn = np.eye(3)
            c, s = math.cos(relative[2]), math.sin(relative[2])
            turn[:2, :2] = [[c, s], [-s, c]]
            error = between(relative, between(way[first], way[second]))
            out.append(cauchy(root(turn @ known @ turn.T + FLOOR) @ error))
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
    pairs = ScanPairs()
    for first, second in ((0, 1), (0, 2), (4, 2), (4, 3), (4, 6), (7, 6), (4, 7)):
        relative = compose(between(truth[first], truth[second]), rng.normal(0.0, [0.01, 0.01, 0.005]))
        pairs.extend(first, [second], matches(relative, covariance(rng, 0.01)))
    pairs.extend(0, [7], matches(pose(9.0, 0.0, 0.0), covariance(rng, 0.01)))  # a match that is false, too
    found = smooth(poses, covariances, matched, pairs, motions, noises)
    expected = dense(poses, covariances, matched, pairs, motions, noises)
    error = between_many(expected, found)
    assert np.abs(error).max() < 1e-3
    assert np.abs(between_many(poses, found)).max() > 0.01


def test_surrounding_keeps_the_stretch_and_takes_the_nearest_others() -> None:
    poses = np.array(
        [pose(float(i), 0.0, 0.0) for i in range(20)] + [pose(5.2, 0.1, 0.0), pose(5.0, 50.0, 0)]
    )
    one = np.zeros(len(poses), dtype=np.int64)
    assert surrounding(poses, one, 5, 6, 3.0, 7).tolist() == [3, 4, 5, 6, 7, 8, 20]
    assert surrounding(poses, one, 5, 6, 3.0, 3).tolist() == [3, 4, 5, 6, 7, 8]
    assert 21 not in surrounding(poses, one, 5, 6, 3.0, 50)
    assert surrounding(poses, one, 0, 1, 0.1, 50).tolist() == [0, 1, 2, 3]


def test_surrounding_is_of_the_same_session() -> None:
    poses = np.array([pose(0.1 * i, 0.0, 0.0) for i in range(20)])
    sessions = np.array([0] * 6 + [6] * 10 + [0] * 4)
    assert surrounding(poses, sessions, 4, 5, 3.0, 20).tolist() == [0, 1, 2, 3, 4, 5, 16, 17, 18, 19]
    assert surrounding(poses, sessions, 6, 9, 3.0, 20).tolist() == list(range(6, 16))


def test_scans_that_were_disturbed_are_matched_back(rng: np.random.Generator) -> None:
    office = SimulatedDataset("office", seed=2, scans=40)
    scans = [scan.robot_points for scan in office.scans()]
    truth = office.poses
    anchors = 2 * (np.arange(40) // 2)
    keyframes, points = truth[::2], scans[::2]
    true = between_many(truth[anchors], truth)
    disturbed = compose_many(true, rng.uniform([-0.06, -0.06, -0.04], [0.06, 0.06, 0.04], (40, 3)))
    found, covariances, matched = match_scans(
        Config(),
        create("hide"),
        keyframes_of(points, keyframes),
        scans_tracked(scans, anchors // 2, disturbed),
        np.ones(40, dtype=np.bool_),
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
        keyframes_of(known[:1], office.poses[:1]),
        scans_tracked([known[0], blank], np.zeros(2, dtype=np.int64), np.array([np.zeros(3), relative])),
        np.ones(2, dtype=np.bool_),
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
        keyframes_of([seen_from(0.0)], np.zeros((1, 3))),
        scans_tracked(
            [seen_from(0.0), seen_from(0.22)], np.zeros(2, dtype=np.int64), np.array([np.zeros(3), relative])
        ),
        np.ones(2, dtype=np.bool_),
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
        keyframes_of([first], np.zeros((1, 3))),
        scans_tracked([first, second], np.zeros(2, dtype=np.int64), np.zeros((2, 3))),
        np.ones(2, dtype=np.bool_),
    )
    assert matched.tolist() == [True, believed]
    np.testing.assert_allclose(found[1], pose(off if believed else 0.0, 0.0, 0.0), atol=0.01)


def test_scans_are_matched_against_the_keyframes_before_and_after_them() -> None:
    office = SimulatedDataset("office", seed=2, scans=20)
    scans = [scan.robot_points for scan in office.scans()]
    anchors = np.arange(20, dtype=np.int64) // 5
    starts = [0, 5, 10, 15]
    off = np.tile([0.03, -0.02, 0.01], (20, 1))
    off[starts] = 0.0
    relatives = compose_many(between_many(office.poses[np.array(starts)[anchors]], office.poses), off)

    def matched(neighbours: int) -> ScanPairs:
        return match_with_keyframes(
            load_config(overrides=[f"graph.rescan_neighbours={neighbours}"]),
            create("hide"),
            keyframes_of([scans[k] for k in starts], office.poses[starts]),
            scans_tracked(scans, anchors, relatives),
        )

    pairs = matched(1)
    # Those that hang on the keyframe itself and on the one before: it comes after these.
    expected = {(k, i) for k in starts for i in range(max(k - 5, 0), k + 5) if i != k}
    assert {(first, second) for first, second, _, _ in pairs} == expected
    for first, second, relative, known in pairs:
        error = between(between(office.poses[first], office.poses[second]), relative)
        assert math.hypot(error[0], error[1]) < 0.015
        assert np.linalg.eigvalsh(known)[0] > 0.0
    assert pairs.partners(20).tolist() == [sum(i in pair for pair in expected) for i in range(20)]
    assert len(matched(0)) == 0
    assert len(matched(2)) > len(pairs)


def test_a_keyframe_that_shows_nothing_of_a_scan_is_no_partner() -> None:
    known = [scan.robot_points for scan in SimulatedDataset("office", seed=2, scans=2).scans()]
    blank = np.column_stack((np.linspace(60.0, 70.0, 30), np.full(30, 60.0)))
    pairs = match_with_keyframes(
        Config(),
        create("hide"),
        keyframes_of(known[:1], np.zeros((1, 3))),
        scans_tracked([known[0], blank], np.zeros(2, dtype=np.int64), np.zeros((2, 3))),
    )
    assert len(pairs) == 0


def test_the_map_is_asked_for_keyframes_every_other_scan_and_those_without_partners() -> None:
    anchors = np.array([0, 0, 0, 0, 1, 1, 1])
    partners = np.array([5, 2, 2, 2, 5, 2, 1])
    assert worth_a_match(anchors, partners).tolist() == [True, True, False, True, True, True, True]


@pytest.mark.parametrize("world", ["office", "hall"])
def test_keyframes_before_and_after_tell_how_the_robot_moved(world: str) -> None:
    """The map alone leaves steps between scans noisier: by a fifth in random buildings."""
    log = SimulatedDataset(world, seed=4, scans=200)
    true = between_many(log.poses[:-1], log.poses[1:])

    def error(neighbours: int) -> float:
        config = load_config(overrides=[f"graph.rescan_neighbours={neighbours}"])
        poses = Slam(config).solve(log.scans()).trajectory.poses
        return float(np.hypot(*(between_many(poses[:-1], poses[1:]) - true)[:, :2].T).mean())

    assert error(1) < 0.95 * error(0)
