"""The report of a comparison: one page that needs nothing else, and twins that say the same."""

from __future__ import annotations

import base64
import csv
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsslam.environment import environment
from hsslam.mapping.occupancy import OccupancyGrid
from hsslam.mapping.rosmap import write_rosmap
from hsslam_eval.comparison import (
    Accuracy,
    Comparison,
    DatasetRecord,
    Failure,
    MatcherOutcome,
    MatcherTrials,
    SlamOutcome,
    Study,
)
from hsslam_eval.figures import trial_pictures
from hsslam_eval.outcomes import trials_record
from hsslam_eval.report import write_report
from hsslam_eval.slam_tables import slam_tables
from hsslam_eval.tables import number
from hsslam_eval.trial_tables import trial_tables, verdict
from hsslam_eval.trials import TrialConfig, TrialResult

TRIALS = 60


def trials(
    rng: np.random.Generator, centimetres: float, failing: float, raising: bool = False
) -> MatcherTrials:
    good = rng.random(TRIALS) >= failing
    displacement = np.where(good, 0.01 * centimetres * rng.lognormal(0.0, 0.3, TRIALS), 0.5)
    nothing = np.full(TRIALS, math.nan)
    result = TrialResult(
        matcher="any",
        protocol="simulated",
        config=TrialConfig(resamples=200),
        displacement=displacement,
        rotation=np.where(good, 0.002, 0.3),
        initial_displacement=np.full(TRIALS, 0.1),
        initial_rotation=np.full(TRIALS, 0.1),
        seconds=nothing if raising else rng.uniform(1e-4, 1e-3, TRIALS),
        prepare_seconds=nothing if raising else np.full(TRIALS, 1e-4),
        evaluations=np.full(TRIALS, 250),
        score=np.ones(TRIALS),
        converged=np.ones(TRIALS, dtype=np.bool_),
        failures=tuple("ValueError: a | b" if raising else "" for _ in range(TRIALS)),
    )
    return trials_record(result)


def slam(label: str, relations: bool = False) -> SlamOutcome:
    angle = np.linspace(0.0, 6.0, 50)
    way = [(float(x), float(y)) for x, y in zip(10.0 * np.cos(angle), 4.0 * np.sin(angle), strict=True)]
    accuracy = (
        Accuracy(relations={"count": 9.0, "translation_mean_m": 0.0213, "translation_std_m": 0.0101}
                 | {"rotation_mean_deg": 0.4, "rotation_std_deg": 0.3})
        if relations
        else Accuracy(ate={"translation_rmse_m": 0.0123, "rotation_rmse_deg": 0.4, "count": 50.0})
    )  # fmt: skip
    return SlamOutcome(
        folder=f"runs/{label}", scans=50, matched=49, keyframes=20, loops_tried=5, loops_accepted=3,
        wall_seconds=2.0, cpu_seconds=2.1, warm_up_seconds=0.5, log_seconds=100.0, peak_memory_mb=300.0,
        stage_seconds={"track": 1.0}, accuracy=accuracy, odometry_accuracy=accuracy, path=way,
        reference_path=way, reference_kind="odometry" if relations else "truth",
    )  # fmt: skip


def comparison(*matchers: MatcherOutcome, attribution: str = "") -> Comparison:
    settings = {
        "seed": 0,
        "run_trials": True,
        "run_slam": True,
        "trials": TrialConfig().model_dump(mode="json"),
    }
    dataset = DatasetRecord("office", "simulated", "An office.", attribution, 0, 50)
    return Comparison(
        dataset, settings, "hsslam compare office", "2026-01-01T00:00:00", environment(), [*matchers]
    )


