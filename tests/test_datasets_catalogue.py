from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hsslam.datasets.catalogue import data_directory, describe, names, open_dataset
from hsslam.datasets.file import FileDataset
from hsslam.errors import DataError
from hsslam.io.carmen import CarmenWriter
from hsslam.io.relations import Relations, write_relations
from hsslam.io.tum import write_tum
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.trajectory import Trajectory

SCANS = 12


def scans(count: int = SCANS) -> list[LaserScan]:
    geometry = ScanGeometry(-0.5 * math.pi, math.radians(1.0), range_max=80.0)
    return [
        LaserScan(100.0 + 0.1 * i, np.full(181, 1.0 + i), geometry, np.array([0.1 * i, 0.0, 0.0]), index=i)
        for i in range(count)
    ]


def make_log(path: Path) -> Path:
    with CarmenWriter(path) as writer:
        writer.write_all(scans())
    return path


def add_relations(log: Path, stem: str, index: bool) -> Relations:
    relations = Relations(np.array([0, 5]), np.array([3, 11]), np.array([[0.3, 0.0, 0.0], [0.6, 0.0, 0.1]]))
    path = log.with_name(f"{stem}.relations")
    stamps = np.array([scan.stamp for scan in scans()])
    write_relations(path, relations, stamps, path.with_name(f"{stem}.relations.index.csv") if index else None)
    return relations


