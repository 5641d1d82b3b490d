from __future__ import annotations

import bz2
import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hsslam.errors import DataError
from hsslam.io.carmen import LOOK_AHEAD, CarmenStatistics, CarmenWriter, read_carmen
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Pose, compose

FLASER = b"FLASER 4 1.0 2.0 3.0 81.83 0.6 0.2 0.1 0.5 0.2 0.1 12.500001 host 0.5\n"
RLASER = b"RLASER 3 1.0 2.0 3.0 0.4 0.2 -3.04 0.5 0.2 0.1 12.6 host 0.6\n"
ROBOTLASER = (
    b"ROBOTLASER1 0 -2.0 4.0 1.0 5.6 0.01 0 5 1 2 3 4 5.6 2 7 8 "
    b"1.0 3.0 1.5707963 1.0 2.0 1.5707963 0 0 0 0 0 13.25 host 0.7\n"
)
RAWLASER = b"RAWLASER1 0 -1.5 3.0 1.0 81.9 0.01 0 4 1 2 3 4 0 14.0 host 0.8\n"
REMISSION = b"REMISSIONFLASER 3 1.0 9.0 2.0 9.5 3.0 8.0 15.0 host 0.9\n"
ODOM = b"ODOM 7.0 8.0 0.5 0.1 0.2 0 11.0 host 0.1\n"


def write(path: Path, *lines: bytes) -> Path:
    path.write_bytes(b"".join(lines))
    return path


def scan_words(beams: int) -> bytes:
    return b"FLASER %d %s 0 0 0 0 0 0 1.5 h 0\n" % (beams, b" ".join([b"2.5"] * beams))


@pytest.mark.parametrize("pack", [bytes, gzip.compress, bz2.compress])
def test_packing_is_told_by_the_bytes_not_the_name(tmp_path: Path, pack: object) -> None:
    assert callable(pack)
    log = write(tmp_path / "log.txt", pack(ODOM + FLASER + FLASER))
    statistics = CarmenStatistics()
    scans = list(read_carmen(log, statistics=statistics))
    assert [scan.index for scan in scans] == [0, 1]
    assert statistics.lines == 3
    assert statistics.scans == {"FLASER": 2}
    assert statistics.odometry == 1
    np.testing.assert_allclose(scans[0].ranges, [1.0, 2.0, 3.0, 81.83])
    assert scans[0].stamp == 12.500001


@pytest.mark.parametrize(
    ("beams", "first", "last"),
    [
        (180, -90, 89),
        (181, -90, 90),
        (360, -90, 89.5),
        (361, -90, 90),
        (401, -50, 50),
        (101, -50, 50),
        (7, -90, 90),
    ],
)
def test_beams_of_flaser(tmp_path: Path, beams: int, first: float, last: float) -> None:
    (scan,) = read_carmen(write(tmp_path / "a.clf", scan_words(beams)))
    angles = np.degrees(scan.geometry.angles(len(scan.ranges)))
    assert len(angles) == beams
    np.testing.assert_allclose(angles[[0, -1]], [first, last])


def test_resolution_parameter_places_an_unknown_number_of_beams(tmp_path: Path) -> None:
    param = b"PARAM laser_front_laser_resolution 0.5 nohost 0\n"
    (scan,) = read_carmen(write(tmp_path / "a.clf", param, scan_words(541)))
    np.testing.assert_allclose(np.degrees(scan.geometry.angles(541))[[0, -1]], [-135, 135])


def test_no_return_stays_in_ranges_and_is_invalid(tmp_path: Path) -> None:
    log = write(tmp_path / "a.clf", FLASER)
    (scan,) = read_carmen(log)
    assert scan.geometry.range_max == 80.0
    assert scan.valid.tolist() == [True, True, True, False]
    (scan,) = read_carmen(log, range_max=2.5)
    assert scan.valid.tolist() == [True, True, False, False]


@pytest.mark.parametrize(("told", "limit"), [(b"30.0", 30.0), (b"81.9", 80.0), (b"0", 80.0)])
def test_parameter_lowers_the_range_limit(tmp_path: Path, told: bytes, limit: float) -> None:
    (scan,) = read_carmen(
        write(tmp_path / "a.clf", b"PARAM robot_front_laser_max " + told + b" h 0\n", FLASER)
    )
    assert scan.geometry.range_max == limit


def test_laser_offset_makes_odometry_the_second_pose(tmp_path: Path) -> None:
    log = write(tmp_path / "a.clf", b"PARAM robot_frontlaser_offset 0.1 nohost 0\n", FLASER)
    (scan,) = read_carmen(log)
    np.testing.assert_allclose(scan.odometry, [0.5, 0.2, 0.1])
    np.testing.assert_allclose(scan.laser_pose, [0.1, 0.0, 0.0])


