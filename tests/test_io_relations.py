from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hsslam.errors import DataError
from hsslam.io.carmen import read_carmen
from hsslam.io.relations import Relations, read_relations, write_relations

STAMPS = np.array([10.0, 10.5, 11.25, 11.0, 976052905.167303])
HEADER = "i1,i2,t1,t2,dx,dy,dtheta\n"


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_exact_stamps_name_scans_whatever_their_order(tmp_path: Path) -> None:
    path = write(tmp_path / "r", "# t1 t2 ...\n11.0 11.25 1 2 0 0 0 0.5\n976052905.167303 10.0 1 2 9 9 9 7\n")
    found = read_relations(path, stamps=STAMPS)
    np.testing.assert_array_equal(found.first, [3, 4])
    np.testing.assert_array_equal(found.second, [2, 0])
    np.testing.assert_allclose(found.poses, [[1, 2, 0.5], [1, 2, 7 - 2 * np.pi]])


def test_stamp_with_a_digit_less_is_found(tmp_path: Path) -> None:
    found = read_relations(write(tmp_path / "r", "976052905.16730 10.000005 0 0 0 0 0 0\n"), stamps=STAMPS)
    assert (found.first[0], found.second[0]) == (4, 0)


def test_exact_stamp_wins_over_a_near_one(tmp_path: Path) -> None:
    stamps = np.array([10.0, 10.000004, 10.000002])
    found = read_relations(write(tmp_path / "r", "10.000002 10.000004 0 0 0 0 0 0\n"), stamps=stamps)
    assert (found.first[0], found.second[0]) == (2, 1)


def test_repeated_stamp_names_its_first_scan(tmp_path: Path) -> None:
    stamps = np.array([12.0, 10.0, 11.0, 10.0, 11.0])
    found = read_relations(write(tmp_path / "r", "10.0 11.0 0 0 0 0 0 0\n"), stamps=stamps)
    assert (found.first[0], found.second[0]) == (1, 2)


def test_index_file_wins_over_stamps(tmp_path: Path) -> None:
    path = write(tmp_path / "r", "10.0 11.0 1 2 0 0 0 0.5\n")
    index = write(tmp_path / "r.index.csv", HEADER + "3,2,10.0,11.0,1,2,0.5\n")
    stamps = np.array([12.0, 10.0, 11.0, 10.0, 11.0])
    found = read_relations(path, stamps=stamps, index=index)
    assert (found.first[0], found.second[0]) == (3, 2)
    np.testing.assert_allclose(found.poses, [[1, 2, 0.5]])


@pytest.mark.parametrize("with_index", [False, True])
def test_round_trip(tmp_path: Path, rng: np.random.Generator, with_index: bool) -> None:
    stamps = np.linspace(976052857.0, 976052865.0, 40)
    relations = Relations(rng.integers(0, 40, 25), rng.integers(0, 40, 25), rng.uniform(-3, 3, (25, 3)))
    index = tmp_path / "r.index.csv" if with_index else None
    write_relations(tmp_path / "r", relations, stamps, index)
    back = read_relations(tmp_path / "r", None if with_index else stamps, index)
    assert len(back) == 25
    np.testing.assert_array_equal(back.first, relations.first)
    np.testing.assert_array_equal(back.second, relations.second)
    np.testing.assert_allclose(back.poses, relations.poses, atol=1e-8)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no relations in it"),
        ("10.0 11.0 1 2 0 0 0\n", "r:1: expected 8 numbers"),
        ("10.0 11.0 1 2 0 0 0 x\n", "r:1: expected finite numbers"),
        ("10.0 11.0 1 2 0 0 0 0\n10.0 10.7 1 2 0 0 0 0\n", "r:2: no scan has the stamp 10.700000"),
        ("99.0 11.0 1 2 0 0 0 0\n", "r:1: no scan has the stamp 99.000000"),
        ("10.0 10.00001 1 2 0 0 0 0\n", "r:1: no scan has the stamp 10.000010"),
    ],
)
def test_malformed_relations(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(DataError) as caught:
        read_relations(write(tmp_path / "r", text), stamps=STAMPS)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "found an empty file"),
        ("0,3,10.0,11.0,1,2,0.5\n", "index.csv:1: expected the header"),
        (HEADER, "0 lines for the 1 relations"),
        (HEADER + "0,3,10.0,11.0,1,2\n", "index.csv:2: expected 7 numbers"),
        (HEADER + "0,3.5,10.0,11.0,1,2,0.5\n", "index.csv:2: expected a whole number from 0 for i2"),
        (HEADER + "0,5,10.0,11.0,1,2,0.5\n", "index.csv:2: names scan 5, but the log has 5 scans"),
        (HEADER + "0,3,10.0,11.5,1,2,0.5\n", "do not belong together"),
    ],
)
def test_malformed_index(tmp_path: Path, text: str, reason: str) -> None:
    path = write(tmp_path / "r", "10.0 11.0 1 2 0 0 0 0.5\n")
    index = write(tmp_path / "r.index.csv", text)
    with pytest.raises(DataError) as caught:
        read_relations(path, stamps=STAMPS, index=index)
    assert reason in str(caught.value)


def test_stamps_or_index_are_needed(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="stamps"):
        read_relations(tmp_path / "r")
    path = write(tmp_path / "r", "10.0 11.0 1 2 0 0 0 0.5\n")
    with pytest.raises(DataError, match="no scans"):
        read_relations(path, stamps=np.zeros(0))


@pytest.mark.parametrize(("name", "count"), [("intel", 2984), ("mit-csail", 1172)])
def test_stamps_find_what_the_index_files_say(shared_data: Path, name: str, count: int) -> None:
    folder = shared_data / name
    stamps = np.array([scan.stamp for scan in read_carmen(folder / f"{name}.clf.bz2")])
    path = folder / f"{name}.relations"
    by_stamp = read_relations(path, stamps=stamps)
    by_index = read_relations(path, stamps=stamps, index=folder / f"{name}.relations.index.csv")
    assert len(by_stamp) == count
    np.testing.assert_array_equal(by_stamp.first, by_index.first)
    np.testing.assert_array_equal(by_stamp.second, by_index.second)
    np.testing.assert_array_equal(by_stamp.poses, by_index.poses)
