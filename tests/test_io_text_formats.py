from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.g2o import GraphEdge, read_g2o, write_g2o
from hsslam.io.points import read_points
from hsslam.io.trajectory_csv import read_trajectory_csv
from hsslam.io.tum import read_tum, write_tum
from hsslam.se2 import Poses
from hsslam.trajectory import Trajectory

coordinate = st.floats(-1000.0, 1000.0)
heading = st.floats(-math.pi, math.pi, exclude_max=True)
pose_lists = st.lists(st.tuples(coordinate, coordinate, heading), min_size=1, max_size=6)
quick = settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])


def assert_same_poses(a: Poses, b: Poses) -> None:
    np.testing.assert_allclose(a[:, :2], b[:, :2], atol=1e-8)
    turn = np.remainder(a[:, 2] - b[:, 2] + math.pi, 2 * math.pi) - math.pi
    np.testing.assert_allclose(turn, 0.0, atol=1e-8)


@given(poses=pose_lists, data=st.data())
@quick
def test_tum_round_trip(tmp_path: Path, poses: list[tuple[float, float, float]], data: st.DataObject) -> None:
    stamps = np.array([data.draw(st.floats(-1e9, 2e9)) for _ in poses])
    trajectory = Trajectory(stamps, np.array(poses), np.arange(len(poses)))
    write_tum(tmp_path / "t.tum", trajectory)
    back = read_tum(tmp_path / "t.tum")
    np.testing.assert_array_equal(back.stamps, stamps)
    np.testing.assert_array_equal(back.indices, np.arange(len(poses)))
    assert_same_poses(back.poses, trajectory.poses)
    assert (back.poses[:, 2] >= -math.pi).all() and (back.poses[:, 2] < math.pi).all()


def test_tum_lines_are_what_evo_expects(tmp_path: Path) -> None:
    trajectory = Trajectory(
        np.array([976052857.337284]), np.array([[1.0, -2.0, math.pi / 2]]), np.zeros(1, np.int64)
    )
    write_tum(tmp_path / "t.tum", trajectory)
    words = (tmp_path / "t.tum").read_text().split()
    assert len(words) == 8
    assert words[0] == "976052857.337284"
    np.testing.assert_allclose(
        [float(w) for w in words[1:]], [1, -2, 0, 0, 0, math.sqrt(0.5), math.sqrt(0.5)], atol=1e-9
    )


def test_tum_takes_the_yaw_of_a_tilted_pose(tmp_path: Path) -> None:
    # Half a turn about x: a yaw of 0 upside down.
    (tmp_path / "t.tum").write_text("# stamp ...\n\n1.5 1 2 3 1 0 0 0\n")
    back = read_tum(tmp_path / "t.tum")
    np.testing.assert_allclose(back.poses, [[1, 2, 0]], atol=1e-12)


def random_edges(rng: np.random.Generator, vertices: int, count: int) -> list[GraphEdge]:
    edges: list[GraphEdge] = []
    for _ in range(count):
        a = rng.normal(size=(3, 3))
        covariance = (a @ a.T + 0.1 * np.eye(3)) * rng.uniform(1e-4, 1.0)
        i, j = rng.integers(0, vertices, 2)
        edges.append((int(i), int(j), rng.uniform(-3, 3, 3), covariance))
    return edges


@example(poses=[(0.0, 0.0, 0.0)] * 2, seed=64965)
@given(poses=pose_lists, seed=st.integers(0, 10**6))
@quick
def test_g2o_round_trip(tmp_path: Path, poses: list[tuple[float, float, float]], seed: int) -> None:
    edges = random_edges(np.random.default_rng(seed), len(poses), 3)
    write_g2o(tmp_path / "g.g2o", np.array(poses), edges)
    back_poses, back_edges = read_g2o(tmp_path / "g.g2o")
    assert_same_poses(back_poses, np.array(poses))
    assert len(back_edges) == len(edges)
    for (i, j, relative, covariance), (bi, bj, back, bcov) in zip(edges, back_edges, strict=True):
        assert (i, j) == (bi, bj)
        assert_same_poses(back[None], relative[None])
        np.testing.assert_allclose(bcov, covariance, rtol=1e-5, atol=1e-9)