def test_rear_laser_faces_backwards(tmp_path: Path) -> None:
    log = write(tmp_path / "a.clf", b"PARAM robot_rearlaser_offset -0.2 nohost 0\n", FLASER, RLASER)
    statistics = CarmenStatistics()
    (scan,) = read_carmen(log, laser="rear", statistics=statistics)
    assert scan.index == 0
    assert statistics.ignored == {"FLASER": 1}
    np.testing.assert_allclose(scan.laser_pose[:2], [-0.2, 0.0])
    assert abs(scan.laser_pose[2]) == pytest.approx(math.pi)
    # The middle beam looks straight back: its point lies behind the robot.
    np.testing.assert_allclose(scan.robot_points[1], [-2.2, 0.0], atol=1e-12)


def test_robotlaser_brings_its_own_geometry(tmp_path: Path) -> None:
    (scan,) = read_carmen(write(tmp_path / "a.clf", ROBOTLASER))
    assert scan.geometry == ScanGeometry(-2.0, 1.0, range_max=5.6)
    assert scan.valid.tolist() == [True] * 4 + [False]
    assert scan.stamp == 13.25
    np.testing.assert_allclose(scan.odometry, [1.0, 2.0, 1.5707963])
    np.testing.assert_allclose(scan.laser_pose, [1.0, 0.0, 0.0], atol=1e-6)


def test_scans_of_both_kinds_in_one_log(tmp_path: Path) -> None:
    scans = list(read_carmen(write(tmp_path / "a.clf", FLASER, ROBOTLASER, FLASER)))
    assert [len(scan.ranges) for scan in scans] == [4, 5, 4]
    assert [scan.index for scan in scans] == [0, 1, 2]


@pytest.mark.parametrize(("line", "ranges"), [(RAWLASER, [1, 2, 3, 4]), (REMISSION, [1, 2, 3])])
def test_scans_without_a_pose_take_the_newest_odometry(
    tmp_path: Path, line: bytes, ranges: list[int]
) -> None:
    later = ODOM.replace(b"7.0", b"9.0")
    scans = list(read_carmen(write(tmp_path / "a.clf", line, ODOM, line, later, line)))
    assert [scan.odometry[0] for scan in scans] == [7.0, 7.0, 9.0]
    np.testing.assert_allclose(scans[0].ranges, ranges)


def test_scans_without_a_pose_give_way_to_those_with_one(tmp_path: Path) -> None:
    statistics = CarmenStatistics()
    scans = list(
        read_carmen(write(tmp_path / "a.clf", RAWLASER, ROBOTLASER, RAWLASER), statistics=statistics)
    )
    assert [scan.stamp for scan in scans] == [13.25]
    assert statistics.ignored == {"RAWLASER1": 2}


def test_other_messages_are_counted_and_passed_over(tmp_path: Path) -> None:
    statistics = CarmenStatistics()
    lines = b"# a comment\n#\n\nSYNC start 1 h 1\nTRUEPOS 1 2 3 4 5 6 7 h 8\nPARAM robot_name b21 h 0\n"
    assert len(list(read_carmen(write(tmp_path / "a.clf", lines, FLASER), statistics=statistics))) == 1
    assert statistics.ignored == {"#": 2, "SYNC": 1, "TRUEPOS": 1}


MALFORMED = [
    (b"FLASER 4 1.0 2.0 3.0\n", "expected 15 words for 'FLASER' with 4 readings, found 5"),
    (b"FLASER\n", "ends before its number of readings"),
    (b"FLASER x 1 2\n", "number of readings as word 2, found 'x'"),
    (b"FLASER -1 1 2\n", "number of readings as word 2, found '-1'"),
    (FLASER.replace(b"2.0 3.0", b"2.0 abc"), "expected a number as word 5, found 'abc'"),
    (FLASER.replace(b"12.500001", b"nan"), "expected finite numbers for x y theta"),
    (
        ROBOTLASER.replace(b" host", b""),
        "expected 31 words for 'ROBOTLASER1' with 5 readings and 2 remissions",
    ),
    (ROBOTLASER.replace(b"-2.0 4.0", b"inf 4.0"), "expected finite numbers for start_angle"),
    (b"ROBOTLASER1 0 1 2\n", "ends before its number of readings"),
    (b"ROBOTLASER1 0 1 2 3 4 5 6 99 1 2 3\n", "ends before its number of remissions"),
    (b"ODOM 1 2\n", "expected ODOM x y theta"),
    (b"ODOM 1 2 nan 0 0 0 1 h 1\n", "expected finite numbers for x y theta"),
    (b"PARAM robot_frontlaser_offset\n", "expected PARAM name value"),
    (
        b"PARAM robot_frontlaser_offset far h 0\n",
        "expected a number for robot_frontlaser_offset, found 'far'",
    ),
    (b"FLASER \xff\xfe 1\n", "number of readings"),
]


