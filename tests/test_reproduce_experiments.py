"""The paper's experiments, with as few trials as show that they work."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from hsslam.errors import ConfigError, DataError
from hsslam_eval.reproduce import NAMES, run_experiment
from hsslam_eval.reproduce.data import add_noise, pair_sets
from hsslam_eval.reproduce.experiment import Experiment, Request, Row, Table, Value
from hsslam_eval.reproduce.files import csv_text, markdown_table, new_folder, write_experiment
from hsslam_eval.reproduce.judge import compare, no_worse, paired, tally
from hsslam_eval.reproduce.methods import oracle, published
from hsslam_eval.reproduce.page import write_page
from hsslam_eval.reproduce.table1 import PAPER as TABLE_1
from hsslam_eval.reproduce.table2 import PAPER as TABLE_2
from hsslam_eval.reproduce.traces import trace_trials
from hsslam_eval.statistics import Interval
from hsslam_eval.trial_config import TrialConfig
from hsslam_eval.trials import run_trials

SMALL = Request(trials=8)


def quiet(what: str, done: int, total: int) -> None:
    assert what
    assert 0 <= done <= max(done, total)


@pytest.fixture(scope="module")
def table2() -> Experiment:
    return run_experiment("table2", SMALL, quiet)


def test_the_papers_tables_hold_the_papers_figures() -> None:
    assert (TABLE_1["GLASM", 0.30].success, TABLE_1["GLASM", 0.30].displacement) == (0.81, 2.27)
    assert TABLE_1["HSL", 0.20] == TABLE_2["HSL", 0.20]
    assert (TABLE_2["HIDE", 0.20].milliseconds, TABLE_2["HIDE", 0.30].milliseconds) == (141.0, 223.0)


def test_the_published_configurations_spend_what_was_published() -> None:
    pairs = pair_sets(SMALL, 4)[0].pairs
    config = TrialConfig(count=4)
    spent = {
        name: set(run_trials(name, published(name).matcher, pairs, config).evaluations.tolist())
        for name in ("hsl", "hide", "glasm")
    }
    assert spent == {"hsl": {30 + 250}, "hide": {30 + 220}, "glasm": {120 * 12}}


@pytest.mark.parametrize("name", ["hsl", "hide", "glasm"])
def test_published_methods_share_one_fitness_and_do_not_refine(name: str) -> None:
    described = published(name).described()
    assert (described["fitness"], described["half_side"], described["refine"]) == ("paper", 0.0525, False)


def test_table2_has_the_papers_figures_beside_ours(table2: Experiment) -> None:
    rows = {row.label: row for row in table2.tables[0].rows}
    cell = rows["L = 20 cm: HIDE"].cells[0]
    assert isinstance(cell, Value)
    assert cell.paper == pytest.approx(96.0)
    assert 0.0 <= cell.low <= cell.value <= cell.high <= 100.0
    ours = rows["L = 30 cm: hide, hsslam's defaults"].cells[0]
    assert isinstance(ours, Value)
    assert math.isnan(ours.paper)


def test_every_experiment_says_what_holds(table2: Experiment) -> None:
    assert len(table2.claims) == 12
    assert {claim.verdict for claim in table2.claims} <= {"holds", "does not hold", "cannot be compared"}
    assert all(claim.why for claim in table2.claims)
    assert table2.seeds == (0,)
    assert table2.counts == {"trials per method and window": 8}


def test_the_same_seed_gives_the_same_result(table2: Experiment) -> None:
    again = run_experiment("table2", SMALL, quiet)
    other = run_experiment("table2", Request(trials=8, seed=1), quiet)

    def errors(experiment: Experiment) -> list[float]:
        cells = [row.cells[5] for row in experiment.tables[0].rows]
        return [cell.value for cell in cells if isinstance(cell, Value)]

    assert errors(again) == errors(table2)
    assert errors(other) != errors(table2)


@pytest.mark.parametrize("name", ["table1", "fig7", "fig8", "fig9", "fig10"])
def test_an_experiment_writes_its_folder(name: str, tmp_path: Path) -> None:
    experiment = run_experiment(name, Request(trials=5), quiet)
    folder = write_experiment(experiment, tmp_path)
    assert folder == tmp_path / name
    for drawing in ("figure.png", "figure.svg"):
        assert (folder / drawing).stat().st_size > 5_000
    result = json.loads((folder / "result.json").read_text("utf-8"))
    assert result["name"] == name
    assert result["claims"]
    assert result["config"]
    assert result["seeds"] == [0]
    rows = list(csv.DictReader((folder / "table.csv").read_text("utf-8").splitlines()))
    assert len(rows) == sum(len(row.cells) for table in experiment.tables for row in table.rows)
    assert (folder / "table.md").read_text("utf-8").count("| :-- |") == len(experiment.tables)
    assert not list(folder.glob(".part-*"))


def test_regret_is_measured_where_there_is_an_oracle() -> None:
    found = run_experiment("table1", Request(trials=3), quiet).tables[0]
    assert ("regret (%)" in found.headings) == (oracle() is not None)


def test_the_best_that_the_fitness_has_to_offer_stands_below_the_methods(table2: Experiment) -> None:
    best = oracle()
    assert best is not None
    for table in table2.tables:
        rows = {row.label: dict(zip(table.headings, row.cells, strict=True)) for row in table.rows}
        for side in (20, 30):
            regret = {label: rows[f"L = {side} cm: {label}"]["regret (%)"] for label in (best.label, "HIDE")}
            assert all(isinstance(cell, Value) for cell in regret.values())
            assert regret[best.label].value == 0.0 <= regret["HIDE"].value  # type: ignore[union-attr]


def test_maps_beat_odometry(tmp_path: Path) -> None:
    experiment = run_experiment("maps", Request(quick=True), quiet)
    rows = {row.label: row.cells[0] for row in experiment.tables[0].rows}
    assert list(rows) == ["odometry", "HSL", "HIDE", "hide, full SLAM"]
    full, odometry = rows["hide, full SLAM"], rows["odometry"]
    assert isinstance(full, Value)
    assert isinstance(odometry, Value)
    assert full.value < odometry.value
    assert write_experiment(experiment, tmp_path).joinpath("figure.png").is_file()


def test_a_trace_ends_where_the_trial_ends() -> None:
    pairs = pair_sets(SMALL, 6)[0].pairs
    config = TrialConfig(count=6)
    for name, evaluations in (("hsl", 280), ("hide", 250)):
        method = published(name)
        traces = trace_trials(method, pairs, config, evaluations, quiet)
        assert traces.displacement.shape == (6, evaluations)
        assert (np.diff(traces.fitness, axis=1) >= 0.0).all()
        assert traces.fitness.min() >= 0.0
        assert traces.fitness.max() <= 1.0
        final = run_trials(name, method.matcher, pairs, config).displacement
        np.testing.assert_allclose(traces.displacement[:, -1], final, atol=1e-9)


def test_simulated_pairs_are_of_two_places_and_of_one() -> None:
    near, still = pair_sets(SMALL, 8)
    assert (near.key, still.key) == ("simulated", "simulated-still")
    assert max(np.hypot(*pair.truth[:2]) for pair in near.pairs) > 0.1
    assert max(np.abs(pair.truth).max() for pair in still.pairs) < 1e-6
    assert not np.array_equal(still.pairs[0].reference_points, still.pairs[0].scan_points)


def test_noise_moves_points_along_their_beams() -> None:
    points = np.array([[3.0, 4.0], [0.0, 2.0], [-1.0, 0.0]])
    moved = add_noise(points, 0.05, np.random.default_rng(0))
    cross = points[:, 0] * moved[:, 1] - points[:, 1] * moved[:, 0]
    np.testing.assert_allclose(cross, 0.0, atol=1e-12)
    assert (np.hypot(*(moved - points).T) > 0.0).all()
    np.testing.assert_array_equal(add_noise(points, 0.0, np.random.default_rng(0)), points)


def test_real_logs_give_relations_and_static_pairs(shared_data: Path) -> None:
    request = Request(dataset="mit-csail", data_dir=shared_data)
    sets = pair_sets(request, 5)
    assert [each.key for each in sets] == ["relations", "static"]
    assert [len(each.pairs) for each in sets] == [5, 5]
    assert all(not pair.truth.any() for pair in sets[1].pairs)


NAMES_OF = {"this": "A", "other": "B", "what": "error", "unit": "cm"}


@pytest.mark.parametrize(
    ("difference", "verdict"),
    [
        (Interval(-1.0, -2.0, -0.5), "holds"),
        (Interval(-1.0, -2.0, 0.5), "does not hold"),
        (Interval(1.0, 0.5, 2.0), "does not hold"),
        (Interval(math.nan, math.nan, math.nan), "cannot be compared"),
    ],
)
def test_a_claim_holds_where_the_whole_interval_does(difference: Interval, verdict: str) -> None:
    claim = compare("A is better.", difference, "smaller", **NAMES_OF)
    assert claim.verdict == verdict
    if verdict != "cannot be compared":
        mirrored = Interval(-difference.value, -difference.high, -difference.low)
        assert compare("A is better.", mirrored, "larger", **NAMES_OF).verdict == verdict


@pytest.mark.parametrize(
    ("excess", "verdict"),
    [
        (Interval(0.2, -0.1, 0.5), "holds"),
        (Interval(0.9, 0.5, 1.4), "cannot be compared"),
        (Interval(2.0, 1.5, 2.5), "does not hold"),
    ],
)
def test_as_good_as_is_judged_by_a_margin(excess: Interval, verdict: str) -> None:
    assert no_worse("A is as good.", excess, 1.0, **NAMES_OF).verdict == verdict


def test_pairing_removes_what_the_trials_share() -> None:
    shared = np.random.default_rng(0).normal(0.0, 100.0, 200)
    found = paired(shared + 1.0, shared)
    assert found.low == pytest.approx(1.0)
    assert found.high == pytest.approx(1.0)


def test_the_tally_counts() -> None:
    good = compare("A is better.", Interval(-1.0, -2.0, -0.5), "smaller", **NAMES_OF)
    open_ = compare("A is better.", Interval(math.nan, math.nan, math.nan), "smaller", **NAMES_OF)
    assert tally([good, open_]) == "1 of 2 claims of the paper hold on these data; 1 cannot be compared."
    counted = tally([good, replace(good, added=True)])
    assert counted == "1 of 1 claims of the paper hold on these data. Of 1 comparisons that we added, 1 hold."
    assert "nothing" in tally([])


def test_tables_as_text() -> None:
    table = Table("A|B", "Why.", ("error (cm)", "note"), (Row("x|y", (Value(1.234, 1.0, 1.5, 2.0), "none")),))
    text = markdown_table(table)
    assert r"| x\|y | 1.23 (1.00 to 1.50; paper 2.00) | none |" in text
    experiment = Experiment("t", "T", "S", (), (table,), (), "d", (0,), {}, {})
    found = list(csv.DictReader(StringIO(csv_text(experiment))))
    assert [(row["column"], row["value"], row["paper"], row["text"]) for row in found] == [
        ("error (cm)", "1.234", "2", ""),
        ("note", "", "", "none"),
    ]


def test_a_row_must_fit_its_table() -> None:
    with pytest.raises(ValueError, match="1 cells, not 2"):
        Table("t", "", ("a", "b"), (Row("r", ("x",)),))


def test_an_earlier_run_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "fig7").mkdir()
    with pytest.raises(DataError, match="holds fig7"):
        new_folder(tmp_path, ("fig7",))
    assert new_folder(tmp_path, ("fig8",)) == tmp_path


def test_an_unknown_experiment_names_the_known() -> None:
    with pytest.raises(ConfigError, match="table1, table2, fig7"):
        run_experiment("table3", SMALL, quiet)
    assert NAMES[-2:] == ("maps", "benchmarks")


def test_the_page_is_self_contained_and_says_the_verdicts(table2: Experiment, tmp_path: Path) -> None:
    page = write_page([table2], tmp_path, command="hsslam reproduce table2").read_text("utf-8")
    assert "paper 96.0" in page
    assert page.count("data:image/png;base64,") == 2
    assert "http" not in page.replace("http-equiv", "")
    assert tally(table2.claims) in page
    markdown = (tmp_path / "report.md").read_text("utf-8")
    for claim in table2.claims:
        assert claim.statement in markdown
    assert "hsslam reproduce table2" in markdown
