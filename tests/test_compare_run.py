"""A comparison from end to end, with matchers of a package made for it: one works, the others fail in their ways."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hsslam.errors import ConfigError, DataError
from hsslam.matching import create
from hsslam.slam.folder import FILES
from hsslam_eval.compare import CompareConfig, DatasetSpec, compare
from hsslam_eval.comparison import Comparison, MatcherOutcome, Study
from hsslam_eval.trials import make_pairs, run_trials

MODULE = """
import os, signal
from hsslam.errors import MatcherUnavailableError
from hsslam.matching import Estimate, Matcher

class Steady(Matcher):
    def estimate(self, reference, points, guess, window, rng):
        return Estimate(guess + rng.uniform(-1e-3, 1e-3, 3), evaluations=7)

class Raising(Matcher):
    def estimate(self, reference, points, guess, window, rng):
        raise RuntimeError("no luck today")

class Crashing(Matcher):
    def estimate(self, reference, points, guess, window, rng):
        print("about to go", flush=True)
        os.kill(os.getpid(), signal.SIGSEGV)

class Missing(Steady):
    @classmethod
    def check_available(cls):
        if "FAKE_MATCHERS_MENDED" not in os.environ:
            raise MatcherUnavailableError("missing", "no module named nowhere", "pip install nowhere")
"""
NAMES = {"steady": "Steady", "raising": "Raising", "crashing": "Crashing", "missing": "Missing"}
DATASET = DatasetSpec(name="office", seed=3, scans=60)


@pytest.fixture(scope="module", autouse=True)
def fake_matchers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Install the package for this process and those that it starts."""
    place = tmp_path_factory.mktemp("installed")
    (place / "fake_matchers.py").write_text(MODULE)
    metadata = place / "fake_matchers-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: fake-matchers\nVersion: 1.0\n")
    lines = [f"{name} = fake_matchers:{cls}" for name, cls in NAMES.items()]
    (metadata / "entry_points.txt").write_text("[hsslam.matchers]\n" + "\n".join(lines) + "\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(place))
        before = os.environ.get("PYTHONPATH")
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, [str(place), before])))
        yield


def config(*matchers: object, **settings: object) -> CompareConfig:
    return CompareConfig.model_validate(
        {"matchers": matchers, "seed": 5, "trials": {"count": 12}, **settings}
    )


Told = list[tuple[str, str, int, int]]


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Comparison, Path, Told]:
    out = tmp_path_factory.mktemp("comparison")
    told: Told = []
    comparison = compare(
        config(*NAMES), DATASET, out, lambda *step: told.append(step), command="hsslam compare office"
    )
    return comparison, out, told


def row(comparison: Comparison, label: str) -> MatcherOutcome:
    return next(matcher for matcher in comparison.matchers if matcher.label == label)


def test_the_working_matcher_has_its_full_row(done: tuple[Comparison, Path, Told]) -> None:
    comparison, out, _ = done
    steady = row(comparison, "steady")
    assert steady.failures == []
    assert steady.trials is not None and steady.slam is not None
    assert steady.trials.count == 12
    assert steady.trials.evaluations_mean == 7.0
    slam = steady.slam
    assert slam.scans == 60
    assert slam.accuracy.ate is not None and slam.accuracy.relations is None
    assert slam.reference_kind == "truth"
    assert 20.0 < slam.peak_memory_mb < 5000.0
    assert slam.real_time_factor == pytest.approx(slam.log_seconds / slam.wall_seconds)
    assert all((out / slam.folder / name).is_file() for name in FILES)


def test_trials_are_those_of_the_library(done: tuple[Comparison, Path, Told]) -> None:
    steady = row(done[0], "steady")
    settings = config("steady").trials.model_copy(update={"seed": 5})
    expected = run_trials("steady", create("steady"), make_pairs(DATASET.open(), settings), settings)
    assert steady.trials is not None
    assert steady.trials.data.displacement_m == expected.displacement.tolist()
    assert steady.trials.data.rotation_deg == np.degrees(expected.rotation).tolist()


def test_a_raising_matcher_costs_its_row_only(done: tuple[Comparison, Path, Told]) -> None:
    raising = row(done[0], "raising")
    assert raising.trials is not None
    assert raising.trials.unanswered == {"RuntimeError: no luck today": 12}
    assert raising.trials.successes[0].count == 0
    assert raising.slam is None
    assert [(failure.stage, failure.reason) for failure in raising.failures] == [
        ("slam", "RuntimeError: no luck today")
    ]