@pytest.mark.parametrize(("line", "reason"), MALFORMED)
def test_malformed_line_stops_with_its_number(tmp_path: Path, line: bytes, reason: str) -> None:
    log = write(tmp_path / "bad.clf", FLASER, line, FLASER)
    with pytest.raises(DataError) as caught:
        list(read_carmen(log))
    message = str(caught.value)
    assert f"{log}:2: " in message
    assert reason in message
    assert "skip" in message
    assert "\n" not in message


@pytest.mark.parametrize(("line", "reason"), MALFORMED)
def test_malformed_line_can_be_skipped_and_is_counted(tmp_path: Path, line: bytes, reason: str) -> None:
    statistics = CarmenStatistics()
    log = write(tmp_path / "bad.clf", FLASER, line, FLASER)
    scans = list(read_carmen(log, on_error="skip", statistics=statistics))
    assert [scan.index for scan in scans] == [0, 1]
    assert statistics.skipped == 1
    assert reason in statistics.reasons[0]
    assert statistics.reasons[0].startswith("line 2: ")


def test_malformed_line_far_down_keeps_its_number(tmp_path: Path) -> None:
    log = write(tmp_path / "bad.clf", *[FLASER] * (LOOK_AHEAD + 5), b"FLASER 2 1\n", FLASER)
    with pytest.raises(DataError, match=rf"bad\.clf:{LOOK_AHEAD + 6}: "):
        list(read_carmen(log))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "the file is empty"),
        (bz2.compress(b""), "the file is empty"),
        (b"hello\nworld\n", "expected a CARMEN log with FLASER"),
        (ODOM, "found odometry only"),
        (RLASER, "it holds scans of the rear laser"),
        (bz2.compress(FLASER * 2000)[:-20], "cut off"),
        (gzip.compress(FLASER * 2000)[:-20], "cut off"),
        (b"BZh9 this is not bzip2 at all", "cannot be read"),
        (b"\x1f\x8b\x08 nor is this gzip, whatever it says", "cannot be read"),
    ],
)
def test_file_that_is_no_log(tmp_path: Path, content: bytes, reason: str) -> None:
    log = write(tmp_path / "x.clf", content)
    with pytest.raises(DataError) as caught:
        list(read_carmen(log))
    assert str(caught.value).startswith(str(log))
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_nothing_but_malformed_lines_is_an_error_even_when_skipping(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no scan can be read; 2 malformed lines, the first: line 1"):
        list(read_carmen(write(tmp_path / "x.clf", b"FLASER 1\nFLASER 2\n"), on_error="skip"))


def test_absent_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        next(read_carmen(tmp_path / "none.clf"))
    with pytest.raises(DataError, match="found a folder"):
        next(read_carmen(tmp_path))


def test_unknown_choice_is_found_before_reading(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="front"):
        read_carmen(tmp_path / "none.clf", laser="left")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="skip"):
        read_carmen(tmp_path / "none.clf", on_error="ignore")  # type: ignore[arg-type]


def test_log_is_read_as_a_stream(tmp_path: Path) -> None:
    log = write(tmp_path / "a.clf", *[FLASER] * (LOOK_AHEAD + 10), b"FLASER 9\n")
    stream = read_carmen(log)
    assert next(stream).index == 0


readings = st.one_of(
    st.floats(0.001, 90.0), st.sampled_from([0.0, -1.0, math.nan, math.inf, 81.83, 30.0, 1e-6, 29.99999])
)
coordinate = st.floats(-500.0, 500.0)
heading = st.floats(-math.pi, math.pi, exclude_max=True)


@st.composite
def laser_scans(draw: st.DrawFn) -> LaserScan:
    beams = draw(st.sampled_from([0, 1, 5, 180, 181, 360, 361, 683]))
    values = draw(st.lists(readings, min_size=1, max_size=12))
    start, step = -0.5 * math.pi, math.radians(0.5 if beams >= 360 else 1.0)
    if draw(st.booleans()):
        start, step = draw(st.floats(-3.0, 3.0)), draw(st.floats(0.001, 0.1))
    limit = draw(st.sampled_from([5.6, 30.0, 80.0, math.inf]))
    offset = draw(
        st.sampled_from([(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.1, -0.3, 2.0), (-0.2, 0.0, -math.pi)])
    )
    return LaserScan(
        stamp=draw(st.floats(0.0, 2e9)),
        ranges=np.resize(np.array(values), beams),
        geometry=ScanGeometry(start, step, draw(st.sampled_from([0.0, 0.02])), limit),
        odometry=np.array([draw(coordinate), draw(coordinate), draw(heading)]),
        laser_pose=np.array(offset),
    )