def test_g2o_information_is_in_the_frame_of_the_measured_pose(tmp_path: Path) -> None:
    # Sharp along x of the first pose; the second is turned by a quarter, so this is its y.
    covariance = np.diag([1e-4, 1e-2, 1e-3])
    write_g2o(tmp_path / "g.g2o", np.zeros((2, 3)), [(0, 1, np.array([1.0, 0.0, math.pi / 2]), covariance)])
    edge = (tmp_path / "g.g2o").read_text().splitlines()[-1].split()
    assert edge[:3] == ["EDGE_SE2", "0", "1"]
    np.testing.assert_allclose([float(w) for w in edge[6:]], [1e2, 0, 0, 1e4, 0, 1e3], rtol=1e-6, atol=1e-6)


def test_g2o_reads_as_gtsam_reads(tmp_path: Path, rng: np.random.Generator) -> None:
    gtsam = pytest.importorskip("gtsam")
    poses = rng.uniform(-3, 3, (4, 3))
    edges = [(k, k + 1, *edge[2:]) for k, edge in enumerate(random_edges(rng, 4, 3))]
    write_g2o(tmp_path / "g.g2o", poses, edges)
    graph, values = gtsam.readG2o(str(tmp_path / "g.g2o"), False)
    for k, pose in enumerate(poses):
        read = values.atPose2(k)
        np.testing.assert_allclose([read.x(), read.y(), read.theta()], pose, atol=1e-8)
    factors = {tuple(graph.at(k).keys()): graph.at(k) for k in range(graph.size())}
    for i, j, relative, covariance in edges:
        c, s = math.cos(relative[2]), math.sin(relative[2])
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        read_covariance = factors[(i, j)].noiseModel().covariance()
        np.testing.assert_allclose(read_covariance, turn.T @ covariance @ turn, rtol=1e-4, atol=1e-9)


def test_g2o_vertices_are_sorted_and_renumbered(tmp_path: Path) -> None:
    (tmp_path / "g.g2o").write_text(
        "VERTEX_SE2 20 2 0 0\nVERTEX_SE2 10 1 0 0\nFIX 10\nEDGE_SE2 10 20 1 0 0 1 0 0 1 0 1\n"
    )
    poses, ((i, j, _, covariance),) = read_g2o(tmp_path / "g.g2o")
    np.testing.assert_array_equal(poses[:, 0], [1, 2])
    assert (i, j) == (0, 1)
    np.testing.assert_allclose(covariance, np.eye(3))


def test_trajectory_csv(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("scan,x,y,theta\n0,1,2,0.5\n26,3,4,7.0\n")
    trajectory = read_trajectory_csv(tmp_path / "t.csv")
    np.testing.assert_array_equal(trajectory.indices, [0, 26])
    np.testing.assert_allclose(trajectory.poses, [[1, 2, 0.5], [3, 4, 7.0 - 2 * math.pi]])
    assert np.isnan(trajectory.stamps).all()
    stamped = read_trajectory_csv(tmp_path / "t.csv", np.linspace(0.0, 2.9, 30))
    np.testing.assert_allclose(stamped.stamps, [0.0, 2.6])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "x,y\n1,2\n3.5,-4\n"),
        ("a.csv", "1;2\n3.5;-4\n"),
        ("a.txt", "# points\n1 2\n\n3.5 -4\n"),
        ("a.xyz", "1 2 0\n3.5 -4 0\n"),
    ],
)
def test_points_from_text(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    np.testing.assert_array_equal(read_points(tmp_path / name), [[1, 2], [3.5, -4]])


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32])
def test_points_from_numpy(tmp_path: Path, dtype: type[np.generic]) -> None:
    points: NDArray[np.generic] = np.arange(6).reshape(3, 2).astype(dtype)
    np.save(tmp_path / "a.npy", points)
    np.savez(tmp_path / "one.npz", cloud=points)
    np.savez(tmp_path / "two.npz", other=np.zeros(3), points=np.column_stack((points, points)))
    for name in ("a.npy", "one.npz", "two.npz"):
        read = read_points(tmp_path / name)
        assert read.dtype == np.float64
        np.testing.assert_array_equal(read, points)


