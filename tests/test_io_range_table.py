"""Tables of ranges (CSV, NPZ) and GMapping's .gfs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hsslam.errors import DataError
from hsslam.io.gfs import read_gfs
from hsslam.io.log_statistics import LogStatistics
from hsslam.io.logs import FORMATS, by_suffix, detect, log_stem, read_log, write_log
from hsslam.io.range_table import read_range_csv, read_range_npz, write_range_csv, write_range_npz
from hsslam.scan import LaserScan, ScanGeometry

quick = settings(deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
HEAD = "# angle_min=-1.5 angle_increment=0.5 range_max=10\nstamp,x,y,theta,r0,r1,r2\n"

number = st.floats(-1e3, 1e3)
reading = st.floats(allow_nan=True, allow_infinity=True, width=64)


def assert_same(a: LaserScan, b: LaserScan) -> None:
    """To the last bit; NaN equals NaN."""
    assert (a.stamp, a.index, a.geometry) == (b.stamp, b.index, b.geometry)
    np.testing.assert_array_equal(a.ranges, b.ranges)
    np.testing.assert_array_equal(a.odometry, b.odometry)
    np.testing.assert_array_equal(a.laser_pose, b.laser_pose)


Reader = Callable[[Path], Iterator[LaserScan]]
Writer = Callable[[Path, list[LaserScan]], int]
TABLES: list[tuple[str, Reader, Writer]] = [
    ("t.csv", read_range_csv, write_range_csv),
    ("t.csv.gz", read_range_csv, write_range_csv),
    ("t.npz", read_range_npz, write_range_npz),
]


@pytest.mark.parametrize(("name", "read", "write"), TABLES, ids=lambda value: str(value)[:8])
@given(
    rows=st.lists(st.tuples(number, number, number, st.floats(-math.pi, 3.14)), min_size=1, max_size=4),
    data=st.data(),
)
@quick
def test_a_table_gives_back_what_was_written(
    tmp_path: Path, rows: list[tuple[float, ...]], data: st.DataObject, name: str, read: Reader, write: Writer
) -> None:
    beams = data.draw(st.integers(1, 5))
    step = data.draw(st.floats(-1.5, 1.5))  # more would be more than a turn
    geometry = ScanGeometry(data.draw(number), step, 0.1, data.draw(st.sampled_from([4.0, math.inf])))
    laser = np.array([data.draw(number), data.draw(number), data.draw(st.floats(-math.pi, 3.14))])
    scans = [
        LaserScan(
            stamp,
            np.array(data.draw(st.lists(reading, min_size=beams, max_size=beams))),
            geometry,
            np.array(pose),
            laser,
            index,
        )
        for index, (stamp, *pose) in enumerate(rows)
    ]
    assert write(tmp_path / name, scans) == len(scans)
    back = list(read(tmp_path / name))
    assert len(back) == len(scans)
    for a, b in zip(scans, back, strict=True):
        assert_same(a, b)


def test_csv_as_one_would_write_it_by_hand(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"# my robot, run 3\n# laser_x=0.2\n{HEAD}1.5,1,2,0.5,3,,nan\n\n2.5,1,2,7,inf,11,-1\n")
    first, second = read_range_csv(path)
    assert first.valid.tolist() == [True, False, False]
    assert second.valid.tolist() == [False, False, False]
    assert first.geometry == ScanGeometry(-1.5, 0.5, 0.0, 10.0)
    np.testing.assert_allclose(first.robot_points, [[0.2 + 3 * math.cos(-1.5), 3 * math.sin(-1.5)]])
    np.testing.assert_allclose(second.odometry, [1, 2, 7 - 2 * math.pi])
    assert [first.index, second.index] == [0, 1]


def test_npz_needs_ranges_and_angles_only(tmp_path: Path) -> None:
    np.savez(
        tmp_path / "a.npz",
        ranges=np.ones((3, 4), dtype=np.float32),
        angle_min=np.array([0.0]),
        angle_increment=0.1,
    )
    scans = list(read_range_npz(tmp_path / "a.npz"))
    assert [scan.stamp for scan in scans] == [0.0, 1.0, 2.0]
    assert not scans[2].odometry.any()
    assert scans[0].geometry == ScanGeometry(0.0, 0.1)


BAD_CSV = [
    ("", "expected the header stamp,x,y,theta,r0,r1,..., found no line of a table"),
    ("stamp,x,y,theta,r0\n1,1,1,1,1\n", "where do the beams point? expected angle_min and angle_increment"),
    (
        "# angle_min=0 angle_increment=wide\nstamp,x,y,theta,r0\n",
        "expected a finite number for angle_increment",
    ),
    ("x,y\n1,2\n", "a.csv:1: expected the header stamp,x,y,theta,r0,r1,..., found 'x,y'"),
    (HEAD, "no scan in it"),
    (f"{HEAD}1,2,3,4,5,6\n", "a.csv:3: expected 7 fields as in the header, found 6"),
    (f"{HEAD}1,2,3,4,5,6,seven\n", "a.csv:3: expected numbers: could not convert"),
    (f"{HEAD}nan,2,3,4,5,6,7\n", "a.csv:3: expected finite numbers for stamp,x,y,theta, found 'nan,2,3,4'"),
]


@pytest.mark.parametrize(("text", "said"), BAD_CSV)
def test_bad_csv_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(DataError) as caught:
        list(read_range_csv(tmp_path / "a.csv"))
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_bad_lines_are_skipped_where_asked(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"{HEAD}1,2,3,4,5,6\n1,2,3,4,5,6,7\n")
    statistics = LogStatistics()
    assert len(list(read_range_csv(tmp_path / "a.csv", on_error="skip", statistics=statistics))) == 1
    assert statistics.skipped == 1
    assert statistics.reasons == ["line 3: expected 7 fields as in the header, found 6"]


OK: dict[str, Any] = {"ranges": np.ones((2, 3)), "angle_min": 0.0, "angle_increment": 0.1}
BAD_NPZ: list[tuple[dict[str, Any], str]] = [
    ({"points": np.ones(3)}, "expected an array called 'ranges', found points"),
    ({"ranges": np.ones(3)}, "expected numbers in 2 dimensions for ranges, found float64 (3,)"),
    ({"ranges": np.ones((2, 3))}, "where do the beams point?"),
    ({**OK, "stamps": np.ones(5)}, "shape (2,) for stamps, found shape (5,)"),
    ({**OK, "poses": np.full((2, 3), np.nan)}, "for poses, found numbers that are not finite"),
    ({**OK, "ranges": np.array([["a"]])}, "expected numbers"),
    ({**OK, "ranges": np.ones((0, 3))}, "holds no scan"),
]


@pytest.mark.parametrize(("arrays", "said"), BAD_NPZ)
def test_bad_npz_is_one_line(tmp_path: Path, arrays: dict[str, Any], said: str) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(DataError) as caught:
        list(read_range_npz(tmp_path / "a.npz"))
    assert said in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["t.csv", "t.npz"])
def test_a_table_has_one_laser(tmp_path: Path, name: str) -> None:
    scans = [LaserScan(0.0, np.ones(3), ScanGeometry(0.0, 0.1 * i), index=i) for i in (1, 2)]
    with pytest.raises(DataError, match="one laser, but scan 2 differs"):
        write_log(tmp_path / name, scans, name[2:])
    assert list(tmp_path.iterdir()) == []


GFS = """\
# GMapping
ODOM 0.000 0.000 0.000000 9.5
ODO_UPDATE 2 1 2 0.1 0.5 1 2 0.1 0.5 10.0
FRAME 1 0.5 0.1
LASER_READING 4 1.25 2.50 81.90 0.00 1.5 -2.5 4.0 10.000000
SM_UPDATE 2 1 2 0.1 -3 1 2 0.1 -4
NEFF 1.5
LASER_READING 4 1.00 2.00 3.00 4.00 2.5 -2.5 0.1 11.000000
"""


def test_gfs_gives_scans_with_their_odometry(tmp_path: Path) -> None:
    (tmp_path / "run.gfs").write_text(GFS)
    first, second = read_gfs(tmp_path / "run.gfs")
    assert (first.stamp, second.stamp, second.index) == (10.0, 11.0, 1)
    assert first.ranges.tolist() == [1.25, 2.5, 81.9, 0.0]
    assert first.valid.tolist() == [True, True, False, False]
    np.testing.assert_allclose(first.odometry, [1.5, -2.5, 4.0 - 2 * math.pi])


@pytest.mark.parametrize(
    ("beams", "first", "last", "limit"),
    [(181, -90.0, 90.0, 80.0), (541, -135.0, 135.0, 30.0), (682, -120.0, -120.0 + 681 * 360 / 1024, 5.5)],
)
def test_gfs_knows_gmappings_lasers(
    tmp_path: Path, beams: int, first: float, last: float, limit: float
) -> None:
    (tmp_path / "run.gfs").write_text(f"LASER_READING {beams} {'1.00 ' * beams}0 0 0 5.0\n")
    (scan,) = read_gfs(tmp_path / "run.gfs")
    angles = np.degrees(scan.geometry.angles(beams))
    assert (angles[0], angles[-1], scan.geometry.range_max) == pytest.approx((first, last, limit))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("ODOM 0 0 0 1\n", "no scan in it; expected GMapping's LASER_READING lines"),
        ("LASER_READING 3 1 2 0 0 0\n", "run.gfs:1: expected LASER_READING n r1..rn x y theta time: 9 words"),
        ("LASER_READING x\n", "run.gfs:1: expected LASER_READING n r1..rn x y theta time in numbers"),
        ("LASER_READING 1 1 nan 0 0 0\n", "with a finite pose"),
    ],
)
def test_bad_gfs_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "run.gfs").write_text(text)
    with pytest.raises(DataError) as caught:
        list(read_gfs(tmp_path / "run.gfs"))
    assert said in str(caught.value)


def test_the_content_tells_the_format_where_it_can(tmp_path: Path) -> None:
    (tmp_path / "a.log").write_text(GFS)
    assert detect(tmp_path / "a.log").name == "gfs"
    (tmp_path / "b.bag").write_bytes(b"#ROSBAG V2.0\n")
    assert detect(tmp_path / "b.bag").name == "ros1"
    (tmp_path / "c").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(DataError, match=r"c: holds a ROS 2 bag \(MCAP\); rename it to c\.mcap"):
        detect(tmp_path / "c")
    (tmp_path / "d.bag").write_text("not a bag")
    with pytest.raises(DataError, match=r"d\.bag: expected a ROS 1 bag, as its name says, found b'not a ba'"):
        detect(tmp_path / "d.bag")
    with pytest.raises(DataError, match="expected a log, found a folder without metadata"):
        detect(tmp_path)


@pytest.mark.parametrize(
    ("name", "log", "stem"),
    [
        ("a.clf.bz2", "carmen", "a"),
        ("a.b.LOG", "carmen", "a.b"),
        ("a.bag", "ros1", "a"),
        ("a.csv.gz", "csv", "a"),
        ("a.gfs", "gfs", "a"),
        ("a.bag.gz", None, "a.bag.gz"),
    ],
)
def test_names_tell_formats_and_stems(name: str, log: str | None, stem: str) -> None:
    found = by_suffix(name)
    assert (found.name if found else None) == log
    assert log_stem(name) == stem


@pytest.mark.parametrize("name", ["t.clf", "t.csv", "t.npz"])
def test_every_text_and_array_format_gives_the_same_scans(
    tmp_path: Path, name: str, room_scan: LaserScan
) -> None:
    path = tmp_path / name
    found = by_suffix(name)
    assert found is not None and found is FORMATS[found.name]
    write_log(path, [room_scan], found.name)
    (back,) = read_log(path)
    assert back.stamp == room_scan.stamp
    np.testing.assert_array_equal(back.points, room_scan.points)