def test_a_crash_costs_its_row_only(done: tuple[Comparison, Path, Told]) -> None:
    crashing = row(done[0], "crashing")
    assert crashing.trials is None and crashing.slam is None
    assert [failure.stage for failure in crashing.failures] == ["trials", "slam"]
    for failure in crashing.failures:
        assert "SIGSEGV" in failure.reason
        assert "about to go" in failure.reason


def test_an_unavailable_matcher_says_how_to_mend_it(done: tuple[Comparison, Path, Told]) -> None:
    missing = row(done[0], "missing")
    assert [(f.stage, f.reason, f.remedy) for f in missing.failures] == [
        ("unavailable", "no module named nowhere", "pip install nowhere")
    ]


def test_progress_goes_to_the_end_of_each_part(done: tuple[Comparison, Path, Told]) -> None:
    told = done[2]
    steady = [(stage, done, total) for stage, matcher, done, total in told if matcher == "steady"]
    assert ("trials", 12, 12) in steady
    assert ("slam", 60, 60) in steady
    assert [stage for stage, *_ in steady].count("done") == 2
    assert {matcher for stage, matcher, *_ in told if stage == "failed"} == {"raising", "crashing", "missing"}


def test_json_round_trip(done: tuple[Comparison, Path, Told], tmp_path: Path) -> None:
    comparison, out, _ = done
    again = Study.load(out)
    assert again.save(tmp_path).read_bytes() == (out / "comparison.json").read_bytes()
    assert again.comparisons[0].config == comparison.config
    assert (
        json.loads((out / "comparison.json").read_text())["comparisons"][0]["command"]
        == "hsslam compare office"
    )


def test_what_is_complete_is_kept_and_what_failed_is_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = config("steady", "missing", run_slam=False)
    first = compare(settings, DATASET, tmp_path)
    assert row(first, "missing").failures and row(first, "steady").trials is not None
    monkeypatch.setenv("FAKE_MATCHERS_MENDED", "1")
    told: Told = []
    second = compare(settings, DATASET, tmp_path, lambda *step: told.append(step))
    assert row(second, "missing").trials is not None and row(second, "missing").failures == []
    # As text: a spread of nothing is NaN, which equals nothing.
    assert repr(row(second, "steady").trials) == repr(row(first, "steady").trials)
    assert {matcher for stage, matcher, *_ in told if stage == "trials"} == {"missing"}
    with pytest.raises(ConfigError, match=r"holds another comparison \(config\.seed was 5, now 6\)"):
        compare(settings.model_copy(update={"seed": 6}), DATASET, tmp_path)
    with pytest.raises(ConfigError, match=r"datasets\.0\.scans was 60, now 61"):
        compare(settings, DATASET.model_copy(update={"scans": 61}), tmp_path)


def test_a_folder_of_something_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(DataError, match=r"something else than a comparison \(thesis\.tex\)"):
        compare(config("steady"), DATASET, tmp_path)
    assert [item.name for item in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"matchers": ["stedy"]}, "did you mean 'steady'"),
        ({"matchers": [{"name": "steady", "score_distnce": 0.1}]}, "did you mean 'score_distance'"),
        ({"matchers": []}, "at least 1"),
        ({"matchers": ["steady"], "slam": {"matcher": "hide"}}, "slam.matcher"),
        ({"matchers": ["steady"], "trials": {"seed": 1}}, "trials.seed"),
        ({"matchers": ["steady"], "run_trials": False, "run_slam": False}, "nothing to do"),
        ({"matchers": [{"name": "steady", "label": "../up"}]}, "a label names files"),
        ({"matchers": ["steady", {"name": "raising", "label": "Steady"}]}, "same label"),
    ],
)
def test_bad_settings_are_found_before_anything_runs(given: dict[str, object], message: str) -> None:
    from hsslam.config import validate

    with pytest.raises(ConfigError, match=message):
        validate(CompareConfig, given)


def test_one_matcher_twice_gets_two_labels() -> None:
    settings = config(
        "steady", {"name": "steady", "score_distance": 0.12}, {"name": "steady", "label": "loose"}
    )
    assert [contestant.label for contestant in settings.contestants] == ["steady", "steady-2", "loose"]
    assert settings.contestants[1].parameters["score_distance"] == 0.12


def test_settings_survive_their_own_dump() -> None:
    settings = config({"name": "steady", "score_distance": 0.12}, slam={"loops": {"radius": 2.5}})
    assert CompareConfig.model_validate(settings.resolved()).resolved() == settings.resolved()
