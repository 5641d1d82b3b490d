"""Figure 10: displacement error over fitness evaluations, HSL and HIDE."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam_eval.reproduce import drawing, methods
from hsslam_eval.reproduce.data import PairSet, pair_sets, trial_config
from hsslam_eval.reproduce.experiment import Claim, Drawing, Experiment, Request, Row, Table, Tell, Value
from hsslam_eval.reproduce.findings import Findings
from hsslam_eval.reproduce.judge import compare, paired
from hsslam_eval.reproduce.traces import trace_trials
from hsslam_eval.statistics import bootstrap_interval
from hsslam_eval.trials import run_trials

BUDGET = 250
"""Evaluations of either method after its memory is filled."""

PLACES = (30, 60, 100, 150, 200, 280)
"""Evaluations, the filling of the memory included, that the table shows."""

Errors = dict[str, NDArray[np.float64]]
"""Displacement error (T, E) in m, by method."""


def run(request: Request, tell: Tell) -> Experiment:
    """Redo Figure 10; see `hsslam_eval.reproduce`."""
    count = request.count(1000, 60)
    contestants = [
        methods.published("hsl", improvisations=BUDGET),
        methods.published("hide", evaluations=BUDGET),
    ]
    shipped = methods.ours("hide")
    found = Findings(request)
    for pairs in pair_sets(request, count):
        config = trial_config(request, count)
        total = methods.MEMORY_SIZE + BUDGET
        errors = {
            method.label: trace_trials(method, pairs.pairs, config, total, tell).displacement
            for method in contestants
        }
        final = run_trials(
            shipped.label,
            shipped.matcher,
            pairs.pairs,
            config,
            lambda done, of: tell(shipped.label, done, of),
        )
        answer = Value.of(bootstrap_interval(final.displacement, seed=request.seed), 100.0)
        found.tables.append(_table(errors, answer, pairs, request.seed))
        found.drawings.append(_draw(errors, answer.value, pairs))
        found.claims += [_ahead(errors, place, pairs.key) for place in PLACES[1:]]
        found.series[pairs.key] = {
            label: np.round(100.0 * error.mean(axis=0), 4).tolist() for label, error in errors.items()
        }
    return found.experiment(
        "fig10",
        "Figure 10: convergence of HSL and HIDE",
        summary="Displacement error of the best pose so far over fitness evaluations, both methods as published but "
        f"with the same budget ({BUDGET} evaluations after the {methods.MEMORY_SIZE} that fill the memory), from the "
        "same guesses, L = 30 cm; mean over all trials, failures included.",
        counts={"trials per method": count, "evaluations per trial": methods.MEMORY_SIZE + BUDGET},
        config={each.label: each.described() for each in (*contestants, shipped)},
        notes=(
            "The paper draws one population; a single run says little of a random search, so ours is the mean of "
            "many.",
        ),
    )


def _table(errors: Errors, answer: Value, pairs: PairSet, seed: int) -> Table:
    rows = [
        Row(
            label,
            tuple(Value.of(bootstrap_interval(error[:, n - 1], seed=seed), 100.0) for n in PLACES),
        )
        for label, error in errors.items()
    ]
    rows.append(Row("hide, hsslam's defaults, answer", (*([""] * (len(PLACES) - 1)), answer)))
    return Table(
        f"Mean displacement error over evaluations: {pairs.label}",
        f"{len(pairs.pairs)} trials, L = 30 cm, all trials; 95% bootstrap intervals. The last row is an "
        "answer as shipped, refined.",
        tuple(f"after {n} evaluations (cm)" for n in PLACES),
        tuple(rows),
    )


def _draw(errors: Errors, answer: float, pairs: PairSet) -> Drawing:
    figure, (axes,) = drawing.panels(width=6.4, height=4.6)
    lines = {label: 100.0 * error.mean(axis=0) for label, error in errors.items()}
    drawing.curves(axes, np.arange(1, len(next(iter(lines.values()))) + 1), lines)
    axes.axhline(
        answer,
        color=drawing.GREY,
        linestyle=(0, (6, 3)),
        linewidth=1.2,
        label="hide, hsslam's defaults: answer",
    )
    axes.axvline(methods.MEMORY_SIZE, color=drawing.GREY, linewidth=1.0, linestyle=":", label="memory filled")
    axes.set_xlabel("fitness evaluations")
    axes.set_ylabel("mean displacement error (cm)")
    axes.set_ylim(bottom=0.0)
    drawing.legend_below(figure, axes, columns=2)
    return Drawing(
        f"figure-{pairs.key}",
        f"{pairs.label}: mean displacement error of the best pose so far over fitness evaluations.",
        figure,
    )


def _ahead(errors: Errors, place: int, key: str) -> Claim:
    return compare(
        f"{key}: HIDE converges faster: after {place} evaluations its error is smaller.",
        paired(errors["HIDE"][:, place - 1], errors["HSL"][:, place - 1]),
        "smaller",
        this="HIDE",
        other="HSL",
        what=f"mean displacement error after {place} evaluations",
        unit="cm",
        scale=100.0,
    )
