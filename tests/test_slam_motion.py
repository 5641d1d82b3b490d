"""The motion model alone, and whole runs on logs whose odometry fell silent."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.config import Config, GraphSection, load_config
from hsslam.datasets.catalogue import open_dataset
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import between_many, compose, pose
from hsslam.slam.motion import REST_STD_THETA, REST_STD_XY, UNSTEADY, Evidence, MotionModel
from hsslam.slam.pipeline import Slam

RULES = GraphSection()


def scan(stamp: float, odometry: NDArray[np.float64]) -> LaserScan:
    return LaserScan(stamp, np.full(3, 1.0), ScanGeometry(0.0, 0.1), odometry=odometry)


def silent_model(step: NDArray[np.float64], seconds: float = 0.25) -> MotionModel:
    """A model that saw three scans move by ``step`` while odometry said nothing."""
    model = MotionModel(RULES)
    model.start(scan(0.0, np.zeros(3)))
    for i in range(1, 4):
        model.observe(scan(i * seconds, np.zeros(3)), step, Evidence(True))
    return model


def test_odometry_is_the_prediction_in_the_frame_of_the_last_scan() -> None:
    model = MotionModel(RULES)
    start, step = pose(3.0, -2.0, 2.0), pose(0.4, 0.1, 0.2)
    model.start(scan(0.0, start))
    moved, covariance = model.predict(scan(0.1, compose(start, step)))
    assert moved == pytest.approx(step)
    travel = math.hypot(0.4, 0.1) + 0.2
    usual = (RULES.odometry_std_xy * travel) ** 2 + REST_STD_XY**2
    # A run begins at rest.
    assert covariance[0, 0] == pytest.approx(usual + (UNSTEADY * math.hypot(0.4, 0.1)) ** 2)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0
    going = compose(start, step)
    model.observe(scan(0.1, going), step, Evidence(True))
    _, steady = model.predict(scan(0.2, compose(going, step)))
    assert steady[0, 0] == pytest.approx(usual)
    _, late = model.predict(scan(0.2, going))
    assert late[0, 0] == pytest.approx(REST_STD_XY**2 + (UNSTEADY * math.hypot(0.4, 0.1)) ** 2)
    assert late[2, 2] == pytest.approx(REST_STD_THETA**2 + (UNSTEADY * 0.2) ** 2)


def test_a_robot_at_rest_is_not_an_outage() -> None:
    model = silent_model(np.array([0.001, 0.0, 0.0]))
    assert not model.silent
    assert model.predict(scan(1.0, np.zeros(3)))[0] == pytest.approx(np.zeros(3))


def test_the_last_motion_stands_in_until_odometry_speaks_again() -> None:
    step = pose(0.15, 0.0, 0.05)
    model = silent_model(step)
    assert model.silent
    assert model.last_motion == pytest.approx(step)
    moved, covariance = model.predict(scan(1.0, np.zeros(3)))
    assert moved == pytest.approx(step)
    assert covariance[0, 0] > model.covariance(step)[0, 0]
    model.observe(scan(1.0, pose(0.1, 0.0, 0.0)), step, Evidence(True))
    assert not model.silent
    again, _ = model.predict(scan(1.25, pose(0.3, 0.0, 0.0)))
    assert again == pytest.approx(pose(0.2, 0.0, 0.0))


@pytest.mark.parametrize(
    ("seconds", "factor"), [(0.5, 2.0), (0.125, 0.5), (100.0, 4.0), (0.0, 1.0), (-3.0, 1.0)]
)
def test_the_last_motion_is_stretched_to_the_time_that_passed(seconds: float, factor: float) -> None:
    """Within limits; and stamps that repeat or step back say nothing."""
    step = pose(0.1, 0.02, 0.05)
    moved, _ = silent_model(step).predict(scan(0.75 + seconds, np.zeros(3)))
    assert moved == pytest.approx(factor * step)


def test_nobody_goes_on_for_ever_without_being_seen() -> None:
    model, way = silent_model(pose(0.15, 0.0, 0.0)), 0.0
    for i in range(200):
        unseen = scan(1.0 + 0.25 * i, np.zeros(3))
        moved, _ = model.predict(unseen)
        model.observe(unseen, moved, Evidence(False))
        way += moved[0]
    assert 0.15 < way < 1.0


def going(model: MotionModel, step: NDArray[np.float64], scans: int) -> NDArray[np.float64]:
    """Odometry tells of some scans' motion; where it ends."""
    place = np.zeros(3)
    model.start(scan(0.0, place))
    for i in range(1, scans + 1):
        place = compose(place, step)
        model.observe(scan(0.25 * i, place), step, Evidence(True))
    return place


