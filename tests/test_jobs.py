"""Jobs: a key of what decides the result and of nothing else; done once, the same wherever it is done."""

from __future__ import annotations

from pathlib import Path

import pytest

from hsslam.errors import DataError
from hsslam_eval.compare import CompareConfig, DatasetSpec, compare_datasets, jobs_of, part_names
from hsslam_eval.compare_config import LimitSection
from hsslam_eval.comparison import Failure, MatcherTrials, Study
from hsslam_eval.jobs import Job, result_of, run_job

OFFICE = DatasetSpec(name="office", scans=40)
TRIALS = {"count": 4, "warm_up": 1, "resamples": 100}


def job(**changes: object) -> Job:
    given = {"kind": "trials", "dataset": OFFICE, "matcher": "hide", "seed": 1, "trials": TRIALS, **changes}
    return Job.model_validate(given)


def test_the_key_is_of_what_decides_the_result() -> None:
    key = job().key
    assert job(matcher={"name": "hide", "label": "mine"}).key == key
    assert job(dataset=OFFICE.model_copy(update={"data_dir": Path("/elsewhere")})).key == key
    assert job(slam={"loops": {"radius": 2.0}}).key == key
    different = [
        job(seed=2),
        job(kind="slam"),
        job(matcher="hsl"),
        job(matcher={"name": "hide", "evaluations": 99}),
        job(dataset=OFFICE.model_copy(update={"seed": 1})),
        job(dataset=OFFICE.model_copy(update={"scans": 41})),
        job(trials={**TRIALS, "count": 5}),
        job(kind="slam", slam={"loops": {"radius": 2.0}}),
    ]
    assert len({key, *(other.key for other in different)}) == len(different) + 1


def test_the_key_of_a_log_is_of_its_content(tmp_path: Path) -> None:
    one, two = tmp_path / "one.log", tmp_path / "two.log"
    one.write_text("FLASER")
    two.write_text("FLASER")
    assert job(dataset={"name": str(one)}).key == job(dataset={"name": str(two)}).key
    (tmp_path / "two.relations").write_text("0 1 0 0 0 0 0 0")
    assert job(dataset={"name": str(one)}).key != job(dataset={"name": str(two)}).key
    with pytest.raises(DataError, match=r"three\.log: cannot be read"):
        job(dataset={"name": str(tmp_path / "three.log")}).key  # noqa: B018


def test_a_job_is_done_once_and_the_same_anywhere(tmp_path: Path) -> None:
    wanted = job()
    assert result_of(wanted, tmp_path / "a") is None
    first = run_job(wanted, tmp_path / "a")
    assert isinstance(first, MatcherTrials)
    assert Job.load(tmp_path / "a").key == wanted.key
    began = (tmp_path / "a" / "result.json").stat().st_mtime_ns
    assert repr(run_job(wanted, tmp_path / "a")) == repr(first)
    assert (tmp_path / "a" / "result.json").stat().st_mtime_ns == began
    again = run_job(wanted, tmp_path / "b")
    assert isinstance(again, MatcherTrials)
    for name in ("displacement_m", "rotation_deg", "evaluations", "score", "initial_displacement_m"):
        assert getattr(again.data, name) == getattr(first.data, name)


def test_a_broken_result_says_what_mends_it(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text("{}")
    found = run_job(job(), tmp_path)
    assert isinstance(found, Failure) and found.remedy == f"rm {tmp_path / 'result.json'}"


def test_a_listener_that_raises_ends_the_job(tmp_path: Path) -> None:
    def press(stage: str, done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_job(job(), tmp_path, LimitSection(), press)
    assert result_of(job(), tmp_path) is None


def config(**changes: object) -> CompareConfig:
    return CompareConfig.model_validate({"matchers": ["hide"], "seed": 3, "trials": TRIALS, **changes})


def test_an_interrupted_study_goes_on_where_it_was(tmp_path: Path) -> None:
    datasets = [OFFICE, DatasetSpec(name="hall", scans=30)]
    told: list[tuple[str, str]] = []

    def interrupt(stage: str, part: str, done: int, total: int) -> None:
        told.append((stage, part))
        if stage == "slam" and part == "hall, hide":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare_datasets(config(), datasets, tmp_path, interrupt)
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("jobs/*/result.json")}
    assert len(kept) == 3
    told.clear()
    study = compare_datasets(config(), datasets, tmp_path, lambda stage, part, *_: told.append((stage, part)))
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert {part for stage, part in told if stage == "slam"} == {"hall, hide"}
    assert [comparison.dataset.name for comparison in study.comparisons] == ["office", "hall"]
    for comparison in study.comparisons:
        (row,) = comparison.matchers
        assert row.trials is not None and row.trials.count == 4
        assert [run.seed for run in row.runs] == [3]
        assert all((tmp_path / run.folder / "trajectory.tum").is_file() for run in row.runs)
    again = Study.load(tmp_path).save(tmp_path / "again")
    assert again.read_bytes() == (tmp_path / "comparison.json").read_bytes()


def test_seeds_are_pooled(tmp_path: Path) -> None:
    wanted = config(seeds=2, run_slam=False)
    (comparison,) = compare_datasets(wanted, [OFFICE], tmp_path).comparisons
    (row,) = comparison.matchers
    assert row.trials is not None and row.trials.data.seed == [3] * 4 + [4] * 4
    single = [
        result_of(one, tmp_path / "jobs" / one.name) for one in jobs_of(wanted, OFFICE, wanted.contestants[0])
    ]
    parts = [found for found in single if isinstance(found, MatcherTrials)]
    assert row.trials.count == 8 == sum(part.count for part in parts)
    assert row.trials.data.displacement_m == [error for part in parts for error in part.data.displacement_m]
    assert row.trials.successes[1].count == sum(part.successes[1].count for part in parts)
    assert row.trials.evaluations_mean == pytest.approx(sum(part.evaluations_mean for part in parts) / 2)


def test_every_seed_draws_its_own_log_and_trials() -> None:
    wanted = config(seeds=2)
    jobs = jobs_of(wanted, OFFICE, wanted.contestants[0])
    assert [(one.kind, one.seed, one.dataset.seed) for one in jobs] == [
        ("trials", 3, 0),
        ("slam", 3, 0),
        ("trials", 4, 1),
        ("slam", 4, 1),
    ]
    assert part_names(wanted, [OFFICE, OFFICE])[:2] == ["office, hide, seed 3", "office, hide, seed 4"]
