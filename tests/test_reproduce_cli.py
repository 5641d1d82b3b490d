"""`hsslam reproduce`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from hsslam.cli.main import app


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def hsslam(*args: str | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def test_reproduce_writes_a_report_and_says_what_holds() -> None:
    result = hsslam("reproduce", "fig10", "--quick", "--trials", "10", "--seed", "3", "--out", "out")
    assert result.exit_code == 0, result.output
    assert "HIDE converges faster" in result.stdout
    assert "claims of the paper hold on these data" in result.stdout
    assert Path("out/report.html").is_file()
    assert Path("out/report.md").is_file()
    found = json.loads(Path("out/fig10/result.json").read_text("utf-8"))
    assert found["seeds"] == [3]
    assert found["counts"]["trials per method"] == 10


def test_reproduce_refuses_to_overwrite_before_it_works() -> None:
    Path("out/fig10").mkdir(parents=True)
    result = hsslam("reproduce", "fig10", "--quick", "--out", "out")
    assert result.exit_code == 3
    assert "choose another --out" in result.stderr


def test_reproduce_quiet_prints_nothing_and_makes_its_own_folder() -> None:
    result = hsslam("reproduce", "fig10", "--trials", "3", "--quiet")
    assert result.exit_code == 0, result.output
    assert result.stdout == ""
    assert len(list(Path("runs").glob("*-reproduce/fig10/result.json"))) == 1


def test_reproduce_of_an_unknown_experiment_or_log_is_one_line() -> None:
    unknown = hsslam("reproduce", "fig99")
    assert unknown.exit_code == 2
    assert "fig10, maps, benchmarks and all" in unknown.stderr
    missing = hsslam("reproduce", "fig10", "--dataset", "nowhere.clf", "--out", "out")
    assert missing.exit_code == 3
    assert len(missing.stderr.strip().splitlines()) == 1
