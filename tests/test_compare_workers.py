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
from hsslam.errors import ConfigError
from hsslam_eval.compare import CompareConfig, DatasetSpec, compare_datasets
from hsslam_eval.workspace import Workspace

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


OFFICE, HALL = (DatasetSpec(name=name, scans=30) for name in ("office", "hall"))


def config(*matchers: str, **changes: Any) -> CompareConfig:
    trials = {"count": 2, "warm_up": 1, "resamples": 100}
    return CompareConfig.model_validate(
        {"matchers": matchers, "trials": trials, "run_slam": False, **changes}
    )


def test_a_folder_takes_more_and_does_only_what_is_missing(tmp_path: Path) -> None:
    def stamps() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in tmp_path.glob("jobs/*/result.json")}

    compare_datasets(config("hide"), [OFFICE], tmp_path)
    before = stamps()
    assert len(before) == 1
    (found,) = compare_datasets(config("hsl", "hide", seeds=2), [OFFICE], tmp_path).comparisons
    assert len(stamps()) == 4
    assert {path: stamps()[path] for path in before} == before
    assert [matcher.label for matcher in found.matchers] == ["hsl", "hide"]
    assert all(m.trials is not None and m.trials.data.seed == [0, 0, 1, 1] for m in found.matchers)


GROWN = config("hsl", "hide", seeds=2)


@pytest.mark.parametrize(
    ("other", "datasets", "said"),
    [
        (config("hide", "hsl", seeds=3, run_slam=True), [OFFICE, HALL], ""),
        (GROWN, [HALL, OFFICE], ""),
        (config("hsl", "hide"), [OFFICE], "(config.seeds was 2, now 1)"),
        (config("hide", seeds=2), [OFFICE], 'config.matchers.0.name was "hsl", now "hide"'),
        (GROWN, [HALL], 'datasets.0.name was "office", now "hall"'),
        (
            config("hsl", "hide", seeds=2, run_slam=True, run_trials=False),
            [OFFICE],
            "config.run_trials was true",
        ),
        (config("hsl", "hide", seeds=2, trials={"count": 3}), [OFFICE], "config.trials.count was 2, now 3"),
    ],
)
def test_more_is_the_same_comparison_and_less_or_other_is_not(
    tmp_path: Path, other: CompareConfig, datasets: list[DatasetSpec], said: str
) -> None:
    Workspace.prepare(tmp_path, GROWN, [OFFICE])
    if not said:
        Workspace.prepare(tmp_path, other, datasets)
        said = "holds another comparison"  # from here on, what there was first is less
        other, datasets = GROWN, [OFFICE]
    with pytest.raises(ConfigError, match=re.escape(said)):
        Workspace.prepare(tmp_path, other, datasets)


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
