"""The searches on benchmark functions: functions, tests, runs, tables and verdicts."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam_eval.reproduce import run_experiment
from hsslam_eval.reproduce.benchmark_functions import FUNCTIONS, BenchmarkFunction
from hsslam_eval.reproduce.benchmark_runs import QUICK, SOLVED, USUAL, BenchmarksResult, Size, measure
from hsslam_eval.reproduce.benchmarks import claims, present
from hsslam_eval.reproduce.contestants import CONTESTANTS, HIDE, Contestant
from hsslam_eval.reproduce.experiment import Experiment, Request, Value
from hsslam_eval.reproduce.files import write_experiment
from hsslam_eval.reproduce.signed_rank import LEVEL, compare_all, fewest_pairs, holm, signed_rank

Formula = Callable[[NDArray[np.float64]], float]

FORMULAS: dict[str, Formula] = {
    "sphere": lambda x: float(np.sum(x**2)),
    "rosenbrock": lambda x: float(np.sum(100.0 * (x[1:] - x[:-1] ** 2) ** 2 + (1.0 - x[:-1]) ** 2)),
    "rastrigin": lambda x: float(10.0 * len(x) + np.sum(x**2 - 10.0 * np.cos(2.0 * np.pi * x))),
    "ackley": lambda x: float(
        -20.0 * np.exp(-0.2 * np.sqrt(np.mean(x**2))) - np.exp(np.mean(np.cos(2.0 * np.pi * x))) + 20.0 + np.e
    ),
    "griewank": lambda x: float(
        np.sum(x**2) / 4000.0 - np.prod(np.cos(x / np.sqrt(np.arange(1, len(x) + 1)))) + 1.0
    ),
    "schwefel": lambda x: float(418.98288727243374 * len(x) - np.sum(x * np.sin(np.sqrt(np.abs(x))))),
}


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.name)
@pytest.mark.parametrize("dimension", [2, 5, 30])
def test_the_minimum_is_zero_where_it_is_said_to_be(function: BenchmarkFunction, dimension: int) -> None:
    place = np.full(dimension, function.minimiser)
    assert abs(function.at(place)) < 1e-10
    rng = np.random.default_rng(0)
    around = place + rng.normal(0.0, 1e-3 * function.half, (200, dimension))
    anywhere = rng.uniform(-function.half, function.half, (200, dimension))
    assert function.at_columns(np.concatenate((around, anywhere)).T).min() > 0.0


@given(
    shares=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=30),
    function=st.sampled_from(FUNCTIONS),
)
@settings(max_examples=100, deadline=None)
def test_functions_are_what_their_formulas_say(shares: list[float], function: BenchmarkFunction) -> None:
    x = function.half * np.array(shares)
    expected = FORMULAS[function.name](x)
    assert function.at(x) == pytest.approx(expected, rel=1e-9, abs=1e-8)
    np.testing.assert_array_equal(function.at_columns(np.column_stack((x, x))), function.at(x))


def test_the_box_holds_the_minimum_and_has_as_many_sides_as_variables() -> None:
    for function in FUNCTIONS:
        assert function.bounds(7) == [(-function.half, function.half)] * 7
        assert abs(function.minimiser) < function.half


@given(st.lists(st.floats(-100.0, 100.0), min_size=5, max_size=40))
@settings(max_examples=20, deadline=None)
def test_signed_rank_is_scipys_test_and_antisymmetric(differences: list[float]) -> None:
    found = np.array(differences)
    p, sign = signed_rank(found, np.zeros_like(found))
    mirrored, opposite = signed_rank(np.zeros_like(found), found)
    assert mirrored == pytest.approx(p)
    assert opposite == -sign
    if np.any(found):
        assert p == pytest.approx(scipy.stats.wilcoxon(found[found != 0.0]).pvalue)
    else:
        assert (p, sign) == (1.0, 0)


def test_holm_by_hand() -> None:
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    np.testing.assert_allclose(holm([0.9, 0.8]), [1.0, 1.0])


def test_a_comparison_says_which_is_lower_where_the_runs_can_tell() -> None:
    rng = np.random.default_rng(1)
    base = rng.random(30)
    less, same, more = compare_all(
        [(base, base + 1.0 + base), (base, base + rng.normal(0.0, 1.0, 30)), (base + 1.0, base)]
    )
    assert [less.verdict, same.verdict, more.verdict] == [-1, 0, 1]
    assert less.corrected >= less.p
    assert less.difference < 0.0 < more.difference


@pytest.mark.parametrize("tests", [1, 7, 168])
def test_fewest_pairs_is_where_the_clearest_result_first_counts(tests: int) -> None:
    def clearest(pairs: int) -> float:
        differences = np.arange(1.0, pairs + 1.0)
        return float(holm([signed_rank(differences, np.zeros(pairs))[0], *[1.0] * (tests - 1)])[0])

    needed = fewest_pairs(tests)
    assert clearest(needed) < LEVEL <= clearest(needed - 1)


@pytest.mark.parametrize("contestant", CONTESTANTS, ids=lambda c: c.label)
def test_every_search_spends_the_same_budget_and_repeats_itself(contestant: Contestant) -> None:
    function = FUNCTIONS[2]
    first, again, other = (contestant.history(function, 3, 500, seed) for seed in ((4, 0), (4, 0), (4, 1)))
    assert first.shape == (500,)
    assert (np.diff(first) <= 0.0).all()
    assert first[-1] < first[0]
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_searches_with_equal_populations_begin_from_the_same_points() -> None:
    begun = {c.label: c.history(FUNCTIONS[0], 4, 60, (0, 5))[:30] for c in CONTESTANTS}
    for label in ("HS", "IHS", "DE (eq. 11)", "DE/rand-to-best/1"):
        np.testing.assert_allclose(begun[label], begun[HIDE])


def test_scipys_search_keeps_its_answer_where_it_ends_early() -> None:
    flat = replace(FUNCTIONS[0], half=1e-200)
    history = CONTESTANTS[-1].history(flat, 2, 3000, (0, 0))
    assert history.shape == (3000,)
    assert np.isfinite(history).all()


@pytest.fixture(scope="module")
def result() -> BenchmarksResult:
    return measure(Size((2, 5), 12, 120), seed=2)


@pytest.fixture(scope="module")
def experiment(result: BenchmarksResult) -> Experiment:
    return present(result)


def test_what_the_issue_asks_for_is_the_usual_size() -> None:
    assert min(USUAL.dimensions) == 2
    assert max(USUAL.dimensions) == 30
    assert USUAL.runs >= 30
    assert [f.name for f in FUNCTIONS] == list(FORMULAS)


def test_errors_are_never_negative_and_fall(result: BenchmarksResult) -> None:
    assert len(result.problems) == 12
    for problem in result.problems:
        final, early = result.finals[problem], result.early[problem]
        assert final.shape == (len(CONTESTANTS), 12)
        assert (final >= 0.0).all()
        assert (final <= early).all()
        assert not ((final > 0.0) & (final < SOLVED)).any()
        np.testing.assert_allclose(result.quartiles[problem][1, :, -1], np.median(final, axis=1))
        assert result.ranks[problem].sum() == pytest.approx(8 * 9 / 2)


def test_easy_findings_come_out(result: BenchmarksResult) -> None:
    sphere = next(p for p in result.problems if p.title == "Sphere, 5")
    median = dict(zip(result.labels, np.median(result.finals[sphere], axis=1), strict=True))
    assert median[HIDE] < median["HS"]
    assert median["DE/rand-to-best/1"] < median["DE (eq. 11)"]


def test_claims_are_turned_round_where_the_errors_are(result: BenchmarksResult) -> None:
    place = result.labels.index(HIDE)
    best = {p: np.where(np.arange(8)[:, None] == place, 1e-3, e + 1.0) for p, e in result.finals.items()}
    worst = {p: np.where(np.arange(8)[:, None] == place, 1e9, e + 1.0) for p, e in result.finals.items()}
    for errors, verdict in ((best, "holds"), (worst, "does not hold")):
        judged = claims(replace(result, finals=errors, early=errors))
        # Eight problems have many local minima, and the test wants nine of them.
        few = [claim for claim in judged if "many local minima" in claim.statement]
        assert {claim.verdict for claim in few} == {"cannot be compared"}
        assert {claim.verdict for claim in judged if claim not in few} == {verdict}
    assert sum(claim.added for claim in judged) == 3
    assert "worse on 12 (Sphere in 2 and 5; Rosenbrock in 2 and 5;" in judged[0].why


def test_tables_hold_every_problem_and_search(experiment: Experiment, result: BenchmarksResult) -> None:
    final, tenth, ranks, errors, tests = experiment.tables
    for table in (final, tenth):
        assert [row.label for row in table.rows] == [c.label for c in result.others]
        for row in table.rows:
            assert sum(int(cell) for cell in row.cells[:3] if isinstance(cell, str)) == 12
    assert [row.label for row in ranks.rows] == result.labels
    assert [row.label for row in errors.rows] == [row.label for row in tests.rows]
    cell = errors.rows[0].cells[0]
    assert isinstance(cell, Value)
    assert cell.value == np.median(result.finals[result.problems[0]][0])
    assert tests.headings == tuple(c.label for c in result.others)


def test_too_few_runs_are_said(experiment: Experiment, result: BenchmarksResult) -> None:
    assert "unless there are 12 runs" not in experiment.notes[0]
    few = present(replace(result, size=replace(result.size, runs=5)))
    assert "Too few runs" in few.notes[0]


def test_the_folder_is_complete(experiment: Experiment, tmp_path: Path) -> None:
    folder = write_experiment(experiment, tmp_path)
    for name in ("figure.png", "figure.svg", "convergence-5.png", "table.csv", "table.md"):
        assert (folder / name).stat().st_size > 500
    found = json.loads((folder / "result.json").read_text("utf-8"))
    assert found["seeds"] == [2]
    assert found["config"]["GA, real-valued"]["encoding"] == "real"
    assert found["config"]["functions"]["schwefel"]["half_range"] == 500.0
    assert len(found["series"]["final errors"]["Ackley, 5"][0]) == 12


def test_the_seed_decides() -> None:
    first, again, other = (
        measure(Size((3,), 2, 100), seed, functions=FUNCTIONS[:2]).finals for seed in (0, 0, 1)
    )
    for problem, errors in first.items():
        np.testing.assert_array_equal(errors, again[problem])
        assert not np.array_equal(errors, other[problem])


def test_trials_are_runs() -> None:
    told = []
    found = run_experiment("benchmarks", Request(quick=True, trials=1), lambda *step: told.append(step))
    assert found.counts["runs per search and problem"] == 1
    total = len(QUICK.dimensions) * len(FUNCTIONS) * len(CONTESTANTS)
    assert told[-1] == ("searches on benchmark functions", total, total)