BAD_TEXT = [
    (read_tum, "t.tum", "", "no poses"),
    (read_tum, "t.tum", "1 2 3 0 0 0 0 1\n1 2 3\n", "t.tum:2: expected 8 numbers"),
    (read_tum, "t.tum", "1 2 x 0 0 0 0 1\n", "t.tum:1: expected finite numbers"),
    (read_tum, "t.tum", "1 2 nan 0 0 0 0 1\n", "t.tum:1: expected finite numbers"),
    (read_tum, "t.tum", "# c\n1 2 3 0 0 0 0 0\n", "t.tum:2: expected a quaternion"),
    (read_trajectory_csv, "t.csv", "", "found an empty file"),
    (read_trajectory_csv, "t.csv", "scan,x,y,theta\n", "no poses"),
    (read_trajectory_csv, "t.csv", "0,1,2,3\n", "t.csv:1: expected the header 'scan,x,y,theta'"),
    (read_trajectory_csv, "t.csv", "scan,x,y,theta\n0,1,2\n", "t.csv:2: expected 4 numbers"),
    (read_trajectory_csv, "t.csv", "scan,x,y,theta\n0,1,2,\n", "t.csv:2: expected finite numbers"),
    (read_trajectory_csv, "t.csv", "scan,x,y,theta\n0.5,1,2,3\n", "t.csv:2: expected a whole number"),
    (read_trajectory_csv, "t.csv", "scan,x,y,theta\n-1,1,2,3\n", "t.csv:2: expected a whole number"),
    (read_trajectory_csv, "t.csv", "scan,x,y,theta\n4,1,2,3\n4,1,2,3\n", "t.csv:3: scan 4 after scan 4"),
    (read_g2o, "g.g2o", "", "no vertices"),
    (read_g2o, "g.g2o", "VERTEX_SE2 0 1 2\n", "g.g2o:1: expected VERTEX_SE2 id x y theta"),
    (read_g2o, "g.g2o", "VERTEX_SE2 0 1 2 inf\n", "g.g2o:1: expected VERTEX_SE2 id x y theta"),
    (read_g2o, "g.g2o", "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 0 0 0 0\n", "g.g2o:2: vertex 0 is there already"),
    (read_g2o, "g.g2o", "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n", "g.g2o:1: expected VERTEX_SE2, EDGE_SE2"),
    (
        read_g2o,
        "g.g2o",
        "VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 7 0 0 0 1 0 0 1 0 1\n",
        "g.g2o:2: the edge names vertex 7",
    ),
    (read_g2o, "g.g2o", "VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 0 0 0 0 1 0 0 1 0\n", "g.g2o:2: expected EDGE_SE2"),
    (
        read_g2o,
        "g.g2o",
        "VERTEX_SE2 0 0 0 0\nEDGE_SE2 0 0 0 0 0 1 0 0 -1 0 1\n",
        "g.g2o:2: expected a positive",
    ),
    (read_points, "p.csv", "", "no points"),
    (read_points, "p.csv", "x,y\n", "no points"),
    (read_points, "p.csv", "1,2\nx,y\n", "p.csv:2: expected x and y"),
    (read_points, "p.csv", "x,y\nx,y\n", "p.csv:2: expected x and y"),
    (read_points, "p.csv", "1\n", "p.csv:1: expected x and y"),
    (read_points, "p.txt", "1 nan\n", "p.txt:1: expected x and y"),
    (read_points, "p.npy", "this is text", "cannot be read as a NumPy file"),
    (read_points, "p.npz", "this is text", "cannot be read as a NumPy file"),
    (read_points, "p.pcd", "1 2\n", "found suffix '.pcd'"),
]


@pytest.mark.parametrize(("reader", "name", "text", "reason"), BAD_TEXT)
def test_bad_file_is_one_clear_line(
    tmp_path: Path, reader: object, name: str, text: str, reason: str
) -> None:
    assert callable(reader)
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError) as caught:
        reader(tmp_path / name)
    assert reason in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("reader", [read_tum, read_g2o, read_trajectory_csv])
def test_absent_file(tmp_path: Path, reader: object) -> None:
    assert callable(reader)
    with pytest.raises(DataError, match="no such file"):
        reader(tmp_path / "none")


@pytest.mark.parametrize("name", ["none.csv", "none.npy"])
def test_absent_points(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_points(tmp_path / name)


@pytest.mark.parametrize("array", [np.zeros(5), np.zeros((3, 1)), np.array([["a", "b"]])])
def test_array_that_holds_no_points(tmp_path: Path, array: NDArray[np.generic]) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(DataError, match=r"expected an array of numbers of shape \(N, 2\)"):
        read_points(tmp_path / "a.npy")


def test_npz_of_several_arrays_needs_one_called_points(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", first=np.zeros((3, 2)), second=np.zeros((3, 2)))
    with pytest.raises(DataError, match="called 'points', found first, second"):
        read_points(tmp_path / "a.npz")


def test_scan_beyond_the_log(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("scan,x,y,theta\n3,1,2,0.5\n")
    with pytest.raises(DataError, match=r"t\.csv:2: names scan 3, but the log has 3 scans"):
        read_trajectory_csv(tmp_path / "t.csv", np.zeros(3))
