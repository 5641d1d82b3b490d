"""Figure 7: what the memory considering rate (HMCR) does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam_eval.reproduce import drawing, methods
from hsslam_eval.reproduce.data import PairSet, pair_sets, trial_config
from hsslam_eval.reproduce.experiment import Claim, Drawing, Experiment, Request, Row, Table, Tell, Value
from hsslam_eval.reproduce.findings import Findings
from hsslam_eval.reproduce.judge import paired
from hsslam_eval.reproduce.traces import trace_trials
from hsslam_eval.statistics import Interval, bootstrap_interval

RATES = (0.0, 0.3, 0.5, 0.7, 0.8, 0.88, 0.95, 1.0)
PUBLISHED_RATE = 0.88
BUDGETS = (50, 250, 1000)
"""Improvisations (NI) after the memory is filled; 250 is the paper's."""

PUBLISHED_BUDGET = 250

Errors = dict[tuple[int, float], NDArray[np.float64]]
"""Final displacement error (T,) in m, by budget and rate."""


def run(request: Request, tell: Tell) -> Experiment:
    """Redo Figure 7; see `hsslam_eval.reproduce`."""
    count = request.count(500, 40)
    found = Findings(request)
    for pairs in pair_sets(request, count):
        errors: Errors = {}
        evolution: dict[str, NDArray[np.float64]] = {}
        config = trial_config(request, count)
        for budget in BUDGETS:
            for rate in RATES:
                label = f"HMCR {rate:g}, NI {budget}, {pairs.key}"
                method = methods.published("hsl", label, memory_considering_rate=rate, improvisations=budget)
                evaluations = methods.MEMORY_SIZE + budget
                traces = trace_trials(method, pairs.pairs, config, evaluations, tell)
                errors[budget, rate] = traces.displacement[:, -1]
                if budget == PUBLISHED_BUDGET:
                    evolution[f"HMCR {rate:g}"] = 100.0 * traces.displacement.mean(axis=0)
        values = {key: Value.of(bootstrap_interval(e, seed=request.seed), 100.0) for key, e in errors.items()}
        found.tables.append(_table(values, pairs, len(pairs.pairs)))
        found.drawings.append(_draw(values, evolution, pairs))
        found.claims += [_least_at_published(errors, pairs.key), _more_helps(errors, pairs.key)]
        found.series[pairs.key] = {label: np.round(line, 4).tolist() for label, line in evolution.items()}
    return found.experiment(
        "fig7",
        "Figure 7: memory considering rate (HMCR)",
        summary="HSL as published but for HMCR and the number of improvisations: displacement error of the best "
        "harmony over fitness evaluations, and at the end, L = 30 cm. The mean is over all trials, failures included.",
        counts={"trials per setting": count},
        config={
            "rates": list(RATES),
            "improvisations": list(BUDGETS),
            **methods.published("hsl").described(),
        },
        notes=(
            "The paper prints no figures beside the plot; its text says that 0.88 gives the least error.",
            "Pitch adjustment and bandwidth follow the share of the budget that is spent, so the first 50 evaluations "
            "of a run of 250 are not a run of 50.",
        ),
    )


def _table(values: dict[tuple[int, float], Value], pairs: PairSet, count: int) -> Table:
    rows = tuple(
        Row(
            f"HMCR {rate:g}{' (published)' if rate == PUBLISHED_RATE else ''}",
            tuple(values[budget, rate] for budget in BUDGETS),
        )
        for rate in RATES
    )
    return Table(
        f"Mean displacement error by HMCR: {pairs.label}",
        f"{count} trials each, L = 30 cm, all trials; 95% bootstrap intervals.",
        tuple(f"displacement, NI = {budget} (cm)" for budget in BUDGETS),
        rows,
        corner="rate",
    )


