"""The tables of SLAM runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hsslam_eval.comparison import Accuracy, Comparison, SlamOutcome
from hsslam_eval.significance import slam_winner
from hsslam_eval.tables import Cell, Row, Table, missing, number, over_seeds

Runs = Sequence[SlamOutcome]


def slam_tables(comparison: Comparison) -> list[Table]:
    """Accuracy by whatever truth there is; cost and loops; where there are several seeds, every run."""
    done = [run for matcher in comparison.matchers for run in matcher.runs]
    if not done:
        return []
    seeds = max(len(matcher.runs) for matcher in comparison.matchers)
    accuracy = _accuracy_columns(done)
    tables = []
    if accuracy:
        winner, tested = slam_winner(comparison)
        rows = [
            replace(row, cells=[row.cells[0], replace(row.cells[1], best=True), *row.cells[2:]])
            if row.label == winner
            else row
            for row in _rows(comparison, accuracy)
        ]
        longest = max(comparison.matchers, key=lambda matcher: len(matcher.runs)).runs
        rows.append(
            Row(
                "odometry alone",
                [
                    Cell(str(len(longest))),
                    *(cell([r.odometry_accuracy for r in longest]) for _, cell in accuracy),
                ],
            )
        )
        tables.append(
            Table(
                "slam-accuracy",
                "Accuracy",
                f"{_accuracy_explanation(done)} {_seeds_explanation(comparison, seeds, tested)}",
                ["runs", *(heading for heading, _ in accuracy)],
                rows,
            )
        )
    tables.append(
        Table(
            "slam-cost",
            "Cost and loops",
            # Of runs that were there already the report's notes say on what terms they were made.
            (
                ""
                if comparison.notes
                else "Runs one after the other, each in a process of its own, compilation excluded. "
            )
            + "Wall time is from the first scan read to the last pose; where it is longer than processor time, the run "
            "waited for something else on the machine. The real-time factor is seconds driven per second of wall "
            "time. Peak memory is the process's, interpreter and libraries included."
            + (" Means over the seeds, ± standard deviation." if seeds > 1 else ""),
            ["runs", *(heading for heading, _ in _COST)],
            [
                Row(m.label, [_runs(comparison, m.runs), *(cell(m.runs) for _, cell in _COST)])
                if m.runs
                else Row(m.label, note=missing(m, "slam"))
                for m in comparison.matchers
            ],
        )
    )
    if seeds > 1:
        tables.append(_every_run(comparison, accuracy))
    return tables


def figures_of(run: SlamOutcome) -> str:
    """What a run came to, in a line for a caption: error, time, loops."""
    accuracy, parts = run.accuracy, []
    if accuracy.relations is not None:
        mean, std = (accuracy.relations[f"translation_{what}_m"] for what in ("mean", "std"))
        turn, turn_std = (accuracy.relations[f"rotation_{what}_deg"] for what in ("mean", "std"))
        parts.append(f"Relations {mean:.4f} ± {std:.4f} m, {turn:.3f} ± {turn_std:.3f}°")
    if accuracy.ate is not None:
        parts.append(f"ATE {number(accuracy.ate['translation_rmse_m'])} m")
    if math.isfinite(run.wall_seconds):
        parts.append(f"{number(run.wall_seconds)} s")
    if run.loops_tried is not None:
        parts.append(f"loops: {run.loops_accepted} accepted of {run.loops_tried} tried")
    return "; ".join(parts)


def _count(name: str, runs: Runs) -> Cell:
    values = [getattr(run, name) for run in runs]
    known = [float(value) for value in values if value is not None]
    if known and len(set(known)) == 1:
        return Cell(f"{known[0]:.0f}", numbers=(known[0],))
    return over_seeds(known)


def _loops(runs: Runs) -> Cell:
    accepted, tried = (_count(name, runs).text for name in ("loops_accepted", "loops_tried"))
    rejected = [
        float(run.loops_tried - run.loops_accepted)
        for run in runs
        if run.loops_tried is not None and run.loops_accepted is not None
    ]
    if not rejected:
        return Cell(number(math.nan))
    return Cell(f"{accepted} / {tried}", f"{over_seeds(rejected, 0).text} rejected")


_COST: list[tuple[str, Callable[[Runs], Cell]]] = [
    ("wall time (s)", lambda runs: over_seeds([run.wall_seconds for run in runs])),
    ("processor time (s)", lambda runs: over_seeds([run.cpu_seconds for run in runs])),
    ("real-time factor", lambda runs: over_seeds([run.real_time_factor for run in runs])),
    ("peak memory (MB)", lambda runs: over_seeds([run.peak_memory_mb for run in runs], 0)),
    ("keyframes", lambda runs: _count("keyframes", runs)),
    ("loops accepted / tried", _loops),
    ("scans matched (%)", lambda runs: over_seeds([100.0 * run.matched_share for run in runs], 1)),
]


def _runs(comparison: Comparison, runs: Runs) -> Cell:
    wanted = int(comparison.config.get("seeds", 1))
    return Cell(str(len(runs)) if len(runs) >= wanted else f"{len(runs)} of {wanted}")


def _rows(
    comparison: Comparison, columns: Sequence[tuple[str, Callable[[Sequence[Accuracy]], Cell]]]
) -> list[Row]:
    return [
        Row(
            m.label,
            [_runs(comparison, m.runs), *(cell([run.accuracy for run in m.runs]) for _, cell in columns)],
        )
        if m.runs
        else Row(m.label, note=missing(m, "slam"))
        for m in comparison.matchers
    ]


def _every_run(
    comparison: Comparison, accuracy: Sequence[tuple[str, Callable[[Sequence[Accuracy]], Cell]]]
) -> Table:
    rows = []
    for matcher in comparison.matchers:
        rows += [
            Row(
                f"{matcher.label}, seed {run.seed}",
                [*(cell([run.accuracy]) for _, cell in accuracy), *(cell([run]) for _, cell in _COST)],
            )
            for run in matcher.runs
        ]
        rows += [
            Row(f"{matcher.label}, seed {failure.seed}", note=f"failed: {failure.reason}")
            for failure in matcher.failures
            if failure.stage == "slam"
        ]
    return Table(
        "slam-runs",
        "Every run",
        "The runs that the means above are of.",
        [heading for heading, _ in (*accuracy, *_COST)],
        rows,
        "run",
    )


def _accuracy_columns(done: Runs) -> list[tuple[str, Callable[[Sequence[Accuracy]], Cell]]]:
    columns: list[tuple[str, Callable[[Sequence[Accuracy]], Cell]]] = []
    if any(run.accuracy.relations for run in done):
        columns += [
            ("relations, translation mean ± std (m)", lambda a: _mean_std(a, "translation", "m", 4)),
            ("relations, rotation mean ± std (°)", lambda a: _mean_std(a, "rotation", "deg", 3)),
        ]
    for metric, headings in (
        ("ate", ("ATE rmse (m)", "ATE heading rmse (°)")),
        ("rpe", ("RPE rmse (m per m)", "RPE rmse (° per m)")),
    ):
        if any(getattr(run.accuracy, metric) for run in done):
            for heading, key in zip(headings, ("translation_rmse_m", "rotation_rmse_deg"), strict=True):
                columns.append((heading, _summary(metric, key)))
    return columns


def _summary(metric: str, key: str) -> Callable[[Sequence[Accuracy]], Cell]:
    return lambda many: over_seeds([(getattr(a, metric) or {}).get(key, math.nan) for a in many])


def _mean_std(many: Sequence[Accuracy], name: str, unit: str, digits: int) -> Cell:
    known = [accuracy.relations for accuracy in many if accuracy.relations is not None]
    if not known:
        return Cell(number(math.nan))
    mean, std = (
        np.array([relations[f"{name}_{what}_{unit}"] for relations in known]) for what in ("mean", "std")
    )
    between = float(mean.std(ddof=1)) if len(mean) > 1 else math.nan
    return Cell(
        f"{mean.mean():.{digits}f} ± {std.mean():.{digits}f}",
        f"seeds ± {number(between)}" if len(mean) > 1 else "",
        numbers=(float(mean.mean()), float(std.mean()), *([between] if len(mean) > 1 else [])),
    )


def _accuracy_explanation(done: Runs) -> str:
    parts = []
    relations = next((run.accuracy.relations for run in done if run.accuracy.relations), None)
    if relations:
        parts.append(
            f"Relations: error of the estimated relative pose against {relations['count']:.0f} verified ones "
            "(Kuemmerle et al. 2009), mean ± standard deviation over the relations."
        )
    if any(run.accuracy.ate for run in done):
        parts.append(
            "ATE: root mean square distance from the exact trajectory after the best rigid alignment. RPE: the same "
            "over stretches of 1 m."
        )
    return " ".join(parts)


def _seeds_explanation(comparison: Comparison, seeds: int, tested: str) -> str:
    if seeds < 2:
        return "One run each, so no intervals, and no winner is marked."
    varies = "; every seed is another simulation of the log" if comparison.dataset.kind == "simulated" else ""
    return f"Means over {seeds} seeds, ± standard deviation between them{varies}. {tested}"