def full_comparison() -> Comparison:
    """One matcher that does well, one whose SLAM failed, one that is unavailable, one that raises."""
    rng = np.random.default_rng(3)
    return comparison(
        MatcherOutcome("good", "good", {"memory_size": 30}, trials(rng, 1.0, 0.0), [slam("good")]),
        MatcherOutcome("bad", "bad", {}, trials(rng, 4.0, 0.5), [], [Failure("slam", "it <broke> & fell")]),
        MatcherOutcome("gone", "gone", {}, None, [], [Failure("unavailable", "no module", "pip install it")]),
        MatcherOutcome("raising", "raising", {}, trials(rng, 1.0, 1.0, raising=True), [slam("raising")]),
        attribution="Recorded by somebody, CC-BY 3.0",
    )


def write_full(found: Comparison, out: Path) -> Path:
    """Its page, with a map."""
    odds = np.zeros((80, 200), dtype=np.float32)
    odds[10:70, 10:190], odds[10, 10:190] = -2.0, 2.0
    (out / "runs" / "good").mkdir(parents=True)
    write_rosmap(out / "runs" / "good" / "map", OccupancyGrid(np.array([-10.0, -4.0]), 0.1, odds))
    Study([found]).save(out)
    return write_report(found, out)


@pytest.fixture(scope="module")
def full() -> Comparison:
    return full_comparison()


