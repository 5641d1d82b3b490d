"""``hsslam report``: the page from run folders and from trajectories that others made."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hsslam.cli.main import app
from hsslam_eval.comparison import Study

SCANS = 80


def hsslam(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def complains(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code not in (0, 1) and isinstance(result.exception, SystemExit), result.output
    return result.output


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    home = tmp_path_factory.mktemp("runs")
    for name, *options in (
        ("hide", "--matcher", "hide"),
        ("hsl0", "--matcher", "hsl"),
        ("hsl1", "--matcher", "hsl", "--seed", 1),
    ):
        hsslam("run", "office", "--scans", SCANS, "--out", home / name, "--quiet", *options)
    shutil.copy(home / "hide" / "odometry.tum", home / "gmapping.tum")
    return home


@pytest.fixture(scope="module")
def page(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("page") / "out"
    hsslam(
        "report",
        runs / "hide",
        runs / "hsl0",
        runs / "hsl1",
        f"GMapping={runs / 'gmapping.tum'}",
        "--out",
        out,
    )
    return out


def test_rows_are_matchers_and_their_seeds(page: Path, runs: Path) -> None:
    (comparison,) = Study.load(page).comparisons
    assert [(row.label, [run.seed for run in row.runs]) for row in comparison.matchers] == [
        ("hide", [0]),
        ("hsl", [0, 1]),
        ("GMapping", [None]),
    ]
    hide, _, other = comparison.matchers
    metrics = json.loads((runs / "hide" / "metrics.json").read_text())
    assert hide.slam is not None and hide.slam.accuracy.ate is not None
    assert hide.slam.accuracy.ate["translation_rmse_m"] == pytest.approx(
        metrics["ate"]["translation_rmse_m"], rel=1e-6
    )
    assert hide.slam.loops_tried == metrics["loops_tried"] == len(hide.slam.loops)
    assert other.slam is not None and other.slam.accuracy.ate == pytest.approx(
        other.slam.odometry_accuracy.ate, rel=1e-6
    )
    assert other.slam.loops_tried is None
    assert any("different seeds (hide: 0; hsl: 0, 1)" in note for note in comparison.notes)


def test_the_page_has_maps_and_what_is_not_known_is_a_dash(page: Path) -> None:
    text = (page / "report.md").read_text()
    assert "figures/office-map-hide.png" in text and "figures/office-trajectory-GMapping.png" in text
    (row,) = [
        line
        for line in (page / "tables" / "office-slam-cost.csv").read_text().splitlines()
        if line.startswith("GMapping")
    ]
    assert set(row.removeprefix("GMapping,1").replace(",", "")) == set()
    assert "differ in more than the matcher" not in text


def test_labels_tell_settings_apart(runs: Path, tmp_path: Path) -> None:
    other = tmp_path / "narrow"
    hsslam(
        "run",
        "office",
        "--scans",
        SCANS,
        "--matcher",
        "hide",
        "--set",
        "matcher.evaluations=90",
        "--out",
        other,
        "--quiet",
    )
    hsslam("report", runs / "hide", other, f"wide={runs / 'hide'}", "--out", tmp_path / "page", "--quiet")
    (comparison,) = Study.load(tmp_path / "page").comparisons
    assert [row.label for row in comparison.matchers] == ["hide", "narrow", "wide"]


def test_a_run_that_died_is_a_row_with_its_remedy(runs: Path, tmp_path: Path) -> None:
    died = tmp_path / "died"
    shutil.copytree(runs / "hide", died)
    (died / "metrics.json").unlink()
    hsslam("report", died, runs / "hsl0", "--out", tmp_path / "page", "--quiet")
    assert f"hsslam run --resume {died}" in (tmp_path / "page" / "report.md").read_text()


def test_the_command_tells_of_a_run_that_died(runs: Path, tmp_path: Path) -> None:
    died = tmp_path / "died"
    died.mkdir()
    for name in ("config.yaml", "environment.json", "journal.jsonl"):
        shutil.copy(runs / "hide" / name, died / name)
    said = hsslam("report", died, "--out", tmp_path / "page")
    assert f"hide: SLAM failed: the run in {died} is not complete" in said
    assert f"to mend it: hsslam run --resume {died}" in said
    assert f"`hsslam run --resume {died}` completes it" in complains("convert", died, tmp_path / "died.tum")


def test_a_trajectory_alone_needs_its_log(runs: Path, tmp_path: Path) -> None:
    file = runs / "gmapping.tum"
    assert "which log" in complains("report", file, "--out", tmp_path / "a")
    hsslam("report", file, "--dataset", "office", "--scans", SCANS, "--out", tmp_path / "b", "--quiet")
    (comparison,) = Study.load(tmp_path / "b").comparisons
    assert [row.label for row in comparison.matchers] == ["gmapping"]
    shorter = complains("report", file, "--dataset", "office", "--scans", SCANS // 2, "--out", tmp_path / "c")
    assert "gmapping.tum: pose" in shorter


def test_what_is_no_run_is_said(tmp_path: Path) -> None:
    assert "no such run folder" in complains("report", tmp_path / "nothing")
    assert "is no run folder" in complains("report", tmp_path)


def test_the_page_of_a_comparison_is_made_anew(page: Path, runs: Path) -> None:
    before = (page / "report.html").read_bytes()
    (page / "report.html").unlink()
    hsslam("report", page, "--quiet")
    assert (page / "report.html").read_bytes() == before
    assert "own folder" in complains("report", page, runs / "hide")


def test_a_trajectory_of_another_system_is_listed_among_those_who_competed(page: Path) -> None:
    text = (page / "report.html").read_text()
    start = text.index("Who competed")
    listed = text[start : text.index("</table>", start)]
    assert listed.count("not known: a trajectory given as a file") == 1
    assert "GMapping" in listed and "hide" in listed
