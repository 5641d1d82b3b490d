"""Floor plans, ray casting, lasers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hsslam.datasets.simulator import LASERS, floor_plan, laser_model, raycast
from hsslam.datasets.simulator.floorplan import FloorPlan
from hsslam.datasets.simulator.solids import box, rectangle, wall
from hsslam.errors import ConfigError
from hsslam.scan import LaserScan, ScanGeometry

FULL_TURN = ScanGeometry(angle_min=-math.pi, angle_increment=math.radians(2.0))


def test_raycast_of_a_square_room_is_exact_and_leaks_nowhere() -> None:
    room = FloorPlan("room", "", (rectangle(-2.0, -1.0, 2.0, 1.0),), np.zeros((2, 2)))
    corners = np.arctan2([1.0, 1.0, -1.0, -1.0], [2.0, -2.0, -2.0, 2.0])
    for corner in corners:
        # Beams that run exactly into a corner.
        found = raycast(room.segments, np.array([0.0, 0.0, corner]), ScanGeometry(0.0, 0.5), 1)
        assert found[0] == pytest.approx(math.sqrt(5.0))
    quarter = raycast(room.segments, np.zeros(3), ScanGeometry(-math.pi / 2, math.pi / 2), 4)
    np.testing.assert_allclose(quarter, [1.0, 2.0, 1.0, 2.0])


def test_raycast_of_many_poses_is_one_row_a_pose() -> None:
    plan = floor_plan("hall")
    poses = np.array([[3.0, 3.2, 0.0], [12.0, 3.2, 1.0]])
    many = raycast(plan.segments, poses, FULL_TURN, 90)
    assert many.shape == (2, 90)
    np.testing.assert_array_equal(many[1], raycast(plan.segments, poses[1], FULL_TURN, 90))


@pytest.mark.parametrize("geometry", [ScanGeometry(0.0, -0.01), ScanGeometry(0.0, 0.1)])
def test_raycast_refuses_beams_that_run_backwards_or_round_again(geometry: ScanGeometry) -> None:
    with pytest.raises(ValueError, match="counter-clockwise"):
        raycast(np.zeros((1, 4)), np.zeros(3), geometry, 180)


def test_a_beam_without_anything_ahead_is_infinite() -> None:
    wall_behind = np.array([[-1.0, -5.0, -1.0, 5.0]])
    assert np.isinf(raycast(wall_behind, np.zeros(3), ScanGeometry(0.0, 0.1), 1)[0])


def test_clearance_and_inside_of_a_box() -> None:
    plan = FloorPlan("box", "", (box(1.0, 0.0, 2.0, 1.0, 90.0),), np.zeros((2, 2)))
    points = np.array([[1.0, 0.0], [2.5, 0.0], [1.0, 0.9], [1.0, 2.0]])
    np.testing.assert_array_equal(plan.inside_solid(points), [True, False, True, False])
    np.testing.assert_allclose(plan.clearance(points), [0.5, 1.0, 0.1, 1.0])


def test_an_open_door_can_be_passed_and_a_closed_one_cannot() -> None:
    pieces = wall("y", 3.0, 0.0, 10.0, [(2.0, 1.0, "open"), (7.0, 1.0, "closed")])
    plan = FloorPlan("wall", "", tuple(pieces), np.zeros((2, 2)))
    inside = plan.inside_solid(np.array([[3.0, 2.0], [3.0, 7.0], [3.05, 7.0], [3.0, 5.0], [3.05, 5.0]]))
    np.testing.assert_array_equal(inside, [False, True, False, True, True])


def test_presets_have_the_figures_of_their_data_sheets() -> None:
    sick, urg = laser_model("sick-lms200"), laser_model("urg-04lx")
    assert (sick.beams, sick.range_max) == (180, 80.0)
    assert math.degrees(sick.angle_min) == pytest.approx(-90.0)
    assert (urg.beams, urg.range_min, urg.range_max) == (682, 0.06, 4.0)
    assert math.degrees(urg.field_of_view) == pytest.approx(239.4, abs=0.1)


def test_readings_scatter_as_the_model_says() -> None:
    model = replace(LASERS["urg-04lx"], drop_out=0.0, resolution=0.0)
    rng = np.random.default_rng(1)
    near = model.measure(np.full(20_000, 0.5), rng) - 0.5
    far = model.measure(np.full(20_000, 3.0), rng) - 3.0
    assert abs(near.mean()) < 0.001
    assert near.std() == pytest.approx(0.01, rel=0.05)
    assert far.std() == pytest.approx(0.03, rel=0.05)


def test_no_return_reads_as_the_maximum_or_more_and_makes_no_point() -> None:
    model = laser_model("sick-lms200")
    readings = model.measure(np.array([np.inf, 79.0, 0.01, 85.0, 5.0]), np.random.default_rng(0))
    assert (readings[[0, 2, 3]] >= model.range_max).all()
    assert LaserScan(0.0, readings, model.geometry).valid.tolist() == [False, True, False, False, True]


def test_fewer_beams_keep_the_field_of_view() -> None:
    urg = laser_model("urg-04lx")
    few = urg.with_beams(171)
    assert few.beams == 171
    assert few.field_of_view == pytest.approx(urg.field_of_view)
    assert few.angle_min == urg.angle_min


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"beams": 1}, "beams"),
        ({"angle_increment": -0.1}, "angle_increment"),
        ({"angle_increment": 0.1}, "once around"),
        ({"range_min": 90.0}, "range_min"),
        ({"range_noise": -1.0}, "noise"),
        ({"drop_out": 1.5}, "drop_out"),
        ({"no_return": 1.0}, "no_return"),
    ],
)
def test_an_impossible_laser_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        replace(laser_model("sick-lms200"), **change)