@pytest.fixture(scope="module")
def folder(full: Comparison, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report")
    assert write_full(full, out) == out / "report.html"
    return out


class Page(HTMLParser):
    """Collects tags with their attributes, text, and the tags that were left open."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.open: list[str] = []
        self.feed(source)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "img", "br", "link"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def test_the_page_loads_nothing(folder: Path) -> None:
    source = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(source)
    assert page.open == []
    pictures = [attributes for tag, attributes in page.tags if tag == "img"]
    # Seven of the trials, error against time of SLAM, two trajectories, one map.
    assert len(pictures) == 11
    starts = {"data:image/png;base64": b"\x89PNG", "data:image/svg+xml;base64": b"<?xml"}
    for attributes in pictures:
        kind, _, data = (attributes["src"] or "").partition(",")
        assert base64.b64decode(data).startswith(starts[kind])
        assert attributes["alt"]
    loading = {"src", "srcset", "data", "poster", "action", "background"}
    for tag, attributes in page.tags:
        assert tag not in {"script", "iframe", "object", "embed"}
        assert all((value or "").startswith("data:") for name, value in attributes.items() if name in loading)
        assert (attributes.get("href") or "#").startswith(("#", "data:"))
    assert "url(" not in source and "@import" not in source


def test_every_link_in_the_page_leads_somewhere(folder: Path) -> None:
    page = Page((folder / "report.html").read_text(encoding="utf-8"))
    places = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    links = {
        (attributes["href"] or "").removeprefix("#")
        for tag, attributes in page.tags
        if tag == "a" and "download" not in attributes
    }
    assert links and links <= places


def test_failures_are_shown_and_escaped(folder: Path) -> None:
    text = " ".join(Page((folder / "report.html").read_text(encoding="utf-8")).text)
    for page in (text, (folder / "report.md").read_text(encoding="utf-8")):
        assert "it <broke> & fell" in page
        assert "unavailable: no module" in page
        assert "pip install it" in page
        assert "raising 60 of 60" in page
        assert "Recorded by somebody, CC-BY 3.0" in page
        assert "hsslam compare office" in page


def test_the_markdown_names_pictures_that_exist_and_has_whole_tables(folder: Path) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    named = re.findall(r"!\[[^\]]*\]\(([^)]*)\)", text)
    assert len(named) == 11
    assert all((folder / name).is_file() for name in named)
    tables = [block.splitlines() for block in text.split("\n\n") if block.startswith(("| matcher", "| pair"))]
    assert len(tables) == 6
    for lines in tables:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1


def test_csv_says_what_the_json_says(folder: Path) -> None:
    (data,) = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))["comparisons"]
    by_label: dict[str, dict[str, Any]] = {matcher["label"]: matcher for matcher in data["matchers"]}

    def rows(name: str) -> list[dict[str, str]]:
        with (folder / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    summary = rows("trials.csv")
    assert [line["matcher"] for line in summary] == ["good", "bad", "gone", "raising"]
    assert summary[2]["status"] == "no module" and summary[2]["trials"] == ""
    for line in (summary[0], summary[1]):
        expected = by_label[line["matcher"]]["trials"]
        first = expected["successes"][0]
        assert float(line[f"{first['name']}_ratio"]) == first["ratio"]["value"]
        assert float(line[f"{first['name']}_ratio_low"]) == first["ratio"]["low"]
        assert (
            float(line[f"{first['name']}_displacement_median_m"])
            == first["displacement_m"]["median"]["value"]
        )
        assert float(line["all_rotation_mean_deg_high"]) == expected["rotation_all_deg"]["mean"]["high"]
        assert float(line["time_median_s"]) == expected["seconds"]["median"]["value"]
    raw = rows("trials_raw.csv")
    assert len(raw) == 3 * TRIALS
    for label in ("good", "bad", "raising"):
        found = [float(line["displacement_m"]) for line in raw if line["matcher"] == label]
        assert found == by_label[label]["trials"]["data"]["displacement_m"]
    assert {line["seconds"] for line in raw if line["matcher"] == "raising"} == {""}
    runs = {line["matcher"]: line for line in rows("slam.csv")}
    assert (
        float(runs["good"]["ate_translation_rmse_m"])
        == by_label["good"]["runs"][0]["accuracy"]["ate"]["translation_rmse_m"]
    )
    assert float(runs["good"]["real_time_factor"]) == 50.0
    assert runs["bad"]["status"] == "it <broke> & fell" and runs["bad"]["scans"] == ""


def test_the_table_shows_the_interval_of_the_summary(full: Comparison) -> None:
    good = full.matchers[0].trials
    assert good is not None
    ratio = good.successes[0].ratio
    cell = trial_tables(full)[0].rows[0].cells[2]
    assert cell.text == "100.0"
    assert cell.interval == f"{100 * ratio.low:.1f} to 100.0"


def test_relations_show_where_there_are_some(tmp_path: Path) -> None:
    found = comparison(MatcherOutcome("one", "one", {}, None, [slam("one", relations=True)]))
    write_report(found, tmp_path)
    text = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "0.0213 ± 0.0101" in text
    assert "ATE" not in text
    assert "odometry alone" in text
    assert not (tmp_path / "trials_raw.csv").exists()


def test_a_comparison_of_failures_only_has_a_page(tmp_path: Path) -> None:
    found = comparison(MatcherOutcome("gone", "gone", {}, failures=[Failure("unavailable", "no module")]))
    page = Page(write_report(found, tmp_path).read_text(encoding="utf-8"))
    assert "no module" in page.text
    assert not [tag for tag, _ in page.tags if tag == "img"]


def test_same_comparison_same_bytes(full: Comparison, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "runs").symlink_to(folder / "runs")
    write_report(full, tmp_path)
    assert (tmp_path / "report.html").read_bytes() == (folder / "report.html").read_bytes()


def seeded(label: str, errors: list[float]) -> MatcherOutcome:
    runs = []
    for seed, error in enumerate(errors):
        ate = {"translation_rmse_m": error, "rotation_rmse_deg": 0.1, "count": 50.0}
        runs.append(replace(slam(label), accuracy=Accuracy(ate=ate), seed=seed))
    return MatcherOutcome(label, label, {}, None, runs)


def marked(found: Comparison) -> list[str]:
    table = next(table for table in slam_tables(found) if table.name == "slam-accuracy")
    return [row.label for row in table.rows if any(cell.best for cell in row.cells)]


def test_slam_has_a_winner_only_over_enough_logs() -> None:
    rng = np.random.default_rng(2)
    good, bad = rng.uniform(0.01, 0.02, 8).tolist(), rng.uniform(0.03, 0.04, 8).tolist()
    found = comparison(seeded("bad", bad), seeded("good", good))
    assert marked(found) == ["good"]
    assert marked(comparison(seeded("bad", bad[:5]), seeded("good", good[:5]))) == []
    assert marked(comparison(seeded("one", good), seeded("same", good))) == []
    # Seeds of a recorded log are the same drive over and over.
    real = replace(found, dataset=replace(found.dataset, kind="real"))
    assert marked(real) == []


def test_a_winner_is_named_only_where_the_tests_say_so() -> None:
    rng = np.random.default_rng(1)
    alike = trials(rng, 1.0, 0.1)
    said = verdict(comparison(MatcherOutcome("a", "a", {}, alike), MatcherOutcome("b", "b", {}, alike)))
    assert said.count("No single best") == 4 and said.count("a and b are beaten by none.") == 4
    found = comparison(
        MatcherOutcome("a", "a", {}, trials(rng, 4.0, 0.6)),
        MatcherOutcome("b", "b", {}, trials(rng, 1.0, 0.0)),
    )
    better = verdict(found)
    assert better.startswith("b succeeds more often")
    assert "b has smaller displacement errors" in better
    success = next(table for table in trial_tables(found) if table.name == "success")
    assert [[cell.best for cell in row.cells].count(True) for row in success.rows] == [0, 1]
    assert verdict(comparison(MatcherOutcome("a", "a", {}, alike))) == ""


def test_who_never_answered_is_not_called_unbeaten() -> None:
    rng = np.random.default_rng(1)
    good, none = trials(rng, 1.0, 0.0), trials(rng, 1.0, 0.0, raising=True)
    lost = MatcherOutcome("lost", "lost", {}, failures=[Failure("trials", "it hangs")])
    said = verdict(
        comparison(MatcherOutcome("a", "a", {}, good), MatcherOutcome("mute", "mute", {}, none), lost)
    )
    assert "No single best in time: a is beaten by none." in said
    assert "mute never gave an answer." in said
    assert "Trials failed, see what is missing: lost." in said
    off = trials(rng, 1.0, 1.0)
    said = verdict(comparison(MatcherOutcome("a", "a", {}, good), MatcherOutcome("off", "off", {}, off)))
    assert "off never succeeded." in said


def test_who_never_answered_is_no_point_of_error_against_time() -> None:
    rng = np.random.default_rng(1)
    mute = trials(rng, 1.0, 0.0)
    mute = replace(mute, unanswered={"the answer is not finite": mute.count})
    found = comparison(
        MatcherOutcome("a", "a", {}, trials(rng, 1.0, 0.0)), MatcherOutcome("mute", "mute", {}, mute)
    )
    picture = next(p for p in trial_pictures(found, "x") if p.key == "x-pareto")
    assert "Not shown, because it never gave an answer: mute." in picture.caption
    assert b"mute" not in picture.files["svg"]


def test_few_trials_are_told_apart_from_equal_matchers() -> None:
    rng = np.random.default_rng(1)

    def few(made: MatcherTrials, count: int = 5) -> MatcherTrials:
        data = {name: values[:count] for name, values in vars(made.data).items()}
        return replace(made, count=count, data=replace(made.data, **data))

    found = comparison(
        MatcherOutcome("a", "a", {}, few(trials(rng, 4.0, 1.0))),
        MatcherOutcome("b", "b", {}, few(trials(rng, 1.0, 0.0))),
    )
    said = verdict(found)
    assert said.startswith("Too few trials to tell who is better: with 5 of them, none of the 4 differences")
    assert "beaten by none" not in said
    assert "a never succeeded." in said


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.0, "0"), (0.01234, "0.0123"), (1.0, "1.00"), (12.345, "12.3"), (1234.5, "1234"), (-0.5, "-0.500")],
)
def test_numbers_have_three_digits(value: float, shown: str) -> None:
    assert number(value) == shown


def test_nan_is_a_dash() -> None:
    assert not any(character.isalnum() for character in number(math.nan))
