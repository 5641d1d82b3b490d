"""Readers of plugins open logs by their suffix, with the truth that lies beside them, wherever a log may be named."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from hsslam import plugin_files
from hsslam.cli.main import app
from hsslam.datasets.catalogue import open_dataset
from hsslam.errors import ConfigError, DataError
from hsslam.io.readers import Reader, register_reader
from hsslam.io.tum import write_tum

TUTORIAL = Path(__file__).parent.parent / "docs" / "extend.md"


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The office in the tutorial's format, read by the tutorial's reader."""
    found = re.search(r"^```python file=lines.py\n(.*?)^```$", TUTORIAL.read_text(), re.MULTILINE | re.DOTALL)
    assert found is not None
    (tmp_path / "lines.py").write_text(found[1])
    monkeypatch.setenv(plugin_files.VARIABLE, "")
    plugin_files.use(tmp_path / "lines.py")
    office = open_dataset("office", seed=1, scans=15)
    lines = [
        " ".join(repr(float(value)) for value in (scan.stamp, *scan.odometry, *scan.ranges))
        for scan in office.scans()
    ]
    path = tmp_path / "drive.lines"
    path.write_text("\n".join(lines))
    write_tum(tmp_path / "drive.truth.tum", office.truth())
    yield path


def test_a_log_is_read_with_what_lies_beside_it(log: Path) -> None:
    dataset = open_dataset(log, scans=10)
    assert dataset.info.name == "drive"
    assert dataset.info.description == "log of lines drive.lines"
    scans = list(dataset.scans())
    expected = list(open_dataset("office", seed=1, scans=10).scans())
    assert [scan.stamp for scan in scans] == [scan.stamp for scan in expected]
    np.testing.assert_array_equal(scans[3].ranges, expected[3].ranges)
    truth = dataset.truth()
    assert truth is not None and len(truth) == 10


def test_the_command_runs_it(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    ran = CliRunner().invoke(app, ["run", str(log), "--out", str(out), "--quiet"])
    assert ran.exit_code == 0, ran.stderr
    assert len((out / "trajectory.tum").read_text().splitlines()) == 15


def test_what_is_wrong_with_a_log_is_one_line(log: Path) -> None:
    log.write_text("1 2 3\n")
    with pytest.raises(DataError, match=r"drive.lines:1: expected 184 numbers, found 3"):
        list(open_dataset(log).scans())


def test_whatever_a_reader_raises_names_the_log_and_the_scan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "bad.py"
    file.write_text(
        "from hsslam.datasets.catalogue import open_dataset\n"
        "from hsslam.io.readers import Reader, register_reader\n"
        "def read(path):\n"
        "    yield next(open_dataset('office').scans())\n"
        "    yield 3\n"
        "register_reader(Reader('bad', 'bad log', ('.bad',), read))\n"
    )
    monkeypatch.setenv(plugin_files.VARIABLE, "")
    plugin_files.use(file)
    (tmp_path / "a.bad").write_text("")
    with pytest.raises(DataError, match=r"a\.bad: the reader bad failed at scan 1: TypeError: .*found int"):
        list(open_dataset(tmp_path / "a.bad").scans())


@pytest.mark.parametrize(
    ("name", "suffixes", "said"),
    [
        ("mine", (), "needs suffixes"),
        ("mine", ("mine",), "needs suffixes like .slamtec"),
        ("mine", (".MINE",), "in lower case"),
        ("mine", (".clf",), "takes .clf, which is hsslam's own"),
        ("carmen", (".mine",), "takes carmen, which is hsslam's own"),
    ],
)
def test_a_reader_must_not_take_what_is_hsslams(name: str, suffixes: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(said)):
        register_reader(Reader(name, "mine", suffixes, lambda path: iter(())))
