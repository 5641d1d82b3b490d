"""What speaks for a keyframe's place, and what against it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import room_scan_at

from hsslam.config import Config
from hsslam.matching import create
from hsslam.scan import LaserScan
from hsslam.se2 import Pose, between, compose, pose
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.places import PlaceSearch
from hsslam.slam.sessions import Pause, Sessions

KNOWN = [pose(0.3 * i, 0.05 * i, 0.1 * i) for i in range(6)]
HERE = pose(0.7, 0.2, 0.4)
AWAY = pose(30.0, -20.0, 2.0)


def search_with(seen: LaserScan, known: list[Pose] = KNOWN) -> PlaceSearch:
    """A keyframe of another session, after those of a room, thought to be far away."""
    scans = [*(room_scan_at(there, noise=0.005, seed=i) for i, there in enumerate(known)), seen]
    sessions = Sessions()
    for k in range(len(scans)):
        sessions.add(Pause(np.zeros(3), math.inf) if k == len(known) else None)
    poses = np.array([*known, compose(AWAY, HERE)])
    points = [scan.robot_points for scan in scans]
    keyframes = Keyframes(scans, points, poses, sessions)
    return PlaceSearch(Config(), create("hide"), len(known), keyframes)


def test_a_keyframe_is_found_in_the_room_that_it_is_of() -> None:
    search = search_with(room_scan_at(HERE, noise=0.005, seed=9))
    (first,) = search.places().tolist()
    coarse, share = search.coarsely(first, 0.5)
    assert share > 0.6
    answer = search.match(first, coarse, usual=0.95)
    assert answer is not None
    assert answer.match.relative == pytest.approx(between(KNOWN[first], HERE), abs=0.02)
    assert (answer.match.first, answer.match.second) == (first, len(KNOWN))
    assert answer.fit > 0.9


@pytest.mark.parametrize(("distance", "belongs"), [(None, True), (0.6, False)])
def test_what_is_seen_in_the_middle_of_free_space_speaks_against_a_place(
    distance: float | None, belongs: bool
) -> None:
    scan = room_scan_at(HERE, noise=0.005, seed=9)
    ranges = scan.ranges.copy()
    if distance is not None:
        fifth = len(ranges) // 5
        ranges[2 * fifth : 3 * fifth] = distance
    search = search_with(replace(scan, ranges=ranges))
    answer = search.match(0, between(KNOWN[0], HERE), usual=0.95)
    assert (answer is not None) is belongs


def test_what_lies_on_new_ground_speaks_for_no_other_place() -> None:
    """A third of the scan looks through a door that was closed: the rest fits as ever."""
    scan = room_scan_at(HERE, noise=0.005, seed=9)
    ranges = scan.ranges.copy()
    third = len(ranges) // 3
    ranges[:third] += 4.0
    search = search_with(replace(scan, ranges=ranges))
    answer = search.match(0, between(KNOWN[0], HERE), usual=0.95)
    assert answer is not None
    assert answer.match.score < 0.75
    assert answer.fit > 0.9


def test_of_each_place_one_keyframe_is_tried() -> None:
    known = [pose(0.5 * i, 0.0, 0.0) for i in range(21)]
    chosen = search_with(room_scan_at(HERE), known).places()
    assert chosen.tolist() == [0, 6, 12, 18]
