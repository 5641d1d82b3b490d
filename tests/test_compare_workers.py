"""A comparison whose jobs workers do side by side, and one that grows: what it finds is the same."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from hsslam import plugin_files
from hsslam.cli.main import app

PLUGIN = """
import ctypes
from hsslam.matching import Matcher

class CompareSegfault(Matcher):
    def estimate(self, reference, points, guess, window, rng):
        print("about to go", flush=True)
        ctypes.string_at(0)
"""
COMPARE = (
    "compare",
    "office",
    "--scans",
    "30",
    "--no-slam",
    "--trials",
    "3",
    "--set",
    "hide.search_points=24",
)
TIMES = re.compile("seconds|created|command|environment|hands|peak_memory")


def hsslam(*args: str | Path) -> Result:
    return CliRunner().invoke(app, [*COMPARE, *map(str, args)])


def findings(value: Any) -> Any:
    """What must be the same however the jobs were done: all of a comparison but times and places."""
    if isinstance(value, dict):
        return {key: findings(inner) for key, inner in value.items() if not TIMES.search(key)}
    return [findings(inner) for inner in value] if isinstance(value, list) else value


def comparison(out: Path) -> dict[str, Any]:
    (only,) = json.loads((out / "comparison.json").read_text())["comparisons"]
    return dict(only)


@pytest.fixture(scope="module")
def serial(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Jobs one after the other; a matcher that crashes is among them."""
    place = tmp_path_factory.mktemp("serial")
    (place / "plugin.py").write_text(PLUGIN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(plugin_files.VARIABLE, "")
        plugin_files.use(place / "plugin.py")
        assert hsslam("--matchers", "hide,compare_segfault", "--out", place / "out").exit_code == 0
        yield place / "out"


def test_workers_find_the_same_and_the_page_says_that_there_were_some(serial: Path, tmp_path: Path) -> None:
    result = hsslam("--matchers", "hide,compare_segfault", "--workers", "2", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    side = tmp_path / "out"
    assert findings(comparison(side)) == findings(comparison(serial))
    segfault = comparison(side)["matchers"][1]
    assert [failure["stage"] for failure in segfault["failures"]] == ["trials"]
    assert all("SIGSEGV" in failure["reason"] for failure in segfault["failures"])
    assert (comparison(serial)["hands"], comparison(side)["hands"]) == (1, 2)
    assert comparison(side)["hosts"] == []
    for out, clock, jobs in (
        (serial, "the clock (one process at a time", "one after the other"),
        (side, "the clock (up to 2 processes at a time", "up to 2 side by side"),
    ):
        text = (out / "report.md").read_text()
        assert clock in text and jobs in text


def test_a_folder_takes_more_and_does_only_what_is_missing(serial: Path) -> None:
    def stamps() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in serial.glob("jobs/*/result.json")}

    before = stamps()
    assert len(before) == 1
    result = hsslam(
        "--matchers",
        "hsl,compare_segfault,hide",
        "--seeds",
        "2",
        "--out",
        serial,
    )
    assert result.exit_code == 0, result.output
    after = stamps()
    assert len(after) == 4
    assert {path: after[path] for path in before} == before
    grown = {matcher["label"]: matcher for matcher in comparison(serial)["matchers"]}
    assert list(grown) == ["hsl", "compare_segfault", "hide"]
    for label in ("hide", "hsl"):
        assert grown[label]["trials"]["data"]["seed"] == [0, 0, 0, 1, 1, 1]
    result = hsslam("--matchers", "hsl,compare_segfault,hide", "--out", serial)
    assert result.exit_code == 2
    assert "holds another comparison (config.seeds was 2, now 1)" in result.stderr
    result = hsslam("--matchers", "hide,compare_segfault", "--seeds", "2", "--out", serial)
    assert result.exit_code == 2
    assert "config.matchers" in result.stderr
    assert stamps() == after


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--workers", "2", "--scheduler", "tcp://x:1"), "give one of the two"),
        (("--scheduler", "tcp://x:1", "--data-dir", "here"), "--data-dir is for local workers"),
    ],
)
def test_options_that_exclude_each_other_are_told_at_once(options: tuple[str, ...], said: str) -> None:
    result = hsslam(*options)
    assert result.exit_code == 2 and said in result.stderr
