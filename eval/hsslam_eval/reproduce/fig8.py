"""Figure 8: what the size of the harmony memory (HMS) does."""

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

SIZES = (5, 10, 20, 30, 50, 100)
PUBLISHED_SIZE = 30
SHORT, LONG = 280, 2000
"""Evaluations in all, the filling of the memory included; 280 is what HSL spends as published."""

EARLY = 100

Fitness = dict[tuple[int, int], NDArray[np.float64]]
"""Best fitness (T, E), by evaluations in all and size."""


def run(request: Request, tell: Tell) -> Experiment:
    """Redo Figure 8; see `hsslam_eval.reproduce`."""
    count = request.count(500, 40)
    found = Findings(request)
    for pairs in pair_sets(request, count):
        config = trial_config(request, count)
        fitness: Fitness = {}
        for total in (SHORT, LONG):
            for size in SIZES:
                label = f"HMS {size}, {total} evaluations, {pairs.key}"
                method = methods.published("hsl", label, memory_size=size, improvisations=total - size)
                fitness[total, size] = trace_trials(method, pairs.pairs, config, total, tell).fitness
        found.tables.append(_table(fitness, pairs, request.seed))
        found.drawings.append(_draw(fitness, pairs))
        found.claims += _claims(fitness, pairs.key)
        found.series[pairs.key] = {
            f"HMS {size}, {total} evaluations": np.round(100.0 * f.mean(axis=0), 4).tolist()
            for (total, size), f in fitness.items()
        }
    return found.experiment(
        "fig8",
        "Figure 8: size of the harmony memory (HMS)",
        summary="HSL as published but for HMS: best fitness (share of the scan's points that hit a square) over "
        f"fitness evaluations, L = 30 cm. Runs of {SHORT} evaluations, which is what the published settings spend, "
        f"and of {LONG}; the evaluations that fill the memory count, so a larger memory leaves fewer improvisations.",
        counts={"trials per setting": count},
        config={"sizes": list(SIZES), "evaluations": [SHORT, LONG], **methods.published("hsl").described()},
        notes=("The paper prints no figures beside the plot; only what its text says can be judged.",),
    )


def _columns(fitness: Fitness, size: int) -> tuple[NDArray[np.float64], ...]:
    return (
        fitness[SHORT, size][:, EARLY - 1],
        fitness[SHORT, size][:, -1],
        fitness[LONG, size][:, -1],
    )


def _table(fitness: Fitness, pairs: PairSet, seed: int) -> Table:
    rows = tuple(
        Row(
            f"HMS {size}{' (published)' if size == PUBLISHED_SIZE else ''}",
            tuple(
                Value.of(bootstrap_interval(column, seed=seed), 100.0) for column in _columns(fitness, size)
            ),
        )
        for size in SIZES
    )
    return Table(
        f"Best fitness by HMS: {pairs.label}",
        f"{len(pairs.pairs)} trials each, L = 30 cm; mean with 95% bootstrap intervals.",
        (
            f"fitness after {EARLY} of {SHORT} evaluations (%)",
            f"fitness after {SHORT} of {SHORT} (%)",
            f"fitness after {LONG} of {LONG} (%)",
        ),
        rows,
        corner="size",
    )


def _draw(fitness: Fitness, pairs: PairSet) -> Drawing:
    figure, axes = drawing.panels(2, width=5.6, height=4.6)
    for panel, total in zip(axes, (SHORT, LONG), strict=True):
        lines = {f"HMS {size}": 100.0 * fitness[total, size].mean(axis=0) for size in SIZES}
        drawing.curves(panel, np.arange(1, total + 1), lines)
        panel.set_xlabel(f"fitness evaluations (of {total})")
        low = min(float(line[len(line) // 20]) for line in lines.values())
        high = max(float(line[-1]) for line in lines.values())
        panel.set_ylim(low, high + 0.06 * (high - low))
    axes[0].set_ylabel("mean best fitness (% of the scan's points)")
    drawing.legend_below(figure, axes[0], columns=6)
    return Drawing(
        f"figure-{pairs.key}",
        f"{pairs.label}: mean best fitness over evaluations by HMS, in runs of {SHORT} and of {LONG} evaluations. "
        "The first twentieth of a run is off the scale.",
        figure,
    )


def _claims(fitness: Fitness, key: str) -> list[Claim]:
    small, large = SIZES[0], SIZES[-1]

    def judge(statement: str, column: int, first: int, second: int) -> Claim:
        return compare(
            f"{key}: {statement}",
            paired(_columns(fitness, first)[column], _columns(fitness, second)[column]),
            "larger",
            this=f"HMS {first}",
            other=f"HMS {second}",
            what="mean best fitness",
            unit="points",
            scale=100.0,
        )

    return [
        judge(
            f"a small memory converges prematurely: HMS {PUBLISHED_SIZE} ends higher than HMS {small} "
            f"({SHORT} evaluations).",
            1,
            PUBLISHED_SIZE,
            small,
        ),
        judge(
            f"a larger memory does better in the initial phase: HMS {large} is ahead of HMS {small} after {EARLY} "
            "evaluations.",
            0,
            large,
            small,
        ),
        judge(
            f"with finite time a large memory may deteriorate the solution: HMS {PUBLISHED_SIZE} ends higher than HMS "
            f"{large} ({SHORT} evaluations).",
            1,
            PUBLISHED_SIZE,
            large,
        ),
        judge(
            f"with enough evaluations a larger memory usually does better: HMS {large} ends higher than HMS {small} "
            f"({LONG} evaluations).",
            2,
            large,
            small,
        ),
    ]