def test_late_odometry_does_not_tell_again_what_matches_told() -> None:
    model, step = MotionModel(RULES), pose(0.2, 0.0, 0.03)
    place = going(model, step, 5)
    for i in range(6, 9):
        model.observe(scan(0.25 * i, place), step, Evidence(True, 0.1, 0.005))
    for _ in range(4):
        place = compose(place, step)
    assert model.late(scan(2.25, place))
    assert not model.leaps(scan(2.25, place))
    moved, _ = model.predict(scan(2.25, place))
    assert moved == pytest.approx(step, abs=1e-9)


def test_odometry_that_missed_some_motion_tells_of_the_last() -> None:
    model, step = MotionModel(RULES), pose(0.2, 0.0, 0.03)
    place = going(model, step, 5)
    for i in range(6, 9):
        model.observe(scan(0.25 * i, place), step, Evidence(True, 0.1, 0.005))
    here = scan(2.25, compose(place, step))
    assert not model.late(here)
    moved, _ = model.predict(here)
    assert moved == pytest.approx(step, abs=1e-9)


def test_odometry_that_jumps_while_matches_tell_of_rest_leaps() -> None:
    model, rest = MotionModel(RULES), np.zeros(3)
    model.start(scan(0.0, rest))
    for i in range(1, 30):
        model.observe(scan(0.25 * i, rest), rest, Evidence(True, 0.3, 0.003))
    assert model.leaps(scan(7.5, pose(2.0, 0.0, 0.0)))


def test_along_a_corridor_the_robot_goes_on_as_it_went_and_what_was_missed_is_made_up_for() -> None:
    """Matches that leave the way open say that it stands, for so does odometry; that it turns, they know."""
    model, step = MotionModel(RULES), pose(0.2, 0.0, 0.0)
    place = going(model, step, 5)
    for i in (6, 7):
        model.observe(scan(0.25 * i, place), pose(0.0, 0.0, 0.03), Evidence(True, 1.0, 0.4))
    assert model.silent
    moved, covariance = model.predict(scan(2.0, place))
    assert moved[0] == pytest.approx(3 * 0.2, abs=0.02)
    assert covariance[0, 0] > 0.3**2
    model.observe(scan(2.0, place), moved, Evidence(True, 1.0, 0.4))
    assert model.predict(scan(2.25, place))[0][0] == pytest.approx(0.2, abs=0.02)


