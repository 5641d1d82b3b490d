"""Occupancy grids against a Python twin, and maps as ROS reads them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from conftest import room_scan_at
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.mapping.occupancy import HIT, MISS, OccupancyGrid, build_grid
from hsslam.mapping.picture import write_map_png
from hsslam.mapping.rosmap import read_rosmap, write_rosmap
from hsslam.mapping.sharpness import sharpness
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import compose
from hsslam.trajectory import Trajectory


def line(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """Cells of Bresenham's line without the last one, in whole numbers throughout."""
    (x, y), (x1, y1) = start, end
    dx, dy = abs(x1 - x), abs(y1 - y)
    sx, sy = (1 if x1 > x else -1), (1 if y1 > y else -1)
    error, cells = dx - dy, []
    while (x, y) != (x1, y1):
        cells.append((x, y))
        doubled = 2 * error
        if doubled > -dy:
            error, x = error - dy, x + sx
        if doubled < dx:
            error, y = error + dx, y + sy
    return cells


def grid_twin(scans: list[LaserScan], poses: NDArray[np.float64], grid: OccupancyGrid) -> NDArray[np.float64]:
    """Log odds by the model in words: a return adds HIT, the cells before it MISS unless a return is in them."""
    out = np.zeros(grid.shape)

    first = np.round(grid.origin / grid.resolution)

    def cell(place: NDArray[np.float64]) -> tuple[int, int]:
        x, y = (np.floor(place / grid.resolution) - first).astype(int)
        return int(x), int(y)

    for scan, robot in zip(scans, poses, strict=True):
        laser = compose(robot, scan.laser_pose)
        angles = scan.geometry.angles(len(scan.ranges))[scan.valid] + laser[2]
        ends = laser[:2] + scan.ranges[scan.valid][:, None] * np.column_stack(
            (np.cos(angles), np.sin(angles))
        )
        hits = [cell(end) for end in ends]
        for x, y in hits:
            out[y, x] += HIT
        for hit in hits:
            for x, y in line(cell(laser[:2]), hit):
                if (x, y) not in hits:
                    out[y, x] += MISS
    return out


@given(
    st.lists(
        st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-3.0, 3.0)), min_size=1, max_size=3
    )
)
@settings(deadline=None, max_examples=15)
def test_grid_agrees_with_its_twin(poses: list[tuple[float, float, float]]) -> None:
    at = np.array(poses)
    scans = [room_scan_at(pose, beams=60) for pose in at]
    grid = build_grid(scans, at, 0.137)  # walls are not on the edges of cells
    twin = grid_twin(scans, at, grid)
    # An end on the edge between two cells may fall on either side.
    assert np.mean(np.abs(grid.log_odds - twin) > 1e-4) < 0.01


def test_walls_are_occupied_the_room_free_the_rest_unknown() -> None:
    pose = np.zeros(3)
    grid = build_grid([room_scan_at(pose)], pose[None], 0.05)

    def probability(x: float, y: float) -> float:
        column, row = np.floor((np.array([x, y]) - grid.origin) / grid.resolution).astype(int)
        return float(grid.probability[row, column])

    assert probability(4.001, 0.0) > 0.6
    assert probability(2.0, 0.5) < 0.45
    assert probability(4.3, 0.0) == 0.5


def test_laser_pose_is_composed_and_beams_are_cut() -> None:
    geometry = ScanGeometry(0.0, 0.1, range_max=10.0)
    scan = LaserScan(0.0, np.array([5.0]), geometry, laser_pose=np.array([1.0, 0.0, np.pi / 2]))
    grid = build_grid([scan], np.array([[0.0, 0.0, 0.0]]), 0.1)
    rows, columns = np.nonzero(grid.log_odds > 0)
    assert grid.origin + (np.array([columns[0], rows[0]]) + 0.5) * 0.1 == pytest.approx([1.0, 5.0], abs=0.06)
    assert not (build_grid([scan], np.zeros((1, 3)), 0.1, max_range=3.0).log_odds > 0).any()