def assert_same_pose(a: Pose, b: Pose, tolerance: float) -> None:
    np.testing.assert_allclose(a[:2], b[:2], atol=tolerance)
    assert abs(math.remainder(a[2] - b[2], 2 * math.pi)) < tolerance


@given(
    scans=st.lists(laser_scans(), min_size=1, max_size=4),
    suffix=st.sampled_from(["clf", "clf.gz", "log.bz2"]),
)
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_reads_back(tmp_path: Path, scans: list[LaserScan], suffix: str) -> None:
    log = tmp_path / f"a.{suffix}"
    with CarmenWriter(log) as writer:
        assert writer.write_all(scans) == len(scans)
    back = list(read_carmen(log))
    assert len(back) == len(scans)
    for index, (scan, read) in enumerate(zip(scans, back, strict=True)):
        assert read.index == index
        assert read.stamp == pytest.approx(scan.stamp, abs=1e-6)
        np.testing.assert_array_equal(read.valid, scan.valid)
        np.testing.assert_allclose(read.ranges[read.valid], scan.ranges[scan.valid], atol=1.01e-4)
        assert read.geometry.range_max == scan.geometry.range_max
        beams = len(scan.ranges)
        np.testing.assert_allclose(read.geometry.angles(beams), scan.geometry.angles(beams), atol=1e-6)
        assert_same_pose(read.odometry, scan.odometry, 1e-6)
        placed, expected = compose(read.odometry, read.laser_pose), compose(scan.odometry, scan.laser_pose)
        assert_same_pose(placed, expected, 4e-6)


def test_writer_keeps_plain_readings_as_they_are(tmp_path: Path) -> None:
    ranges = np.where(np.arange(180) % 7 == 0, 81.83, 1.23 + np.arange(180) * 0.01)
    scan = LaserScan(1.0, ranges, ScanGeometry(-math.pi / 2, math.radians(1.0), 0.0, 80.0))
    with CarmenWriter(tmp_path / "a.clf") as writer:
        writer.write(scan)
    text = (tmp_path / "a.clf").read_text()
    assert "\nFLASER 180 81.8300 1.2400 " in text
    assert "\nODOM " in text
    assert "PARAM robot_frontlaser_offset 0.0" in text
    (back,) = read_carmen(tmp_path / "a.clf")
    np.testing.assert_allclose(back.ranges, ranges, atol=1e-9)


@pytest.mark.parametrize("suffix", ["clf", "clf.gz", "clf.bz2"])
def test_same_scans_same_bytes(tmp_path: Path, suffix: str) -> None:
    scan = LaserScan(1.0, np.ones(181), ScanGeometry(-math.pi / 2, math.radians(1.0), 0.0, 80.0))
    for name in ("a", "b"):
        with CarmenWriter(tmp_path / f"{name}.{suffix}") as writer:
            writer.write(scan)
    assert (tmp_path / f"a.{suffix}").read_bytes() == (tmp_path / f"b.{suffix}").read_bytes()


def test_writer_leaves_nothing_behind_when_it_fails(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), CarmenWriter(tmp_path / "a.clf"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_writing_outside_the_block_is_refused(tmp_path: Path) -> None:
    scan = LaserScan(1.0, np.ones(3), ScanGeometry(0.0, 0.1))
    with pytest.raises(ValueError, match="with block"):
        CarmenWriter(tmp_path / "a.clf").write(scan)


@pytest.mark.parametrize(
    ("name", "scans", "odometry", "beams", "duration"),
    [("intel", 13631, 26915, 180, 2691.0), ("mit-csail", 1988, 0, 361, 424.0)],
)
def test_public_logs(
    shared_data: Path, name: str, scans: int, odometry: int, beams: int, duration: float
) -> None:
    statistics = CarmenStatistics()
    stamps, invalid = [], 0
    for scan in read_carmen(shared_data / name / f"{name}.clf.bz2", statistics=statistics):
        assert len(scan.ranges) == beams
        assert scan.ranges[scan.valid].max(initial=0.0) < 80.0
        invalid += int((~scan.valid).sum())
        stamps.append(scan.stamp)
    assert statistics.scans == {"FLASER": scans}
    assert statistics.odometry == odometry
    assert invalid > 0
    assert np.ptp(stamps) == pytest.approx(duration, abs=0.5)