def _draw(
    values: dict[tuple[int, float], Value], evolution: dict[str, NDArray[np.float64]], pairs: PairSet
) -> Drawing:
    figure, (left, right) = drawing.panels(2, width=5.6, height=4.9)
    shown = {f"HMCR {rate:g}": evolution[f"HMCR {rate:g}"] for rate in (0.0, 0.5, 0.7, 0.88, 0.95, 1.0)}
    first = next(iter(shown.values()))
    drawing.curves(left, np.arange(1, len(first) + 1), shown)
    left.axvline(methods.MEMORY_SIZE, color=drawing.GREY, linewidth=1.0, linestyle=":")
    left.annotate(
        "memory filled",
        (methods.MEMORY_SIZE, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, -10),
        textcoords="offset points",
        color=drawing.GREY,
        fontsize=8,
    )
    left.set_xlabel("fitness evaluations (NI = 250)")
    left.set_ylabel("mean displacement error (cm)")
    left.set_ylim(bottom=0.0)
    lines = {f"NI = {budget}": [values[budget, rate] for rate in RATES] for budget in BUDGETS}
    drawing.with_intervals(right, RATES, lines, shift=0.008)
    right.axvline(PUBLISHED_RATE, color=drawing.GREY, linewidth=1.0, linestyle=":", label="published, 0.88")
    right.set_xlabel("HMCR")
    right.set_ylabel("mean displacement error at the end (cm)")
    right.set_ylim(bottom=0.0)
    for axes, columns in ((left, 3), (right, 2)):
        # Matplotlib lists lines before error bars; the published rate is a remark, so it comes last.
        entries = sorted(
            zip(*axes.get_legend_handles_labels(), strict=True), key=lambda e: e[1].startswith("published")
        )
        axes.legend(
            *zip(*entries, strict=True),
            loc="upper center",
            bbox_to_anchor=(0.5, -0.16),
            ncols=columns,
            frameon=False,
            handlelength=3.2,
        )
    return Drawing(
        f"figure-{pairs.key}",
        f"{pairs.label}. Left: mean displacement error of the best harmony over evaluations, by HMCR. Right: at the "
        "end of runs of three lengths, with 95% intervals.",
        figure,
    )


def _least_at_published(errors: Errors, key: str) -> Claim:
    """Judge whether no other rate gives a smaller error than 0.88 does."""
    statement = f"{key}: the displacement error is least at HMCR 0.88 (NI = {PUBLISHED_BUDGET})."
    published = errors[PUBLISHED_BUDGET, PUBLISHED_RATE]
    better: list[tuple[float, Interval]] = []
    worse: list[tuple[float, Interval]] = []
    tied: list[tuple[float, Interval]] = []
    for rate in RATES:
        if rate == PUBLISHED_RATE:
            continue
        difference = paired(errors[PUBLISHED_BUDGET, rate], published)
        side = better if difference.high < 0.0 else worse if difference.low > 0.0 else tied
        side.append((rate, difference))
    if better:
        rate, gain = min(better, key=lambda pair: pair[1].value)
        return Claim(statement, "does not hold", f"HMCR {rate:g} is better by {_cm(gain)}.")
    said = f"No rate tried is better; worse: {_rates(worse)}"
    return Claim(statement, "holds", said + (f"; not to be told apart: {_rates(tied)}." if tied else "."))


def _more_helps(errors: Errors, key: str) -> Claim:
    gain = paired(errors[BUDGETS[0], PUBLISHED_RATE], errors[BUDGETS[-1], PUBLISHED_RATE])
    return Claim(
        f"{key}: more fitness evaluations lower the error (at HMCR 0.88).",
        "holds" if gain.low > 0.0 else "does not hold",
        f"From {BUDGETS[0]} to {BUDGETS[-1]} improvisations it falls by {_cm(gain)}.",
    )


def _cm(change: Interval) -> str:
    value, low, high = abs(change.value), change.low, change.high
    return f"{100 * value:.2f} cm (95% interval of the difference {100 * low:+.2f} to {100 * high:+.2f})"


def _rates(found: list[tuple[float, Interval]]) -> str:
    return ", ".join(f"{rate:g}" for rate, _ in found) or "none"