def test_a_runaway_trajectory_is_refused() -> None:
    scans = [room_scan_at(np.zeros(3)), room_scan_at(np.zeros(3))]
    with pytest.raises(DataError, match="ran away"):
        build_grid(scans, np.array([[0.0, 0, 0], [1e6, 1e6, 0]]))
    with pytest.raises(ValueError, match="one pose per scan"):
        build_grid(scans, np.zeros((1, 3)))
    with pytest.raises(ValueError, match="finite"):
        build_grid(scans, np.full((2, 3), np.nan))


def read_as_ros_does(path: Path) -> tuple[NDArray[np.str_], float, list[float]]:
    """What map_server makes of a map: written from its documentation, not from our writer."""
    settings = yaml.safe_load(path.read_text())
    data = (path.parent / settings["image"]).read_bytes()
    magic, size, depth, pixels = data.split(b"\n", 3)
    assert (magic, depth) == (b"P5", b"255")
    columns, rows = map(int, size.split())
    shade = np.frombuffer(pixels, dtype=np.uint8).reshape(rows, columns)[::-1]
    occupancy = (255 - shade.astype(float)) / 255.0 if not settings["negate"] else shade / 255.0
    cells = np.full(shade.shape, "unknown", dtype="<U8")
    cells[occupancy > settings["occupied_thresh"]] = "occupied"
    cells[occupancy < settings["free_thresh"]] = "free"
    return cells, settings["resolution"], settings["origin"]


def test_ros_reads_what_we_write(tmp_path: Path) -> None:
    pose = np.zeros(3)
    grid = build_grid([room_scan_at(pose)] * 3, np.tile(pose, (3, 1)), 0.05)
    written = write_rosmap(tmp_path / "map", grid)
    cells, resolution, origin = read_as_ros_does(written)
    assert resolution == 0.05
    assert origin == pytest.approx([*grid.origin, 0.0])
    assert ((cells == "occupied") == (grid.probability > 0.65)).all()
    assert ((cells == "free") == (grid.probability < 0.35)).all()
    assert {"occupied", "free", "unknown"} == set(np.unique(cells))
    again = read_rosmap(tmp_path / "map")
    assert ((again.log_odds > 0) == (cells == "occupied")).all()
    assert ((again.log_odds < 0) == (cells == "free")).all()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("map.yaml", "resolution: [", "settings of a ROS map"),
        ("map.yaml", "image: map.pgm", "settings of a ROS map"),
        ("map.pgm", "P2\n2 2\n255\n0 0 0", "map.pgm"),
        ("map.pgm", "not a picture", "map.pgm"),
    ],
)
def test_a_broken_map_is_one_clear_line(tmp_path: Path, name: str, content: str, words: str) -> None:
    grid = OccupancyGrid(np.zeros(2), 0.1, np.ones((4, 5), dtype=np.float32))
    write_rosmap(tmp_path / "map", grid)
    (tmp_path / name).write_text(content)
    with pytest.raises(DataError, match=words) as caught:
        read_rosmap(tmp_path / "map.yaml")
    assert "\n" not in str(caught.value)


def test_a_doubled_wall_is_less_sharp() -> None:
    scans = [room_scan_at(np.zeros(3)) for _ in range(10)]
    right = np.zeros((10, 3))
    wrong = right + np.linspace(0.0, 0.3, 10)[:, None] * [1.0, 0.0, 0.3]
    sharp, blurred = (sharpness(build_grid(scans, poses)) for poses in (right, wrong))
    assert blurred.mean_entropy > sharp.mean_entropy
    assert blurred.wall_area > sharp.wall_area


def test_picture_needs_no_display_and_shows_loops(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    pose = np.zeros((1, 3))
    grid = build_grid([room_scan_at(pose[0])], pose)
    way = Trajectory(np.arange(3.0), np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]]), np.arange(3))
    plain, tied = tmp_path / "plain.png", tmp_path / "tied.png"
    write_map_png(plain, grid, way, title="room")
    write_map_png(tied, grid, way, np.array([[0.0, 0.0, 1.0, 1.0]]), title="room")
    assert plain.read_bytes().startswith(b"\x89PNG")
    assert plain.read_bytes() != tied.read_bytes()
