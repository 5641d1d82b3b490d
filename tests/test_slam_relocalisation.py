"""Recordings that pause, and robots that are carried meanwhile."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hsslam.config import Config, load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.matching import create
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Poses, between, between_many, compose, compose_many, pose
from hsslam.slam.events import LoopChecked, SlamResult
from hsslam.slam.journal import Header, Journal, read_journal
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.pipeline import Slam
from hsslam.slam.relocalisation import Relocalisation
from hsslam.slam.sessions import Pause, Sessions
from hsslam.slam.stopwatch import Stopwatch

OFFICE = SimulatedDataset("office", seed=1, scans=1400)
AWAY = pose(-7.0, 3.0, 2.5)


def interrupted(
    scans: list[LaserScan], gaps: list[tuple[int, int]], *, carried: bool
) -> tuple[list[LaserScan], list[int]]:
    """A log without some stretches, and the numbers of what is left; ``carried``: odometry knows nothing of them."""
    left = [scan for scan in scans if not any(first <= scan.index < stop for first, stop in gaps)]
    there, out = left[0].odometry, [left[0]]
    for before, scan in pairwise(left):
        if not (carried and scan.index > before.index + 1):
            there = compose(there, between(before.odometry, scan.odometry))
        out.append(replace(scan, index=len(out), odometry=there))
    return out, [scan.index for scan in left]


def errors(result: SlamResult, truth: Poses) -> Poses:
    """Distances (m) of every scan from where it was; odometry begins there."""
    off = result.trajectory.poses - truth
    out: Poses = np.hypot(off[:, 0], off[:, 1])
    return out


@pytest.fixture(scope="module")
def office() -> list[LaserScan]:
    return list(OFFICE.scans())


@pytest.mark.parametrize("carried", [True, False], ids=["carried", "odometry goes on"])
@pytest.mark.parametrize("gaps", [[(300, 600)], [(300, 600), (800, 1100)]], ids=["one pause", "two pauses"])
def test_the_robot_is_found_again(
    office: list[LaserScan], gaps: list[tuple[int, int]], carried: bool
) -> None:
    scans, left = interrupted(office, gaps, carried=carried)
    result = Slam().solve(scans)
    assert result.statistics["paused_before"] == [left.index(stop) for _, stop in gaps]
    assert result.statistics["sessions"] == 1
    assert result.statistics["guessed"] == 0
    assert errors(result, OFFICE.poses[left]).max() < 0.05


def test_any_matcher_finds_it(office: list[LaserScan]) -> None:
    scans, left = interrupted(office[:900], [(300, 560)], carried=True)
    result = Slam(load_config(overrides=["matcher=pl_icp"])).solve(scans)
    assert result.statistics["sessions"] == 1
    assert errors(result, OFFICE.poses[left]).max() < 0.06


def test_without_loops_nothing_is_tied(office: list[LaserScan]) -> None:
    scans, _ = interrupted(office[:900], [(300, 560)], carried=True)
    result = Slam(load_config(overrides=["loops.enabled=false"])).solve(scans)
    assert result.statistics["sessions"] == 2
    assert result.loops == []


def test_a_pause_at_rest_is_none(office: list[LaserScan]) -> None:
    """Nothing is to be found again where the next scan fits as ever."""
    late = [scan if scan.index < 300 else replace(scan, stamp=scan.stamp + 60.0) for scan in office[:600]]
    result = Slam().solve(late)
    assert result.statistics["paused_before"] == []
    assert errors(result, OFFICE.poses[:600]).max() < 0.05


def test_a_robot_that_is_elsewhere_for_good_is_not_found() -> None:
    """Another building, after a pause: two maps that have nothing to do with one another, and it is said so."""
    here, there = (SimulatedDataset(name, seed=2, scans=260) for name in ("office", "hall"))
    first = list(here.scans())
    second = [
        replace(scan, index=260 + scan.index, stamp=first[-1].stamp + 30.0 + scan.stamp, odometry=odometry)
        for scan, odometry in zip(
            there.scans(), compose_many(np.tile(first[-1].odometry, (260, 1)), there.odometry), strict=True
        )
    ]
    result = Slam().solve([*first, *second])
    assert result.statistics["paused_before"] == [260]
    assert result.statistics["sessions"] == 2
    second_keyframe = next(k for k, scan in enumerate(result.keyframes) if scan.index >= 260)
    across = [edge for edge in result.edges if edge.first < second_keyframe <= edge.second]
    assert [(edge.first, edge.second) for edge in across] == [(second_keyframe - 1, second_keyframe)]
    for part, log in ((slice(0, 260), here), (slice(260, 520), there)):
        poses = result.trajectory.poses[part]
        seen = between_many(np.tile(poses[0], (260, 1)), poses)
        true = between_many(np.tile(log.poses[0], (260, 1)), log.poses)
        assert np.hypot(*(seen - true)[:, :2].T).max() < 0.06


def test_a_run_that_died_after_a_pause_goes_on_as_the_whole_run(
    office: list[LaserScan], tmp_path: Path
) -> None:
    scans, _ = interrupted(office[:900], [(300, 560)], carried=True)
    whole = Slam().solve(scans)
    header = Header({}, Config().model_dump(mode="json"))
    with Journal(tmp_path / "journal.jsonl", header) as journal:
        dying = Slam()
        for scan in scans[:420]:
            for event in dying.process(scan):
                journal.write(event)
    resumed = Slam(replay=read_journal(tmp_path / "journal.jsonl")).solve(scans)
    assert (resumed.trajectory.poses == whole.trajectory.poses).all()
    assert resumed.statistics["paused_before"] == whole.statistics["paused_before"]
    assert json.dumps([loop.score for loop in resumed.loops]) == json.dumps(
        [loop.score for loop in whole.loops]
    )


def looked_for(numbers: list[int], pause: Pause, *, again: bool = False) -> list[LoopChecked]:
    """What is found when the office is known, and some of its scans follow, thought to be somewhere else.

    ``again``: it is the known ones that are looked for, one after another, once the others are all there.
    """
    known = list(range(0, 700, 3))
    truth = OFFICE.poses[[*known, *numbers]]
    scans = [_SCANS[i] for i in (*known, *numbers)]
    points: list[Points] = [scan.robot_points for scan in scans]
    poses = truth.copy()
    relocalisation = Relocalisation(Config(), create("hide"), Stopwatch())
    for k in range(len(known), len(truth)):
        poses[k] = compose(AWAY, truth[k])
    order = range(len(known)) if again else range(len(known), len(truth))
    for k in order:
        stop = len(truth) if again else k + 1
        until = Sessions()
        for i in range(stop):
            until.add(pause if i == len(known) else None)
        known_by_now = Keyframes(scans[:stop], points[:stop], poses[:stop], until)
        loops = relocalisation.look(k, known_by_now, 0.95)
        if loops:
            for loop in loops:
                off = between(between(truth[loop.first], truth[loop.second]), loop.relative)
                assert math.hypot(off[0], off[1]) < 0.05
                assert loop.accepted
                assert loop.first < loop.second
            return loops
    return []


_SCANS = list(OFFICE.scans())
TURNING = list(range(702, 1000, 3))


def test_how_much_confirms_a_guess_depends_on_the_pause() -> None:
    anywhere = looked_for(TURNING, Pause(np.zeros(3), math.inf))
    start = OFFICE.poses[TURNING[0]]
    foreseen = looked_for(TURNING, Pause(between(OFFICE.poses[699], start), math.inf))
    short = looked_for(TURNING, Pause(np.zeros(3), 1.0))
    assert len(anywhere) >= 10
    assert len(foreseen) < len(anywhere)
    assert len(short) < len(anywhere)
    headings = OFFICE.poses[[TURNING[loop.second - 234] for loop in anywhere], 2]
    assert np.ptp(np.unwrap(headings)) >= math.radians(30.0)


def test_straight_on_along_one_wall_nothing_is_sure() -> None:
    """Until the robot turns, one corridor looks like another."""
    steps = between_many(OFFICE.poses[TURNING][:-1], OFFICE.poses[TURNING][1:])
    straight = int(np.argmax(np.abs(np.cumsum(steps[:, 2])) > math.radians(25.0)))
    assert straight > 12
    assert not looked_for(TURNING[:straight], Pause(np.zeros(3), math.inf))


def test_of_two_places_that_are_alike_neither_is_believed() -> None:
    """The same building twice in one map: whatever is seen next, it is in both."""
    known = list(range(0, 700, 6))
    twin = OFFICE.poses[known] + (60.0, 0.0, 0.0)
    after = [compose(AWAY, there) for there in OFFICE.poses[TURNING]]
    poses = np.array([*OFFICE.poses[known], *twin, *after])
    scans = [_SCANS[i] for i in (*known, *known, *TURNING)]
    points = [scan.robot_points for scan in scans]
    relocalisation, sessions = Relocalisation(Config(), create("hide"), Stopwatch()), Sessions()
    for _ in range(2 * len(known)):
        sessions.add()
    for k in range(2 * len(known), 2 * len(known) + 60):
        sessions.add(Pause(np.zeros(3), math.inf) if k == 2 * len(known) else None)
        stop = k + 1
        keyframes = Keyframes(scans[:stop], points[:stop], poses[:stop], sessions)
        assert not relocalisation.look(k, keyframes, 0.95)


def test_what_was_driven_first_is_found_in_what_was_driven_later() -> None:
    loops = looked_for(TURNING, Pause(np.zeros(3), math.inf), again=True)
    assert loops
    for loop in loops:
        assert np.linalg.eigvalsh(loop.covariance)[0] > 0.0
