"""CARMEN logs as loggers, converters and full disks left them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hsslam.errors import DataError
from hsslam.io.carmen import CarmenStatistics, read_carmen
from hsslam.scan import LaserScan

POSES = "1.0 2.0 0.1 0.5 0.2 0.1"


def flaser(ranges: object, after: str = "12.5 host 0.3") -> str:
    words = [f"{value:.2f}" for value in np.asarray(ranges, dtype=np.float64)]
    return f"FLASER {len(words)} {' '.join(words)} {POSES} {after}".rstrip() + "\n"


def read(folder: Path, *lines: str) -> tuple[list[LaserScan], CarmenStatistics]:
    log, statistics = folder / "a.log", CarmenStatistics()
    log.write_text("".join(lines))
    return list(read_carmen(log, statistics=statistics)), statistics


def room(no_return: float, scans: int = 20) -> list[np.ndarray]:
    """Ranges of scans of which every fifth reading is no return."""
    rng = np.random.default_rng(0)
    ranges = [rng.uniform(1.0, 0.9 * no_return, 180) for _ in range(scans)]
    for scan in ranges:
        scan[::5] = no_return
    return ranges


def test_a_parameter_without_a_value_is_passed_over(tmp_path: Path) -> None:
    scans, statistics = read(tmp_path, "PARAM robot_name\n", "PARAM\n", flaser([1.0, 2.0]))
    assert len(scans) == 1
    assert not statistics.skipped


@pytest.mark.parametrize(("after", "stamps"), [("12.5", [12.5, 12.5]), ("", [0.0, 1.0])])
def test_host_and_stamps_may_be_missing(tmp_path: Path, after: str, stamps: list[float]) -> None:
    scans, _ = read(tmp_path, flaser([1.0, 2.0, 3.0], after), flaser([1.0, 2.0, 3.0], after))
    assert [scan.stamp for scan in scans] == stamps
    for scan in scans:
        np.testing.assert_allclose(scan.odometry, [0.5, 0.2, 0.1])
        np.testing.assert_allclose(scan.ranges, [1.0, 2.0, 3.0])


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_a_line_that_lost_readings_is_still_malformed(tmp_path: Path, lost: int) -> None:
    words = flaser(np.arange(1.0, 11.0)).split()
    with pytest.raises(DataError, match=r"a\.log:1: expected"):
        read(tmp_path, " ".join(words[:3] + words[3 + lost :]) + "\n", flaser([1.0]))


def test_a_last_line_that_is_cut_off_is_left_out_and_counted(tmp_path: Path) -> None:
    whole = flaser([1.0, 2.0, 3.0])
    scans, statistics = read(tmp_path, whole, whole, whole[:20])
    assert len(scans) == 2
    assert statistics.skipped == 1
    with pytest.raises(DataError, match=r"a\.log:2: "):
        read(tmp_path, whole, whole[:20] + "\n", whole)


def test_a_log_of_one_cut_line_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"a\.log:1: "):
        read(tmp_path, flaser([1.0, 2.0, 3.0])[:20])


@pytest.mark.parametrize(
    ("beams", "first", "last"),
    [(541, -135, 135), (540, -135, 134.5), (1081, -135, 135), (1080, -135, 134.75), (682, -120, 119.4)],
)
def test_lasers_that_see_more_than_half_a_turn_are_known_by_their_beams(
    tmp_path: Path, beams: int, first: float, last: float
) -> None:
    (scan,), _ = read(tmp_path, flaser(np.ones(beams)))
    ends = np.degrees(scan.geometry.angles(beams))[[0, -1]]
    np.testing.assert_allclose(ends, [first, last], atol=0.05)


@pytest.mark.parametrize("no_return", [5.6, 8.19, 29.9, 50.0])
def test_the_maximum_that_comes_again_and_again_is_no_return(tmp_path: Path, no_return: float) -> None:
    scans, _ = read(tmp_path, *map(flaser, room(no_return)))
    assert all(scan.valid.sum() == 144 for scan in scans)


def test_what_the_log_says_of_its_maximum_wins(tmp_path: Path) -> None:
    scans, _ = read(tmp_path, "PARAM robot_front_laser_max 40.0 h 0\n", *map(flaser, room(29.9)))
    assert all(scan.valid.all() for scan in scans)


def test_a_robot_at_rest_before_a_far_wall_has_returns_from_it(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    ranges = np.linspace(1.0, 9.0, 180)
    ranges[40:50] = 12.0
    scans, _ = read(tmp_path, *[flaser(ranges + rng.normal(0.0, 0.01, 180)) for _ in range(20)])
    assert all(scan.valid.all() for scan in scans)


def test_readings_beyond_it_show_that_the_maximum_was_a_return(tmp_path: Path) -> None:
    later = np.linspace(8.5, 20.0, 180)
    scans, _ = read(tmp_path, *map(flaser, room(8.0)), flaser(later), flaser(np.full(180, 8.0)))
    assert scans[-2].valid.all()
    assert scans[-1].valid.all()
