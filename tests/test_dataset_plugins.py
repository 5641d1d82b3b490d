"""Datasets of plugins are listed, opened, run and compared by name like hsslam's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hsslam import plugin_files
from hsslam.cli.main import app
from hsslam.datasets.catalogue import describe, names, open_dataset
from hsslam.datasets.dataset import DatasetInfo, DatasetSource
from hsslam.errors import ConfigError, UnavailableError

PLUGIN = """
from dataclasses import replace
from hsslam.datasets.catalogue import open_dataset, register_dataset
from hsslam.datasets.dataset import DatasetInfo, DatasetSource

class Backwards:
    def __init__(self, log):
        self.log = log
        self.info = replace(SOURCE.info, scan_count=log.info.scan_count)
    def scans(self):
        return iter(list(self.log.scans())[::-1])
    def truth(self):
        return None
    def relations(self):
        return None

def open_backwards(*, seed, scans, data_dir, on_error):
    return Backwards(open_dataset("office", seed=seed, scans=scans))

SOURCE = DatasetSource(DatasetInfo("backwards", "simulated", "the office, driven backwards"), open_backwards)
register_dataset(SOURCE)
"""


@pytest.fixture
def backwards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv(plugin_files.VARIABLE, "")
    file = tmp_path / "backwards.py"
    file.write_text(PLUGIN)
    plugin_files.use(file)
    yield file


def test_it_is_named_described_and_opened(backwards: Path) -> None:
    assert names()[-1] == "backwards"
    assert describe("backwards").description == "the office, driven backwards"
    scans = list(open_dataset("backwards", seed=2, scans=5).scans())
    office = list(open_dataset("office", seed=2, scans=5).scans())
    assert [scan.stamp for scan in scans] == [scan.stamp for scan in office[::-1]]


def test_the_command_lists_and_runs_it(backwards: Path, tmp_path: Path) -> None:
    assert "the office, driven backwards" in CliRunner().invoke(app, ["datasets"]).stdout
    out = tmp_path / "run"
    ran = CliRunner().invoke(app, ["run", "backwards", "--scans", "12", "--quiet", "--out", str(out)])
    assert ran.exit_code == 0, ran.stderr
    assert len((out / "trajectory.tum").read_text().splitlines()) == 12


def test_a_comparison_runs_on_it_in_its_workers(backwards: Path, tmp_path: Path) -> None:
    options = ["--matchers", "hide", "--no-trials", "--scans", "12", "--quiet", "--out", str(tmp_path / "c")]
    compared = CliRunner().invoke(app, ["compare", "backwards", *options])
    assert compared.exit_code == 0, compared.stderr
    assert (tmp_path / "c" / "report.html").is_file()


def test_a_built_in_name_is_refused() -> None:
    from hsslam.datasets.catalogue import register_dataset

    source = DatasetSource(DatasetInfo("intel", "file", "mine"), open_dataset)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="has the name of a built-in dataset, intel"):
        register_dataset(source)


def test_a_broken_one_is_listed_with_its_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    information = tmp_path / "halfway-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: halfway\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[hsslam.datasets]\nhalfway = halfway_there:SOURCE\n")
    assert describe("halfway").kind == "unavailable"
    assert "halfway_there" in describe("halfway").description
    listed = CliRunner().invoke(app, ["datasets"])
    assert listed.exit_code == 0
    (row,) = [line for line in listed.stdout.splitlines() if line.startswith("halfway")]
    assert row.rstrip().endswith("hsslam doctor")
    with pytest.raises(UnavailableError, match="dataset 'halfway' is unavailable: ModuleNotFoundError"):
        open_dataset("halfway")


def test_one_that_opens_something_else_is_refused_in_a_line(backwards: Path) -> None:
    file = backwards.with_name("half.py")
    file.write_text(
        "from hsslam.datasets.catalogue import register_dataset\n"
        "from hsslam.datasets.dataset import DatasetInfo, DatasetSource\n"
        "class Half:\n    def scans(self):\n        return iter(())\n"
        "register_dataset(DatasetSource(DatasetInfo('half', 'mine', 'not whole'), lambda **options: Half()))\n"
    )
    result = CliRunner().invoke(app, ["run", "half", "--plugin", str(file)])
    assert result.exit_code == 3
    assert "dataset 'half': expected its source to open a" in result.stderr
    assert "found a Half without info, truth, relations" in result.stderr
    listed = CliRunner().invoke(app, ["datasets", "--plugin", str(file)])
    assert "not whole" in listed.stdout


def test_a_folder_named_as_a_plugin_is_told_which_file_was_meant(backwards: Path) -> None:
    folder = backwards.with_name("mine")
    folder.mkdir()
    (folder / "mine.py").write_text("")
    with pytest.raises(ConfigError, match=r"found a folder; name the file in it: .*mine/mine\.py"):
        plugin_files.use(folder)
