"""`hsslam convert`, judged by the tools that are to open what it makes."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from typer.testing import CliRunner, Result

from hsslam.cli.main import app
from hsslam.datasets.catalogue import open_dataset
from hsslam.io.kitti import read_kitti, write_kitti
from hsslam.io.trajectories import detect_trajectory, read_trajectory
from hsslam.io.tum import read_tum
from hsslam.matching import MatcherUnavailableError, create
from hsslam.trajectory import Trajectory

SCANS = 60


def hsslam(*args: str | Path | int) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def ok(*args: str | Path | int) -> str:
    result = hsslam(*args)
    assert result.exit_code == 0, result.output
    return result.stdout


def refused(*args: str | Path | int) -> str:
    result = hsslam(*args)
    assert result.exit_code in (2, 3), result.output
    assert result.stderr.count("\n") == 1
    return result.stderr


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    ok("convert", "office", folder / "office.clf", "--scans", SCANS, "--quiet")
    ok("run", folder / "office.clf", "--out", folder / "run", "--quiet")
    return folder / "run"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.clf.bz2", ()),
        ("a.bag", ()),
        ("a.mcap", ()),
        ("a.db3", ()),
        ("a", ("--to", "ros2")),
        ("a", ("--to", "mcap")),
        ("a.csv", ()),
        ("a.npz", ()),
    ],
)
def test_a_log_goes_there_and_back_and_takes_its_truth_along(
    tmp_path: Path, name: str, options: tuple[str, ...]
) -> None:
    said = ok("convert", "corridor", tmp_path / name, "--scans", 12, "--quiet", *options)
    assert said == ""
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "a.truth.tum"])
    assert f"{tmp_path / 'b.clf'}: 12 scans" in ok("convert", tmp_path / name, tmp_path / "b.clf")
    first, second = (
        list(open_dataset(source, scans=12).scans()) for source in ("corridor", tmp_path / "b.clf")
    )
    for a, b in zip(first, second, strict=True):
        assert a.stamp == b.stamp
        np.testing.assert_allclose(a.points, b.points, atol=1e-5)
        np.testing.assert_allclose(a.odometry, b.odometry, atol=1e-12)
    truth = open_dataset(tmp_path / "b.clf").truth()
    assert truth is not None and len(truth) == 12


def test_relations_go_along(shared_data: Path, tmp_path: Path) -> None:
    # The first relation between two scans of the first 400 comes at 267.
    ok("convert", "intel", tmp_path / "intel.bag", "--scans", 400, "--data-dir", shared_data, "--quiet")
    log = open_dataset("intel", data_dir=shared_data, scans=400)
    wanted, found = log.relations(), open_dataset(tmp_path / "intel.bag").relations()
    assert wanted is not None and found is not None and len(found) == len(wanted) > 0
    assert found.first.tolist() == wanted.first.tolist()
    np.testing.assert_allclose(found.poses, wanted.poses, atol=1e-8)
    assert "Haehnel" in open_dataset(tmp_path / "intel.bag").info.attribution


def test_the_odometry_of_a_log_is_a_trajectory(tmp_path: Path) -> None:
    ok("convert", "hall", tmp_path / "odometry.tum", "--scans", 9, "--quiet")
    odometry = [scan.odometry for scan in open_dataset("hall", scans=9).scans()]
    np.testing.assert_allclose(read_tum(tmp_path / "odometry.tum").poses, odometry, atol=1e-8)


def test_tum_and_kitti_open_in_evo(run: Path, tmp_path: Path) -> None:
    from evo.tools import file_interface

    for name in ("t.tum", "t.kitti"):
        ok("convert", run, tmp_path / name)
    tum = file_interface.read_tum_trajectory_file(str(tmp_path / "t.tum"))
    kitti = file_interface.read_kitti_poses_file(str(tmp_path / "t.kitti"))
    truth = read_tum(run / "trajectory.tum")
    np.testing.assert_array_equal(tum.timestamps, truth.stamps)
    for opened in (tum, kitti):
        assert opened.check()[0]
        np.testing.assert_allclose(opened.positions_xyz[:, :2], truth.poses[:, :2], atol=1e-8)
        yaw = opened.get_orientations_euler("sxyz")[:, 2]
        np.testing.assert_allclose(np.remainder(yaw - truth.poses[:, 2] + 1, 2 * np.pi), 1.0, atol=1e-8)


def test_the_graph_opens_in_gtsam(run: Path, tmp_path: Path) -> None:
    import gtsam

    ok("convert", run, tmp_path / "g.g2o")
    graph, values = gtsam.readG2o(str(tmp_path / "g.g2o"), False)
    assert values.size() > 5
    assert graph.size() >= values.size() - 1
    assert graph.error(values) < 10.0 * graph.size()


def test_trajectories_convert_among_one_another(run: Path, tmp_path: Path) -> None:
    truth = read_tum(run / "trajectory.tum")
    ok("convert", run, tmp_path / "a.csv")
    ok("convert", tmp_path / "a.csv", tmp_path / "b.kitti")
    assert "TUM has stamps" in refused("convert", tmp_path / "b.kitti", tmp_path / "c.tum")
    assert not (tmp_path / "c.tum").exists()
    ok("convert", tmp_path / "b.kitti", tmp_path / "c.tum", "--stamps", run.parent / "office.clf")
    back = read_tum(tmp_path / "c.tum")
    np.testing.assert_array_equal(back.stamps, truth.stamps)
    np.testing.assert_allclose(back.poses, truth.poses, atol=1e-8)
    ok("convert", tmp_path / "c.tum", tmp_path / "d.txt", "--to", "kitti")
    assert detect_trajectory(tmp_path / "d.txt") == "kitti"
    np.testing.assert_allclose(read_trajectory(tmp_path / "d.txt").poses, truth.poses, atol=1e-8)
    assert "the log has 5 scans" in refused(
        "convert", tmp_path / "a.csv", tmp_path / "e.tum", "--stamps", short_log(tmp_path)
    )


def short_log(folder: Path) -> Path:
    ok("convert", "hall", folder / "short.clf", "--scans", 5, "--quiet")
    return folder / "short.clf"


def load_as_map_server(path: Path) -> tuple[NDArray[np.int8], float, list[float]]:
    """A map as map_server publishes it (trinary mode), from the map_server page of the ROS wiki, line by line.

    Occupancy p of a pixel v is (255 - v) / 255, or v / 255 with negate; over occupied_thresh the cell is 100, under
    free_thresh 0, else -1. The message's first cell is the lower left one, at the origin; rows go along y.
    """
    told = yaml.safe_load(path.read_text())
    assert {"image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"} <= set(told)
    assert told.get("mode", "trinary") == "trinary" and len(told["origin"]) == 3
    raw = (path.parent / told["image"]).read_bytes()
    magic, width, height, depth = raw.split(maxsplit=4)[:4]
    assert (magic, int(depth)) == (b"P5", 255)
    pixels = np.frombuffer(raw[-int(width) * int(height) :], np.uint8).reshape(int(height), int(width))
    p = pixels / 255.0 if told["negate"] else (255.0 - pixels) / 255.0
    cells = np.full(p.shape, -1, dtype=np.int8)
    cells[p > told["occupied_thresh"]] = 100
    cells[p < told["free_thresh"]] = 0
    return cells[::-1], float(told["resolution"]), list(told["origin"])


@pytest.mark.parametrize(("name", "options"), [("lab.pgm", ()), ("lab.yaml", ()), ("lab", ("--to", "map"))])
def test_the_map_loads_by_the_rules_of_map_server(
    run: Path, tmp_path: Path, name: str, options: tuple[str]
) -> None:
    ok("convert", run, tmp_path / name, *options)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["lab.pgm", "lab.yaml"]
    check_map(run, tmp_path / "lab.yaml")


def check_map(run: Path, path: Path) -> None:
    """Walls are where the scans hit, free cells where the robot drove, and what nobody saw is unknown."""
    cells, resolution, origin = load_as_map_server(path)
    assert resolution == 0.05 and origin[2] == 0.0
    assert {-1, 0, 100} == set(np.unique(cells))

    def at(points: NDArray[np.float64]) -> NDArray[np.int8]:
        column, row = np.floor((points - origin[:2]) / resolution).astype(int).T
        values: NDArray[np.int8] = cells[row, column]
        return values

    trajectory = read_tum(run / "trajectory.tum")
    assert (at(trajectory.poses[:, :2]) == 0).all()
    log = list(open_dataset(run.parent / "office.clf").scans())
    from hsslam.se2 import transform

    # Every keyframe's returns went into the map; the first scan is a keyframe.
    hits = at(transform(trajectory.poses[0], log[0].robot_points))
    assert (hits == 100).mean() > 0.8
    assert cells[0, 0] == -1


def test_a_folder_as_slam_toolbox_has_it_but_for_what_is_not_documented(run: Path, tmp_path: Path) -> None:
    said = ok("convert", run, tmp_path / "lab", "--to", "slam-toolbox")
    assert "map.posegraph and map.data are not written" in said
    assert sorted(p.name for p in (tmp_path / "lab").iterdir()) == ["map.pgm", "map.yaml"]
    check_map(run, tmp_path / "lab" / "map.yaml")


def test_the_point_map_is_what_the_keyframes_saw(run: Path, tmp_path: Path) -> None:
    ok("convert", run, tmp_path / "points.ply")
    raw = (tmp_path / "points.ply").read_bytes()
    head, body = raw.split(b"end_header\n", 1)
    assert head.startswith(b"ply\nformat binary_little_endian 1.0\n")
    count = int(head.split(b"element vertex ")[1].split()[0])
    vertices = list(struct.iter_unpack("<dddi", body))
    assert len(vertices) == count > 1000
    cells, resolution, origin = load_as_map_server(run / "map.yaml")
    points = np.array([vertex[:2] for vertex in vertices])
    column, row = np.floor((points - origin[:2]) / resolution).astype(int).T
    assert (cells[row, column] == 100).mean() > 0.7
    assert {vertex[2] for vertex in vertices} == {0.0}
    scans = {vertex[3] for vertex in vertices}
    events = [json.loads(line).get("event") for line in (run / "journal.jsonl").read_text().splitlines()]
    assert 0 in scans and len(scans) == events.count("keyframe")


def test_the_point_map_opens_in_open3d(run: Path, tmp_path: Path) -> None:
    try:
        create("icp")  # which finds the libraries that Open3D needs
    except MatcherUnavailableError as error:
        pytest.skip(str(error))
    import open3d

    ok("convert", run, tmp_path / "points.ply")
    cloud = open3d.io.read_point_cloud(str(tmp_path / "points.ply"))
    assert len(cloud.points) > 1000


def test_the_picture_comes_out_too(run: Path, tmp_path: Path) -> None:
    ok("convert", run, tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes() == (run / "map.png").read_bytes()


def test_a_log_that_is_gone_is_one_line(tmp_path: Path) -> None:
    log = short_log(tmp_path)
    ok("run", log, "--out", tmp_path / "run", "--quiet")
    log.unlink()
    assert "the points are in the log that was run, and it is not to be found" in refused(
        "convert", tmp_path / "run", tmp_path / "points.ply"
    )


@pytest.mark.parametrize(
    ("source", "out", "options", "said"),
    [
        ("office", "a.foo", (), "the name does not tell the format; give --to"),
        ("office", "a.foo", ("--to", "rosbag"), "--to is one of carmen, ros1"),
        ("office", "a.gfs", (), "hsslam reads it and does not write it"),
        ("office", "a.g2o", (), "run it first"),
        ("nothing.bag", "a.csv", (), "nothing.bag: no such file"),
        ("offise", "a.csv", (), "did you mean 'office'?"),
        ("office", "taken.csv", (), "is there already and is not overwritten"),
        ("RUN", "a.bag", (), "a run folder holds no log"),
        ("TUM", "a.bag", (), "a trajectory is converted to tum, kitti, csv, not to ros1"),
        ("TUM", "a.ply", (), "a trajectory is converted to tum, kitti, csv, not to ply"),
    ],
)
def test_what_cannot_be_converted_is_one_line(
    run: Path, tmp_path: Path, source: str, out: str, options: tuple[str, ...], said: str
) -> None:
    (tmp_path / "taken.csv").write_text("precious")
    named = {"RUN": run, "TUM": run / "trajectory.tum"}.get(source, source)
    assert said in refused("convert", named, tmp_path / out, "--quiet", *options)
    assert (tmp_path / "taken.csv").read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == ["taken.csv"]


def test_kitti_refuses_what_is_no_rotation(tmp_path: Path) -> None:
    trajectory = Trajectory(np.zeros(2), np.array([[1.0, 2.0, 3.0], [1.0, 2.0, -3.0]]), np.arange(2))
    write_kitti(tmp_path / "a.kitti", trajectory)
    back = read_kitti(tmp_path / "a.kitti")
    np.testing.assert_allclose(back.poses, trajectory.poses, atol=1e-8)
    assert np.isnan(back.stamps).all()
    (tmp_path / "b.kitti").write_text("1 0 0 1 0 1 0 2 0 0 1 0\n2 0 0 1 0 1 0 2 0 0 1 0\n")
    with pytest.raises(Exception, match=r"b\.kitti:2: expected a rotation"):
        read_kitti(tmp_path / "b.kitti")


def test_topics_are_asked_for_on_the_command_line(tmp_path: Path) -> None:
    ok("convert", "hall", tmp_path / "a.bag", "--scans", 5, "--quiet")
    told = ok("datasets", "info", tmp_path / "a.bag", "--odom-topic", "tf", "--quiet")
    assert "odometry from tf (odom to base_link)" in told
    assert "there are: /scan (5)" in refused("run", tmp_path / "a.bag", "--scan-topic", "/front", "--quiet")
    ran = ok("run", tmp_path / "a.bag", "--odom-topic", "none", "--out", tmp_path / "r")
    assert "odometry from none" in ran
    # A run that died goes on with the topics it began with.
    assert hsslam("run", "--resume", tmp_path / "r", "--quiet").exit_code == 0
    assert "dataset.source was" in refused("run", "--resume", tmp_path / "r", "--odom-topic", "/odom")
