"""Occupancy grids and their sharpness."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hsslam.datasets.simulator import SimulatedDataset
from hsslam.errors import DataError
from hsslam.mapping.occupancy import HIT, MISS, OccupancyGrid, build_grid
from hsslam.mapping.sharpness import sharpness
from hsslam.scan import LaserScan, ScanGeometry

AHEAD = ScanGeometry(angle_min=0.0, angle_increment=0.1, range_min=0.05, range_max=10.0)


def scan_of(
    *ranges: float, geometry: ScanGeometry = AHEAD, laser_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> LaserScan:
    return LaserScan(0.0, np.array(ranges), geometry, laser_pose=np.array(laser_pose))


def cell(grid: OccupancyGrid, x: float, y: float) -> float:
    column, row = np.floor((np.array([x, y]) - grid.origin) / grid.resolution).astype(int)
    return float(grid.log_odds[row, column])


def test_a_beam_frees_its_way_and_marks_its_end() -> None:
    grid = build_grid([scan_of(2.02)], np.zeros((1, 3)), 0.1)
    assert cell(grid, 2.02, 0.0) == pytest.approx(HIT)
    for x in np.arange(0.05, 1.95, 0.1):
        assert cell(grid, x, 0.05) == pytest.approx(MISS)
    assert cell(grid, 2.15, 0.05) == 0.0
    assert grid.visited.sum() == 21


def test_row_0_has_the_least_y() -> None:
    north = np.array([[0.0, 0.0, math.pi / 2]])
    grid = build_grid([scan_of(3.04)], north, 0.1)
    occupied_row, _ = np.argwhere(grid.log_odds > 0)[0]
    assert occupied_row > grid.shape[0] / 2
    assert grid.origin[1] + (occupied_row + 0.5) * 0.1 == pytest.approx(3.04, abs=0.06)


@pytest.mark.parametrize("nothing", [10.0, 81.9, math.inf])
def test_beams_without_a_return_free_space_only_on_request_and_up_to_the_limit(nothing: float) -> None:
    assert not build_grid([scan_of(nothing)], np.zeros((1, 3)), 0.1).visited.any()
    grid = build_grid([scan_of(nothing)], np.zeros((1, 3)), 0.1, no_return_range=2.0)
    assert cell(grid, 1.5, 0.05) == pytest.approx(MISS)
    assert grid.visited.sum() == 20
    assert (grid.log_odds <= 0).all()


@pytest.mark.parametrize("nonsense", [math.nan, 0.0, -1.0, 0.01, -math.inf])
def test_readings_that_mean_nothing_mark_nothing(nonsense: float) -> None:
    assert not build_grid([scan_of(nonsense)], np.zeros((1, 3)), 0.1, no_return_range=5.0).visited.any()


def test_scans_may_differ_in_beams_and_geometry() -> None:
    other = ScanGeometry(angle_min=math.pi, angle_increment=0.5, range_max=50.0)
    scans = [scan_of(1.02), scan_of(2.02, 2.02, geometry=other), scan_of(1.02), scan_of()]
    grid = build_grid(scans, np.zeros((4, 3)), 0.1)
    assert cell(grid, 1.02, 0.05) == pytest.approx(2 * HIT)
    assert cell(grid, -2.02, 0.05) + cell(grid, -2.02, -0.05) == pytest.approx(HIT)


def test_no_scans_give_an_unknown_grid() -> None:
    grid = build_grid([], np.zeros((0, 3)))
    assert not grid.visited.any()
    assert grid.log_odds.size > 0
    assert sharpness(grid).mean_entropy == 0.0


def test_what_cannot_be_mapped_is_refused() -> None:
    with pytest.raises(ValueError, match="one pose per scan"):
        build_grid([scan_of(1.0)], np.zeros((2, 3)))
    with pytest.raises(ValueError, match="finite"):
        build_grid([scan_of(1.0)], np.array([[0.0, math.nan, 0.0]]))
    with pytest.raises(ValueError, match="positive"):
        build_grid([scan_of(1.0)], np.zeros((1, 3)), 0.0)
    runaway = np.array([[0.0, 0.0, 0.0], [1e4, 1e4, 0.0]])
    with pytest.raises(DataError, match="ran away"):
        build_grid([scan_of(1.0)] * 2, runaway)


def test_a_map_from_true_poses_shows_the_walls_and_is_sharper_than_one_from_odometry() -> None:
    dataset = SimulatedDataset("office")
    scans = list(dataset.scans())
    truth, odometry = build_grid(scans, dataset.poses), build_grid(scans, dataset.odometry)
    rows, columns = np.nonzero(truth.probability > 0.65)
    centres = truth.origin + (np.column_stack((columns, rows)) + 0.5) * truth.resolution
    assert np.quantile(dataset.plan.clearance(centres), 0.99) < 0.06
    free = truth.probability < 0.35
    way = np.floor((dataset.poses[:, :2] - truth.origin) / truth.resolution).astype(int)
    assert free[way[:, 1], way[:, 0]].all()
    sharp, blurred = sharpness(truth), sharpness(odometry)
    assert sharp.mean_entropy < 0.9 * blurred.mean_entropy
    assert sharp.wall_area < blurred.wall_area


def test_sharpness_of_a_known_grid() -> None:
    log_odds = np.zeros((2, 3), dtype=np.float32)
    log_odds[0, 0], log_odds[0, 1] = 20.0, math.log(0.25 / 0.75)
    found = sharpness(OccupancyGrid(np.zeros(2), 0.5, log_odds))
    assert found.mean_entropy == pytest.approx(0.5 * 0.8112781, abs=1e-5)
    assert found.wall_area == pytest.approx(0.25)
    assert found.visited_area == pytest.approx(0.5)