@pytest.fixture(autouse=True)
def no_data_folder_of_the_user(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HSSLAM_DATA", str(tmp_path / "unset"))


def test_every_name_is_described() -> None:
    assert names() == ["office", "corridor", "hall", "intel", "mit-csail"]
    for name in names():
        info = describe(name)
        assert info.name == name
        assert info.kind == ("real" if name in ("intel", "mit-csail") else "simulated")
        assert bool(info.attribution) == (info.kind == "real")
        assert info.description
        assert info.scan_count
    assert "CC-BY 3.0" in describe("intel").attribution


def test_listing_imports_nothing_heavy() -> None:
    code = (
        "import sys; from hsslam.datasets import catalogue, fetch; catalogue.describe('intel');"
        "print(*sorted({'pooch', 'requests', 'numba', 'numpy', 'gtsam'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.split() == []


@pytest.mark.parametrize("name", ["office", "corridor", "hall"])
def test_simulated_by_name(name: str) -> None:
    dataset = open_dataset(name, seed=3, scans=4)
    got = list(dataset.scans())
    assert [scan.index for scan in got] == [0, 1, 2, 3]
    truth = dataset.truth()
    assert truth is not None and len(truth) == 4
    other = next(iter(open_dataset(name, seed=4, scans=4).scans()))
    assert not np.array_equal(other.ranges, got[0].ranges)


@pytest.mark.parametrize(
    "place", ["intel/intel.clf.bz2", "intel/intel.clf", "intel.clf", "intel.clf.bz2", "intel.log.gz"]
)
def test_real_dataset_is_found_in_the_data_folder(tmp_path: Path, place: str) -> None:
    log = make_log(tmp_path / place)
    dataset = open_dataset("intel", data_dir=tmp_path)
    assert isinstance(dataset, FileDataset)
    assert dataset.path == log
    assert dataset.info.kind == "real"
    assert dataset.info.scan_count == 13631
    assert len(list(dataset.scans())) == SCANS


def test_data_folder_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HSSLAM_DATA", str(tmp_path))
    make_log(tmp_path / "mit-csail.clf")
    assert len(list(open_dataset("mit-csail").scans())) == SCANS
    assert data_directory() == tmp_path
    assert data_directory("/given") == Path("/given")
    monkeypatch.delenv("HSSLAM_DATA")
    assert data_directory().name == "hsslam"


def test_absent_real_dataset_says_where_it_looked_and_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(DataError) as caught:
        open_dataset("intel", data_dir=tmp_path / "my data")
    message = str(caught.value)
    assert str(tmp_path / "my data") in message
    assert f"hsslam datasets fetch intel --data-dir '{tmp_path / 'my data'}'" in message


def test_unknown_name_gets_a_suggestion(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="did you mean 'office'"):
        open_dataset("offise")
    with pytest.raises(DataError, match="did you mean 'intel'"):
        describe("intell")
    with pytest.raises(DataError, match=r"none\.clf: no such file$"):
        open_dataset(tmp_path / "none.clf")
    with pytest.raises(DataError, match="expected a log, found a folder"):
        open_dataset(tmp_path)


@pytest.mark.parametrize("suffix", [".clf", ".log", ".clf.bz2", ".log.gz"])
@pytest.mark.parametrize("index", [False, True])
def test_file_with_relations_beside_it(tmp_path: Path, suffix: str, index: bool) -> None:
    log = make_log(tmp_path / f"my.lab{suffix}")
    expected = add_relations(log, "my.lab", index)
    dataset = open_dataset(log)
    assert dataset.info.name == "my.lab"
    assert dataset.info.kind == "file"
    assert dataset.info.attribution == ""
    assert dataset.truth() is None
    found = dataset.relations()
    assert found is not None
    np.testing.assert_array_equal(found.first, expected.first)
    np.testing.assert_array_equal(found.second, expected.second)
    np.testing.assert_allclose(found.poses, expected.poses)


def test_index_file_is_taken_where_it_is(tmp_path: Path) -> None:
    log = make_log(tmp_path / "a.clf")
    add_relations(log, "a", True)
    index = tmp_path / "a.relations.index.csv"
    index.write_text(index.read_text().replace("\n0,3,", "\n1,4,"))
    found = open_dataset(log).relations()
    assert found is not None
    assert (found.first[0], found.second[0]) == (1, 4)


def test_skipped_lines_shift_scans_so_stamps_find_them(tmp_path: Path) -> None:
    log = make_log(tmp_path / "a.clf")
    add_relations(log, "a", True)
    lines = log.read_text().splitlines()
    bad = next(i for i, line in enumerate(lines) if line.startswith("FLASER") and " 100.400000 " in line)
    lines[bad] = lines[bad][:200]
    log.write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError, match=f"a.clf:{bad + 1}: "):
        list(open_dataset(log).scans())
    dataset = open_dataset(log, on_error="skip")
    assert isinstance(dataset, FileDataset)
    assert len(list(dataset.scans())) == SCANS - 1
    assert dataset.statistics.skipped == 1
    found = dataset.relations()
    assert found is not None
    np.testing.assert_array_equal(found.first, [0, 4])
    np.testing.assert_array_equal(found.second, [3, 10])


def test_truth_beside_a_log(tmp_path: Path) -> None:
    log = make_log(tmp_path / "sim.clf.gz")
    truth = Trajectory(
        np.linspace(0.0, 1.1, SCANS), np.arange(3.0 * SCANS).reshape(-1, 3) / 20, np.arange(SCANS)
    )
    write_tum(tmp_path / "sim.truth.tum", truth)
    read = open_dataset(log).truth()
    assert read is not None
    np.testing.assert_allclose(read.poses, truth.poses, atol=1e-8)
    first = open_dataset(log, scans=3).truth()
    assert first is not None
    assert len(first) == 3


def test_only_the_first_scans(tmp_path: Path) -> None:
    log = make_log(tmp_path / "a.clf")
    add_relations(log, "a", False)
    dataset = open_dataset(log, scans=5)
    assert [scan.index for scan in dataset.scans()] == [0, 1, 2, 3, 4]
    found = dataset.relations()
    assert found is not None
    assert found.first.tolist() == [0]
    with pytest.raises(DataError, match="at least one scan"):
        open_dataset(log, scans=0)


def test_scan_count_is_known_once_counted(tmp_path: Path) -> None:
    dataset = open_dataset(make_log(tmp_path / "a.clf"))
    assert dataset.info.scan_count is None
    assert len(list(dataset.scans())) == SCANS
    assert dataset.info.scan_count == SCANS
    assert len(list(dataset.scans())) == SCANS


def test_copy_of_a_public_log_keeps_its_attribution(tmp_path: Path) -> None:
    dataset = open_dataset(make_log(tmp_path / "intel.clf"))
    assert "CC-BY 3.0" in dataset.info.attribution
    assert dataset.info.kind == "file"


def test_public_log_from_the_shared_folder(shared_data: Path) -> None:
    dataset = open_dataset("mit-csail", data_dir=shared_data)
    relations = dataset.relations()
    assert relations is not None and len(relations) == 1172
    assert sum(1 for _ in dataset.scans()) == dataset.info.scan_count == 1988
