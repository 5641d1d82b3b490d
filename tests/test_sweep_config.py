"""What a sweep's file says: which jobs it comes to, and one line for whatever is wrong in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from hsslam.cli.main import app
from hsslam.cli.sweep import read
from hsslam.config import validate
from hsslam.errors import ConfigError, DataError
from hsslam_eval.compare import CompareConfig, DatasetSpec, jobs_of
from hsslam_eval.sweep_config import Point, SweepConfig, expand

EXAMPLE = Path(__file__).parents[1] / "docs" / "examples" / "sweep.yaml"
SMALL: dict[str, Any] = {"matchers": ["hide"], "datasets": ["office"]}


def points(**changes: Any) -> list[Point]:
    return expand(validate(SweepConfig, {**SMALL, **changes}))


def test_the_example_is_every_combination() -> None:
    found = expand(read(EXAMPLE))
    assert [
        (point.job.matcher.name, point.parameters, point.settings, point.job.seed) for point in found
    ] == [
        (matcher, parameters, {"trials.half_xy": half}, seed)
        for matcher, grid in (("hide", [{"memory_size": 10}, {"memory_size": 20}]), ("glasm", [{}]))
        for parameters in grid
        for half in (0.1, 0.2)
        for seed in (0, 1)
    ]
    for point in found:
        assert point.job.trials.half_xy == point.settings["trials.half_xy"]
        assert point.parameters.items() <= point.job.matcher.parameters.items()
    assert len({point.job.key for point in found}) == len({point.job.name for point in found}) == 12


def test_a_setting_of_slam_does_not_multiply_trials() -> None:
    found = points(grid={"slam.tracker.min_score": [0.4, 0.5, 0.6], "trials.count": [10, 20]})
    assert [(point.job.kind, point.settings) for point in found] == [
        ("trials", {"trials.count": 10}),
        ("trials", {"trials.count": 20}),
        *(("slam", {"slam.tracker.min_score": score}) for score in (0.4, 0.5, 0.6)),
    ]
    assert [point.job.slam.tracker.min_score for point in found[2:]] == [0.4, 0.5, 0.6]


def test_a_loop_matcher_may_be_swept() -> None:
    slam = {"loop_matcher": {"name": "hide", "evaluations": 300}}
    grid = {"slam.loop_matcher": ["glasm", {"name": "hide", "memory_size": 12}]}
    first, second = points(run_trials=False, slam=slam, grid=grid)
    assert first.job.slam.loop_matcher is not None and first.job.slam.loop_matcher.name == "glasm"
    loop_matcher = second.job.slam.loop_matcher
    assert loop_matcher is not None and loop_matcher.parameters.model_dump()["memory_size"] == 12


def test_a_comparison_is_the_same_jobs() -> None:
    settings: dict[str, Any] = {
        "matchers": ["hide", {"name": "hsl", "memory_size": 12}],
        "seed": 3,
        "seeds": 2,
        "trials": {"count": 7},
        "slam": {"loops": {"radius": 2.0}, "loop_matcher": "glasm"},
    }
    comparison = CompareConfig.model_validate(settings)
    dataset = DatasetSpec(name="office", seed=3, scans=50)
    jobs = [job for who in comparison.contestants for job in jobs_of(comparison, dataset, who)]
    swept = [point.job for point in points(**settings, datasets=[{"name": "office", "scans": 50}])]
    assert {job.name for job in swept} == {job.name for job in jobs}
    assert len(swept) == len(jobs) == 8


def test_every_dataset_has_the_seed_of_the_sweep_or_its_own() -> None:
    found = points(seed=5, datasets=["office", {"name": "hall", "seed": 1}], run_slam=False)
    assert [(point.job.dataset.name, point.job.dataset.seed) for point in found] == [
        ("office", 5),
        ("hall", 1),
    ]


def test_a_log_is_named_by_its_full_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "drive.log").write_text("FLASER")
    monkeypatch.chdir(tmp_path)
    (point,) = points(datasets=["drive.log"], run_slam=False)
    assert point.job.dataset.name == str((tmp_path / "drive.log").resolve())


def test_a_real_log_need_not_be_here(tmp_path: Path) -> None:
    config = validate(SweepConfig, {**SMALL, "datasets": ["intel"], "run_slam": False})
    here, elsewhere = expand(config, data_dir=tmp_path), expand(config)
    assert here[0].job.dataset.data_dir == tmp_path
    assert here[0].job.key == elsewhere[0].job.key


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"matcher": ["hide"]}, "matcher: unknown setting; did you mean 'matchers'?"),
        ({"matchers": ["hid"]}, "no matcher is named 'hid'"),
        ({"matchers": []}, "matchers: "),
        ({"datasets": []}, "datasets: "),
        (
            {"datasets": [{"name": "office", "scan": 4}]},
            "datasets.0.scan: unknown setting; did you mean 'scans'?",
        ),
        ({"datasets": [{"name": "intel", "data_dir": "/x"}]}, "set HSSLAM_DATA where the worker starts"),
        ({"grid": {}}, "grid: "),
        ({"grid": {"trials.count": []}}, "grid.trials.count: "),
        ({"grid": {"trials.count": 5}}, "grid.trials.count: input should be a valid list, found 5"),
        ({"grid": {"trials.count": [5, 6, 5]}}, "grid.trials.count: has 5 more than once"),
        ({"grid": {"memory_size": [5]}}, "a matcher's parameters go into its own grid"),
        ({"grid": {"slam.loops.every": [1]}, "run_slam": False}, "would change nothing, as run_slam is off"),
        ({"matchers": [{"name": "hide", "grid": {"memory_size": []}}]}, "matchers.0.grid.memory_size: "),
        (
            {"matchers": [{"name": "hide", "memory_size": 9, "grid": {"memory_size": [10]}}]},
            "grid.memory_size: is given a value beside the grid too",
        ),
        ({"slam": {"matcher": "hsl"}}, "a comparison has one place for that"),
    ],
)
def test_one_line_says_what_is_wrong(changes: dict[str, Any], said: str, tmp_path: Path) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(yaml.safe_dump({**SMALL, **changes}))
    result = CliRunner().invoke(app, ["sweep", str(file), "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert said in result.output and "wrong.yaml" in result.output
    assert len(result.output.splitlines()) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"grid": {"trials.cuont": [5]}}, "trials.cuont: unknown setting; did you mean 'count'?"),
        ({"grid": {"trials.count": [5, -1]}}, "trials.count: input should be greater than or equal to 1"),
        ({"grid": {"slam.matcher": ["hsl"]}}, "a comparison has one place for that"),
        ({"matchers": [{"name": "hide", "grid": {"memry_size": [5]}}]}, "did you mean 'memory_size'?"),
        ({"matchers": [{"name": "hide", "grid": {"memory_size": [-5]}}]}, "memory_size"),
    ],
)
def test_a_value_of_a_grid_is_judged_before_anything_runs(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        points(**changes)
    assert said in str(caught.value) and "grid" in str(caught.value)


def test_an_unknown_dataset_is_found_before_anything_runs() -> None:
    with pytest.raises(DataError, match="did you mean 'office'"):
        points(datasets=["offise"])


def test_the_resolved_sweep_is_the_same_sweep() -> None:
    config = read(EXAMPLE)
    again = validate(SweepConfig, yaml.safe_load(yaml.safe_dump(config.resolved())))
    assert [point.job.name for point in expand(again)] == [point.job.name for point in expand(config)]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--scheduler", "tcp://localhost:1", "--workers", "2"], "give one of the two"),
        (["--scheduler", "tcp://localhost:1", "--data-dir", "."], "their own data directory"),
    ],
)
def test_options_that_exclude_each_other(options: list[str], said: str) -> None:
    result = CliRunner().invoke(app, ["sweep", str(EXAMPLE), *options])
    assert result.exit_code == 2 and said in result.output
