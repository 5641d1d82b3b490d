"""People: in the way, beside the robot, and in the points that the map is made of."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.datasets.simulator import FloorPlan, LaserModel, SimulatedDataset
from hsslam.datasets.simulator.solids import pillar
from hsslam.scan import LaserScan
from hsslam.se2 import Pose, compose, pose
from hsslam.slam.free_space import MOST_CELLS, FreeSpace
from hsslam.slam.pipeline import Slam
from hsslam_eval.metrics import ate

RADIUS = 0.2
SIDES = ((0.35, 1.1), (-0.6, 0.9))
"""Bearing (rad) and distance (m) of people who walk along, seen from the robot."""


def ranges_before(scan: LaserScan, laser: Pose, person: NDArray[np.float64]) -> NDArray[np.float64]:
    """A scan's ranges with a person (x, y) m in the way."""
    dx, dy = person - laser[:2]
    distance = math.hypot(dx, dy)
    off = scan.geometry.angles(len(scan.ranges)) + laser[2] - math.atan2(dy, dx)
    hit = (np.abs(distance * np.sin(off)) < RADIUS) & (np.cos(off) > 0.0)
    front = distance * np.cos(off) - np.sqrt(np.maximum(RADIUS**2 - (distance * np.sin(off)) ** 2, 0.0))
    return np.where(hit, np.minimum(front, scan.ranges), scan.ranges)


def walked_along(log: SimulatedDataset) -> Iterator[LaserScan]:
    """The log, with two people who walk along with the robot, each at a place that sways a little."""
    for scan in log.scans():
        robot = log.poses[scan.index]
        for k, (bearing, distance) in enumerate(SIDES):
            sway = 0.15 * math.sin(0.11 * scan.index + 2.0 * k)
            way = robot[2] + bearing + sway
            person = robot[:2] + (distance + sway) * np.array([math.cos(way), math.sin(way)])
            scan = replace(scan, ranges=ranges_before(scan, robot, person))
        yield scan


def test_people_who_walk_along_are_no_part_of_the_map() -> None:
    """Four drives: single ones turn on how people hide from one another what is behind them."""
    errors = []
    for seed in range(4):
        log = SimulatedDataset("office", seed=seed, scans=200)
        result = Slam().solve(walked_along(log))
        errors.append(ate(result.trajectory, log.truth()).summary()["translation_rmse_m"])
    assert np.mean(errors) < 0.03


def test_people_who_walk_along_are_not_the_world_where_there_is_little_else_to_see() -> None:
    """Three trunks 6 to 11 m away have fewer returns than one person: the robot seemed to stand still beside them."""
    trunks = tuple(pillar(x, y, 0.2, 12) for x, y in ((4.0, 8.0), (14.0, -7.0), (20.0, 9.0), (27.0, -6.0)))
    route = np.array([[0.0, 0.0], [24.0, 0.0], [24.0, 0.1]])
    laser = LaserModel("far", 541, math.radians(-135.0), math.radians(0.5), 0.1, 20.0, 0.01)
    log = SimulatedDataset(FloorPlan("trunks", "", trunks, route), seed=1, scans=150, laser=laser)
    result = Slam().solve(walked_along(log))
    assert ate(result.trajectory, log.truth()).summary()["translation_rmse_m"] < 1.0


@pytest.mark.parametrize("far", [0.0, 150.0, 1e6])
def test_free_space_is_known_as_far_as_the_raster_may_grow(far: float) -> None:
    bearings = np.linspace(-math.pi, math.pi, 360, endpoint=False)
    wall = 5.0 * np.column_stack((np.cos(bearings), np.sin(bearings)))
    person = np.where(np.abs(bearings)[:, None] < 0.1, 0.4 * wall, wall)
    space = FreeSpace()
    space.add(wall, np.zeros(3), np.zeros(3))
    there = pose(far, 0.0, 0.3)
    space.add(wall, np.zeros(3), there)
    known = far < 0.1 * MOST_CELLS
    assert len(space.outside(person, there)) == ((np.abs(bearings) >= 0.1).sum() if known else 360)
    assert len(space.outside(wall, there)) == 360


def test_many_keyframes_know_what_each_of_them_knows() -> None:
    log = SimulatedDataset("hall", scans=40)
    scans = list(log.scans())[::8]
    points, lasers = [s.robot_points for s in scans], [s.laser_pose for s in scans]
    poses = log.poses[::8]
    one_by_one = FreeSpace()
    for args in zip(points, lasers, poses, strict=True):
        one_by_one.add(*args)
    together = FreeSpace.seen_by(points, lasers, poses)
    bearings = np.linspace(0.0, 2.0 * math.pi, 20)
    person = 0.2 * np.column_stack((np.cos(bearings), np.sin(bearings)))
    ahead = compose(poses[0], pose(1.5, 0.0, 0.0))
    held = together.holds(person, ahead)
    assert held.all()
    np.testing.assert_array_equal(held, one_by_one.holds(person, ahead))