def largest_error(result: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    def seen(poses: NDArray[np.float64]) -> NDArray[np.float64]:
        return between_many(np.tile(poses[0], (len(poses), 1)), poses)

    return float(np.hypot(*(seen(result) - seen(truth))[:, :2].T).max())


@pytest.mark.parametrize(("first", "last"), [(0, 120), (40, 90)])
def test_slam_goes_on_without_odometry(first: int, last: int) -> None:
    """Odometry stands still from the start, or in the middle and then goes on from where it stood."""
    office = SimulatedDataset("office", seed=4, scans=120)
    odometry = office.odometry.copy()
    odometry[first:last] = odometry[first]
    resumed = between_many(np.tile(office.odometry[last - 1], (120 - last, 1)), office.odometry[last:])
    for i, relative in enumerate(resumed, start=last):
        odometry[i] = compose(odometry[first], relative)
    assert largest_error(odometry, office.poses) > 0.5

    def scans() -> Iterator[LaserScan]:
        for scan in office.scans():
            yield replace(scan, odometry=odometry[scan.index].copy())

    result = Slam(Config()).solve(scans())
    assert largest_error(result.trajectory.poses, office.poses) < 0.10


@pytest.mark.parametrize(("frozen", "first"), [(True, 30), (False, None)])
def test_poses_that_nothing_told_of_are_counted(frozen: bool, first: int | None) -> None:
    """Blind for twenty scans: with odometry that is no guess, without it is."""
    office = SimulatedDataset("office", seed=4, scans=60)
    blind = range(30, 50)
    scans = [
        replace(
            scan,
            ranges=np.full_like(scan.ranges, np.inf) if scan.index in blind else scan.ranges,
            odometry=np.zeros(3) if frozen else scan.odometry,
        )
        for scan in office.scans()
    ]
    told = Slam(load_config(overrides=["loops.enabled=false"])).solve(scans).statistics
    assert told["first_guessed"] == first
    assert told["guessed"] >= len(blind) if frozen else told["guessed"] == 0


@pytest.mark.parametrize("seed", [1, 2])
def test_odometry_with_every_fourth_scan_leads_along_a_corridor(seed: int) -> None:
    """It came on top of what had been made of the way meanwhile: 1.5 and 3.0 m off, where walls tell nothing of it."""
    corridor = open_dataset("corridor", scans=300)
    scans = list(corridor.scans())
    held = [replace(scan, odometry=scans[i - i % 4].odometry) for i, scan in enumerate(scans)]
    slam = Slam(Config(seed=seed))
    tracked = np.array([slam.process(scan)[0].pose for scan in held])  # type: ignore[union-attr]
    truth = corridor.truth()
    assert truth is not None
    assert largest_error(tracked, truth.poses[:300]) < 0.7


def test_stamps_that_repeat_do_no_harm() -> None:
    office = SimulatedDataset("office", seed=4, scans=60)
    scans = [replace(s, stamp=float(s.index // 5), odometry=np.zeros(3)) for s in office.scans()]
    result = Slam(Config()).solve(scans)
    assert len(result.trajectory) == 60
    assert largest_error(result.trajectory.poses, office.poses) < 0.10


def test_a_robot_of_which_nothing_tells_may_go_on_all_the_way() -> None:
    """Odometry stands still all at once, and scans see nothing: that was a robot at rest, sure to centimetres."""
    model, step = MotionModel(RULES), pose(0.2, 0.0, 0.05)
    model.start(scan(0.0, np.zeros(3)))
    place = np.zeros(3)
    for i in range(1, 6):
        place = compose(place, step)
        model.observe(scan(0.5 * i, place), step, Evidence(True))
    variances = np.zeros(3)
    for i in range(6, 16):
        moved, covariance = model.predict(scan(0.5 * i, place))
        assert moved == pytest.approx(np.zeros(3))
        variances += np.diag(covariance)
        assert model.lost is (i - 6 > 5)
        model.observe(scan(0.5 * i, place), moved, Evidence(False))
    assert np.sqrt(variances) == pytest.approx([2.0, 2.0, 0.5], rel=0.02)
    assert model.pause(scan(8.0, place)) == pytest.approx(5.5)
    model.observe(scan(8.0, place), np.zeros(3), Evidence(True))
    assert not model.lost
    assert model.predict(scan(8.5, place))[1][0, 0] < 0.01


def test_a_robot_that_came_to_rest_stays_though_a_crowd_hides_the_walls() -> None:
    model, place = MotionModel(RULES), np.zeros(3)
    model.start(scan(0.0, place))
    for i, step in enumerate((0.1, 0.1, 0.1, 0.06, 0.02), start=1):
        place = compose(place, pose(step, 0.0, 0.0))
        model.observe(scan(0.2 * i, place), pose(step, 0.0, 0.0), Evidence(i < 4))
    for i in range(6, 300):
        _, covariance = model.predict(scan(0.2 * i, place))
        model.observe(scan(0.2 * i, place), np.zeros(3), Evidence(False))
    assert covariance[0, 0] < 1e-4
    assert not model.lost


def test_a_robot_that_stood_still_before_stays() -> None:
    model = MotionModel(RULES)
    model.start(scan(0.0, np.zeros(3)))
    for i in range(1, 100):
        _, covariance = model.predict(scan(0.5 * i, np.zeros(3)))
        model.observe(scan(0.5 * i, np.zeros(3)), np.zeros(3), Evidence(i < 3))
    assert covariance[0, 0] < 1e-4
    assert not model.lost


@pytest.mark.parametrize("far", [False, True])
def test_who_got_lost_is_looked_for_everywhere(far: bool) -> None:
    """The office's corridor: odometry fails at a third of it, the laser sees nothing for a while, then all is well."""
    office = SimulatedDataset("office", seed=4, scans=1000)
    scans, gone = list(office.scans()), 700
    back = gone + (80 if far else 0)
    before, failed = scans[:gone], scans[gone : gone + 12]
    stands = before[-1].odometry
    blind = [replace(s, odometry=stands, ranges=np.full_like(s.ranges, np.inf)) for s in failed]
    after = []
    for k, s in enumerate(scans[back + 12 if far else gone - 1 :][:200]):
        index = gone + 12 + k
        relative = between_many(office.odometry[[back + 12 if far else gone - 1]], s.odometry[None])[0]
        after.append(replace(s, odometry=compose(stands, relative), index=index, stamp=0.25 * index))
    log = [replace(s, index=i, stamp=0.25 * i) for i, s in enumerate([*before, *blind, *after])]
    result = Slam(Config()).solve(log)
    assert result.statistics["paused_before"] == ([gone + 12] if far else [])
    assert result.statistics["sessions"] == 1
    kept = [*range(gone), *range(gone + 12, len(log))]
    truth = office.poses[[*range(gone), *(s.index for s in scans[back + 12 if far else gone - 1 :][:200])]]
    assert largest_error(result.trajectory.poses[kept], truth) < 0.1
