"""ROS maps and pictures."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from hsslam.datasets.simulator import SimulatedDataset
from hsslam.mapping.occupancy import OccupancyGrid, build_grid
from hsslam.mapping.picture import draw_map, write_map_png
from hsslam.mapping.rosmap import read_rosmap, write_rosmap
from hsslam.trajectory import Trajectory

SURE = 4.0


def test_pixels_are_the_ones_ros_writes(tmp_path: Path) -> None:
    log_odds = np.array([[SURE, -SURE, 0.0]], dtype=np.float32)
    write_rosmap(tmp_path / "deep" / "office.v2", OccupancyGrid(np.zeros(2), 0.1, log_odds))
    assert (tmp_path / "deep" / "office.v2.pgm").read_bytes() == b"P5\n3 1\n255\n" + bytes([0, 254, 205])
    assert sorted(p.name for p in (tmp_path / "deep").iterdir()) == ["office.v2.pgm", "office.v2.yaml"]


def test_the_first_row_of_the_picture_is_the_top(tmp_path: Path) -> None:
    log_odds = np.array([[0.0], [SURE]], dtype=np.float32)
    write_rosmap(tmp_path / "map", OccupancyGrid(np.zeros(2), 0.1, log_odds))
    assert (tmp_path / "map.pgm").read_bytes()[-2:] == bytes([0, 205])


def test_a_map_by_others_is_read(tmp_path: Path) -> None:
    (tmp_path / "x.pgm").write_bytes(b"P5\n# CREATOR: map_saver\n2 1\n# more\n255\n" + bytes([0, 255]))
    (tmp_path / "x.yaml").write_text(
        "image: x.pgm\nresolution: 0.05\norigin: [-1, -2, 0]\nnegate: 1\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    grid = read_rosmap(tmp_path / "x.yaml")
    assert np.sign(grid.log_odds).tolist() == [[-1.0, 1.0]]


@pytest.fixture(scope="module")
def mapped() -> tuple[OccupancyGrid, Trajectory]:
    dataset = SimulatedDataset("corridor", scans=80)
    return build_grid(list(dataset.scans()), dataset.poses), dataset.truth()


def test_a_picture_is_drawn_without_a_display_or_pyplot(
    tmp_path: Path, mapped: tuple[OccupancyGrid, Trajectory], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.delenv("DISPLAY", raising=False)
    grid, truth = mapped
    had_pyplot = "matplotlib.pyplot" in sys.modules
    path = tmp_path / "pictures" / "map.png"
    write_map_png(path, grid, truth, [(1.0, 1.0, 3.0, 1.2)], "corridor")
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert ("matplotlib.pyplot" in sys.modules) == had_pyplot
    write_map_png(path, grid)
    assert [p.name for p in path.parent.iterdir()] == ["map.png"]


def test_what_is_drawn_is_in_metres_and_labelled(mapped: tuple[OccupancyGrid, Trajectory]) -> None:
    from matplotlib.figure import Figure

    grid, truth = mapped
    axes = Figure().add_subplot()
    draw_map(axes, grid, truth, np.array([[1.0, 1.0, 3.0, 1.2]]))
    assert axes.get_xlabel() == "x (m)"
    assert axes.get_ylabel() == "y (m)"
    assert axes.images[0].get_extent() == pytest.approx(grid.extent)
    assert axes.images[0].origin == "lower"
    _, labels = axes.get_legend_handles_labels()
    assert labels == ["trajectory", "start", "end", "loop closures (1)"]
    np.testing.assert_array_equal(axes.lines[0].get_xydata(), truth.poses[:, :2])


def test_occupied_is_dark_free_is_light_and_unknown_between(mapped: tuple[OccupancyGrid, Trajectory]) -> None:
    from matplotlib.figure import Figure

    grid = OccupancyGrid(np.zeros(2), 1.0, np.array([[SURE, 0.0, -SURE]], dtype=np.float32))
    axes = Figure().add_subplot()
    draw_map(axes, grid)
    (picture,) = axes.images
    occupied, unknown, free = np.asarray(picture.to_rgba(picture.get_array()))[0, :, 0]
    assert occupied < 0.1 < unknown < 0.9 < free


def test_drawing_takes_little_memory(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    grid = OccupancyGrid(np.zeros(2), 0.05, rng.normal(size=(1000, 1000)).astype(np.float32))
    write_map_png(tmp_path / "first.png", grid)  # imports are none of it
    tracemalloc.start()
    write_map_png(tmp_path / "second.png", grid)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 50e6
