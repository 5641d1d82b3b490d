"""The searches on benchmark functions: the paper says that it did this, and prints none of it (abstract, section 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hsslam_eval.reproduce.benchmark_figure import draw
from hsslam_eval.reproduce.benchmark_runs import (
    EARLY,
    QUICK,
    SOLVED,
    USUAL,
    BenchmarksResult,
    Problem,
    measure,
)
from hsslam_eval.reproduce.contestants import HIDE, SCIPY_MEMBERS
from hsslam_eval.reproduce.experiment import Claim, Experiment, Request, Row, Table, Tell, Value
from hsslam_eval.reproduce.signed_rank import LEVEL, Comparison, fewest_pairs

_WHOLE = "after the whole budget"
_TENTH = f"after {EARLY:.0%} of the budget"
_SHOWN_FIRST = 10
"""Variables in the figure that comes first."""


def run(request: Request, tell: Tell) -> Experiment:
    """Run the searches against each other; see `hsslam_eval.reproduce`."""
    size = QUICK if request.quick else USUAL
    return present(measure(replace(size, runs=request.count(size.runs, size.runs)), request.seed, tell))


def present(result: BenchmarksResult) -> Experiment:
    """Tables, figures and verdicts of what was measured."""
    size = result.size
    functions = list(dict.fromkeys(problem.function for problem in result.problems))
    return Experiment(
        name="benchmarks",
        title="Benchmark functions: the searches on their own",
        summary=f"{len(result.labels)} searches on {len(functions)} functions in {_listed(size.dimensions)} variables, "
        f"{size.runs} runs of each, {size.evaluations_per_dimension} evaluations per variable for every search, the "
        "first population included. The paper says that it evaluated HIDE on benchmark functions and prints neither "
        "functions nor figures, so there is nothing to lay beside ours; the claims are what its text says of the "
        "searches.",
        claims=claims(result),
        tables=(
            _comparison_table(result, early=False),
            _comparison_table(result, early=True),
            _rank_table(result),
            _median_table(result),
            _test_table(result),
        ),
        drawings=tuple(
            draw(result, n) for n in sorted(size.dimensions, key=lambda n: (n != _SHOWN_FIRST, n))
        ),
        data="functions; nothing is read or simulated",
        seeds=(result.seed,),
        counts={
            "runs per search and problem": size.runs,
            "problems": len(result.problems),
            "evaluations per variable": size.evaluations_per_dimension,
        },
        config={
            **{contestant.label: contestant.described() for contestant in result.contestants},
            "functions": {
                f.name: {"half_range": f.half, "minimiser": f.minimiser, "source": f.source}
                for f in functions
            },
        },
        notes=_notes(result),
        series={
            "shares of the budget": np.round(result.shares, 6).tolist(),
            "searches": result.labels,
            "final errors": {p.title: found.tolist() for p, found in result.finals.items()},
            "quartiles": {
                p.title: [[[float(f"{v:.4g}") for v in line] for line in lines] for lines in found]
                for p, found in result.quartiles.items()
            },
        },
    )


def claims(result: BenchmarksResult) -> tuple[Claim, ...]:
    """What the paper says of HIDE beside the searches it is made from, each judged; then what we added."""
    final, early = result.overall(), result.overall(early=True)
    each, each_early = result.against(), result.against(early=True)

    enough = fewest_pairs(len(result.others))

    def better(label: str, added: bool = False) -> Claim:
        statement = f"HIDE finds better minima than {label}."
        return _claim(statement, final[label], each[label], label, _WHOLE, enough, added)

    found = [better(other.label) for other in result.others if not other.added]
    evolutions = [other.label for other in result.others if (other.method or "").startswith("de")]
    escapes = result.overall(many_minima=True)
    for label in evolutions:
        some = {p: c for p, c in each[label].items() if p.function.local_minima}
        statement = f"Where there are many local minima, HIDE gets stuck less than {label}: it ends lower."
        found.append(_claim(statement, escapes[label], some, label, _WHOLE, enough))
    harmonies = [other.label for other in result.others if other.method in ("harmony", "ihs")]
    found += [
        _claim(f"HIDE converges faster than {label}.", early[label], each_early[label], label, _TENTH, enough)
        for label in harmonies
    ]
    found += [better(other.label, added=True) for other in result.others if other.added]
    return tuple(found)


def _claim(
    statement: str,
    overall: Comparison,
    each: dict[Problem, Comparison],
    label: str,
    when: str,
    enough: int,
    added: bool = False,
) -> Claim:
    better, same, worse = _counts(each)
    where = "; ".join(f"{title} in {_listed(found)}" for title, found in _worse_in(each).items())
    why = (
        f"{when[:1].upper()}{when[1:]} HIDE is better on {better} of {len(each)} problems, worse on {worse}"
        f"{f' ({where} variables)' if where else ''}, and on {same} the runs cannot tell. Over these problems the "
        f"median error of HIDE is {10.0**overall.difference:.2g} times that of {label} at the median (signed-rank test "
        f"over problems: p = {overall.corrected:.2g})."
    )
    if len(each) < enough:
        return Claim(statement, "cannot be compared", f"{why} The test needs {enough} problems.", added)
    return Claim(statement, "holds" if overall.verdict < 0 else "does not hold", why, added)


def _counts(each: dict[Problem, Comparison]) -> tuple[int, int, int]:
    """Problems on which HIDE is better, not to be told apart, worse."""
    better, same, worse = (sum(c.verdict == verdict for c in each.values()) for verdict in (-1, 0, 1))
    return better, same, worse


def _worse_in(each: dict[Problem, Comparison]) -> dict[str, list[int]]:
    """Numbers of variables, by function, in which the tests say that HIDE is worse."""
    found: dict[str, list[int]] = {}
    for problem, comparison in each.items():
        if comparison.verdict > 0:
            found.setdefault(problem.function.title, []).append(problem.dimension)
    return found


def _listed(numbers: Sequence[int]) -> str:
    texts = [str(n) for n in numbers]
    return " and ".join(filter(None, (", ".join(texts[:-1]), texts[-1])))


def _notes(result: BenchmarksResult) -> tuple[str, ...]:
    tests = len(result.problems) * len(result.others)
    needed = fewest_pairs(tests)
    few = (
        f"Too few runs: with {tests} tests none can reach a corrected p under {LEVEL} unless there are {needed} runs.",
    )
    return (
        *(few if result.size.runs < needed else ()),
        "All parameters are as published, tuned by their authors for three variables and 220 to 1440 evaluations, "
        "and not tuned anew for any function. scipy's differential evolution has its own defaults "
        f"({SCIPY_MEMBERS} members per variable), polishing off; the budget is small for so many members.",
        "BW_min, 0.0067 of a range, bounds how finely HS and IHS can adjust in the end; HIDE's differential steps "
        "have no such bound.",
        "Fixed PAR and BW of HS are the middle of the schedules of IHS: the paper tunes the latter only. The schedules "
        f"follow the share of the budget spent, so {_TENTH} IHS and HIDE are still set to explore.",
        "Sphere, Rastrigin and Schwefel are sums over the variables, and Ackley and Griewank nearly so, which suits "
        "harmony search, since it takes every variable from another harmony; Rosenbrock's variables hang together.",
        "Sphere, Rastrigin, Ackley and Griewank have their minimum at the origin, which is where equation 11 would "
        "pull every member, were its L not 1.",
        "The tests over problems treat numbers of variables of one function as independent, which they are not quite.",
    )


def _comparison_table(result: BenchmarksResult, early: bool) -> Table:
    overall, each = result.overall(early), result.against(early)
    rows = []
    for label in (other.label for other in result.others):
        counts = (str(count) for count in _counts(each[label]))
        figures = (Value(10.0 ** overall[label].difference), Value(overall[label].corrected))
        rows.append(Row(label, (*counts, *figures)))
    return Table(
        f"HIDE against each, {_TENTH if early else _WHOLE}",
        f"Problems ({len(result.problems)}) on which HIDE's error is better, not to be told apart, or worse: "
        f"Wilcoxon's signed-rank test over {result.size.runs} runs paired by seed, two-sided, p < {LEVEL} after Holm's "
        f"correction over all {len(result.problems) * len(result.others)} tests. Last columns: median over the "
        f"problems of HIDE's median error over the other's (at least {SOLVED:g} each), and the same test over the "
        "problems, corrected likewise.",
        ("HIDE better", "no difference", "HIDE worse", "ratio of errors", "p over problems"),
        tuple(rows),
        corner=f"{HIDE} against",
    )


def _rank_table(result: BenchmarksResult) -> Table:
    rows = []
    for m, label in enumerate(result.labels):
        by_dimension = [
            np.mean([rank[m] for p, rank in result.ranks.items() if p.dimension == n])
            for n in result.size.dimensions
        ]
        overall = np.mean([rank[m] for rank in result.ranks.values()])
        rows.append(Row(label, tuple(Value(float(v)) for v in (*by_dimension, overall))))
    return Table(
        "Mean ranks",
        f"By final error among the {len(result.labels)} searches, over functions and runs; 1 is best, equals share.",
        (*(f"{n} variables" for n in result.size.dimensions), "all"),
        tuple(rows),
    )


def _median_table(result: BenchmarksResult) -> Table:
    rows = [
        Row(problem.title, tuple(Value(float(m)) for m in np.median(found, axis=1)))
        for problem, found in result.finals.items()
    ]
    return Table(
        "Final errors",
        f"Value found less the minimum's, median of {result.size.runs} runs; 0 where under {SOLVED:g}. A row is a "
        "function and its number of variables. Every run's error, and the quartiles, are in result.json.",
        tuple(result.labels),
        tuple(rows),
        corner="function",
    )


def _test_table(result: BenchmarksResult) -> Table:
    each = result.against()
    labels = [other.label for other in result.others]
    rows = [
        Row(problem.title, tuple(_verdict(each[label][problem]) for label in labels))
        for problem in result.problems
    ]
    return Table(
        "HIDE against each, problem by problem",
        f"Whether HIDE's final error is better or worse than the column's (= where the runs cannot tell), and p of the "
        f"signed-rank test over {result.size.runs} runs after Holm's correction.",
        tuple(labels),
        tuple(rows),
        corner="function",
    )


def _verdict(comparison: Comparison) -> str:
    word = {-1: "better", 0: "=", 1: "worse"}[comparison.verdict]
    return f"{word} ({comparison.corrected:.1g})"
