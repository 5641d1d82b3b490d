"""The run folder: what is in it, who may write to it, and what a run that died leaves."""

from __future__ import annotations

import csv
import json
import platform
from pathlib import Path

import numpy as np
import pytest
import yaml

from hsslam.config import Config, load_config
from hsslam.environment import environment
from hsslam.errors import ConfigError, DataError
from hsslam.io.g2o import read_g2o
from hsslam.io.tum import read_tum
from hsslam.mapping.rosmap import read_rosmap
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.slam.events import Edge, LoopChecked, SlamResult, Tracked
from hsslam.slam.folder import FILES, RunFolder
from hsslam.slam.journal import Header
from hsslam.trajectory import Trajectory

HEADER = Header({"source": "office"}, {"seed": 0})


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config()


@pytest.fixture(scope="module")
def result() -> SlamResult:
    """Three scans in a square room of 4 m, each a keyframe, and a loop from the last to the first."""
    geometry = ScanGeometry(-np.pi, np.pi / 90.0, range_max=20.0)
    angles = geometry.angles(180)
    ranges = 2.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    stamps = np.array([10.25, 10.25, 10.1])  # stamps of real logs repeat and step back
    poses = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [0.2, 0.1, -3.0]])
    scans = [LaserScan(stamps[i], ranges, geometry, poses[i], index=i) for i in range(3)]
    loop = LoopChecked(0, 2, True, "", poses[2], np.eye(3) * 1e-4, 0.9, 10)
    lonely = LoopChecked(
        1,
        2,
        False,
        "0 other loops agree with it, not 2",
        poses[1],
        np.eye(3) * 4e-4,
        0.8,
        20,
        expected_std=0.5,
    )
    edges = [
        Edge(0, 1, poses[1], np.diag([1e-4, 2e-4, 3e-4]), "odometry"),
        Edge(1, 2, np.array([0.1, 0.1, 3.0]), np.eye(3) * 1e-4, "odometry"),
        Edge(0, 2, poses[2], np.eye(3) * 1e-4, "loop"),
    ]
    trajectory = Trajectory(stamps, poses, np.arange(3))
    odometry = Trajectory(stamps, poses + 0.01, np.arange(3))
    return SlamResult(
        trajectory, trajectory, odometry, scans, poses, edges, [loop, lonely], 3, {"track": 0.1}
    )


def files(folder: RunFolder) -> set[str]:
    return {path.name for path in folder.path.iterdir()}


def test_a_finished_run_leaves_every_file_and_they_read_back(
    tmp_path: Path, config: Config, result: SlamResult
) -> None:
    folder = RunFolder.create(tmp_path / "run", "room", "hide")
    with folder.begin(HEADER, config):
        folder.write_result(result, config, title="room")
    folder.write_json("metrics.json", {"scans": 3})
    folder.write_json("timings.json", {"wall_s": 1.5})
    assert files(folder) == set(FILES)
    trajectory = read_tum(folder.path / "trajectory.tum")
    assert trajectory.stamps.tolist() == result.trajectory.stamps.tolist()
    np.testing.assert_allclose(trajectory.poses, result.trajectory.poses, atol=1e-8)
    np.testing.assert_allclose(read_tum(folder.path / "odometry.tum").poses, result.odometry.poses, atol=1e-8)
    poses, edges = read_g2o(folder.path / "graph.g2o")
    np.testing.assert_allclose(poses, result.keyframe_poses, atol=1e-8)
    assert [(edge[0], edge[1]) for edge in edges] == [(0, 1), (1, 2), (0, 2)]
    grid = read_rosmap(folder.path / "map.yaml")
    assert grid.resolution == config.map.resolution
    with (folder.path / "loops.csv").open(newline="") as file:
        accepted, refused = csv.DictReader(file)
    assert (accepted["first"], accepted["second"], accepted["accepted"]) == ("0", "2", "1")
    assert (refused["accepted"], refused["reason"]) == ("0", "0 other loops agree with it, not 2")
    assert float(refused["std_x"]) == pytest.approx(0.02)
    assert float(refused["expected_std"]) == 0.5
    assert (folder.path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((folder.path / "metrics.json").read_text()) == {"scans": 3}
    resolved = load_config(folder.path / "config.yaml")
    assert resolved.model_dump() == config.model_dump()


def test_a_run_that_died_leaves_what_resumes_it(tmp_path: Path, config: Config) -> None:
    folder = RunFolder.create(tmp_path / "run", "room", "hide")
    journal = folder.begin(HEADER, config)
    journal.write(Tracked(0, 1.0, np.zeros(3), 0, np.zeros(3), np.eye(3), 1.0, True, 0))
    journal.close()
    assert files(folder) == {"config.yaml", "environment.json", "journal.jsonl"}
    again = RunFolder.resume(folder.path)
    assert again.replay is not None
    assert set(again.replay.tracked) == {0}
    again.begin(HEADER, config).close()
    with pytest.raises(ConfigError, match=r"dataset\.source was 'office', now 'hall'"):
        again.begin(Header({"source": "hall"}, HEADER.config), config)


@pytest.mark.parametrize("name", ["config.yaml", "journal.jsonl", "map.pgm", "trajectory.tum"])
def test_another_run_is_not_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("precious")
    with pytest.raises(DataError, match=f"holds a run already \\({name}\\)"):
        RunFolder.create(tmp_path, "room", "hide")
    assert (tmp_path / name).read_text() == "precious"


def test_a_folder_of_other_things_may_take_a_run(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert RunFolder.create(tmp_path, "room", "hide").path == tmp_path


def test_folders_without_a_name_differ(tmp_path: Path) -> None:
    made = {RunFolder.create(None, "room", "hide", root=tmp_path).path for _ in range(3)}
    assert len(made) == 3
    assert all("-room-hide" in path.name and path.is_dir() for path in made)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("")
    with pytest.raises(DataError, match="is a file"):
        RunFolder.create(tmp_path / "run", "room", "hide")
    with pytest.raises(DataError, match="cannot be made"):
        RunFolder.create(tmp_path / "run" / "deeper", "room", "hide")


def test_nothing_to_resume(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no run to resume"):
        RunFolder.resume(tmp_path)


def test_a_failed_write_leaves_no_half_file(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path / "run", "room", "hide")
    with pytest.raises(TypeError):
        folder.write_json("metrics.json", {"a": 1, "b": object()})
    assert files(folder) == set()


def test_environment_is_plain_json_and_names_what_computes() -> None:
    told = environment()
    assert json.loads(json.dumps(told)) == told
    assert told["python"] == platform.python_version()
    assert {"numpy", "numba", "gtsam"} <= set(told["packages"])
    assert told["cpu"]
    assert told["cores"] >= 1


def test_config_yaml_is_safe_yaml(tmp_path: Path, config: Config) -> None:
    folder = RunFolder.create(tmp_path / "run", "room", "hide")
    folder.begin(HEADER, config).close()
    assert yaml.safe_load((folder.path / "config.yaml").read_text())["seed"] == config.seed
