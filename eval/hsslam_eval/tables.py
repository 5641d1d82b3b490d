"""The tables of a report, cell by cell as text; HTML and Markdown are two ways to lay out the same ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from hsslam_eval.comparison import (
    Accuracy,
    Comparison,
    MatcherOutcome,
    MatcherTrials,
    Measured,
    SlamOutcome,
    Spread,
)


@dataclass(frozen=True)
class Cell:
    """A number as text, and its interval or spread under it."""

    text: str
    interval: str = ""


@dataclass(frozen=True)
class Row:
    """A matcher's row; ``note`` fills it where there are no cells: why it has none."""

    label: str
    cells: list[Cell] = field(default_factory=list)
    note: str = ""


@dataclass(frozen=True)
class Table:
    """A titled table; headings carry the units."""

    title: str
    explanation: str
    headings: list[str]
    rows: list[Row]


def trial_tables(comparison: Comparison) -> list[Table]:
    """Success and cost; errors over the successful trials; errors over all of them."""
    first = next((matcher.trials for matcher in comparison.matchers if matcher.trials is not None), None)
    if first is None:
        return []
    definitions = first.successes
    percent = f"{100.0 * comparison.config['trials']['confidence']:.3g} %"
    limits = [limit_text(s.displacement_limit_m, s.rotation_limit_deg) for s in definitions]
    errors = [
        "displacement mean (cm)",
        "displacement median (cm)",
        "rotation mean (°)",
        "rotation median (°)",
    ]
    return [
        Table(
            "Success and cost",
            f"Success ratio by each definition of success, with its {percent} Wilson interval; time per match with "
            f"{percent} bootstrap intervals, the reference being prepared; evaluations per match. "
            + _unanswered(comparison),
            ["trials", "no answer", *(f"success (%) {limit}" for limit in limits)]
            + ["time median (ms)", "time mean (ms)", "evaluations mean"],
            _trial_rows(comparison, _success_cells),
        ),
        Table(
            f"Errors over the successful trials ({limits[0]})",
            f"{percent} bootstrap intervals. Errors of successes alone flatter a matcher that seldom succeeds; read "
            "them beside the success ratio.",
            ["successes", *errors],
            _trial_rows(
                comparison,
                lambda trials: [
                    Cell(str(trials.successes[0].count)),
                    *_spread(trials.successes[0].displacement_m, 100.0),
                    *_spread(trials.successes[0].rotation_deg),
                ],
            ),
        ),
        Table(
            "Errors over all trials",
            f"{percent} bootstrap intervals; failures included. Where there was no answer, the error is that of the "
            f"guess (mean {number(first.initial_displacement_m, 100.0)} cm, {number(first.initial_rotation_deg)}°).",
            ["trials", *errors],
            _trial_rows(
                comparison,
                lambda trials: [
                    Cell(str(trials.count)),
                    *_spread(trials.displacement_all_m, 100.0),
                    *_spread(trials.rotation_all_deg),
                ],
            ),
        ),
    ]


def slam_tables(comparison: Comparison) -> list[Table]:
    """Accuracy by whatever truth there is; cost and loops."""
    done = [matcher.slam for matcher in comparison.matchers if matcher.slam is not None]
    if not done:
        return []
    columns = _accuracy_columns(done)
    tables = []
    if columns:
        rows = _slam_rows(comparison, lambda slam: [cell(slam.accuracy) for _, cell in columns])
        odometry = next((slam.odometry_accuracy for slam in done), Accuracy())
        rows.append(Row("odometry alone", [cell(odometry) for _, cell in columns]))
        tables.append(
            Table("Accuracy", _accuracy_explanation(done), [heading for heading, _ in columns], rows)
        )
    tables.append(
        Table(
            "Cost and loops",
            "One run each, one after the other, each in a process of its own. Wall time is from the first scan read "
            "to the last pose, compilation excluded; the real-time factor is seconds driven per second computed. "
            "Peak memory is the process's, interpreter and libraries included.",
            ["wall time (s)", "real-time factor", "peak memory (MB)", "keyframes", "loops accepted / tried"]
            + ["scans matched (%)"],
            _slam_rows(
                comparison,
                lambda slam: [
                    Cell(number(slam.wall_seconds)),
                    Cell(number(slam.real_time_factor)),
                    Cell(f"{slam.peak_memory_mb:.0f}"),
                    Cell(str(slam.keyframes)),
                    Cell(f"{slam.loops_accepted} / {slam.loops_tried}"),
                    Cell(f"{100.0 * slam.matched_share:.1f}"),
                ],
            ),
        )
    )
    return tables


def verdict(comparison: Comparison) -> str:
    """Who is ahead in the trials: named only where its interval overlaps no other's."""
    trials = {m.label: m.trials for m in comparison.matchers if m.trials is not None}
    if len(trials) < 2:
        return ""
    ratios = {label: outcome.successes[0].ratio for label, outcome in trials.items()}
    medians = {label: outcome.displacement_all_m.median for label, outcome in trials.items()}
    most = _ahead(ratios, highest=True)
    nearest = _ahead(medians, highest=False)
    parts = [
        f"{most} succeeds more often than every other (no interval overlaps its own)."
        if most
        else "No matcher succeeds more often than every other: intervals overlap.",
        f"{nearest} has the smallest median displacement over all trials (no interval overlaps its own)."
        if nearest
        else "No matcher has the smallest median displacement: intervals overlap.",
    ]
    return " ".join(parts)


def limit_text(displacement_m: float, rotation_deg: float) -> str:
    """A definition of success in words."""
    # No-break spaces, so that a narrow heading does not part a number from its unit.
    return f"< {100.0 * displacement_m:.3g} cm, < {rotation_deg:.3g}°".replace(
        " ", "\N{NO-BREAK SPACE}"
    ).replace(",\N{NO-BREAK SPACE}", ", ")


def number(value: float, scale: float = 1.0) -> str:
    """Three significant digits, without an exponent where that is readable; a dash for NaN."""
    value *= scale
    if not math.isfinite(value):
        return "–"  # noqa: RUF001
    if value == 0.0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 5)}f}"


def _ahead(measured: dict[str, Measured], *, highest: bool) -> str:
    sign = 1.0 if highest else -1.0
    known = {label: m for label, m in measured.items() if math.isfinite(m.value)}
    if len(known) < len(measured):
        return ""
    best = max(known, key=lambda label: sign * known[label].value)
    near, far = ("low", "high") if highest else ("high", "low")
    edge = sign * getattr(known[best], near)
    others = [sign * getattr(m, far) for label, m in known.items() if label != best]
    return best if edge > max(others) else ""


def _success_cells(trials: MatcherTrials) -> list[Cell]:
    return [
        Cell(str(trials.count)),
        Cell(str(sum(trials.unanswered.values()))),
        *(
            Cell(
                f"{100.0 * s.ratio.value:.1f}",
                f"{100.0 * s.ratio.low:.1f} to {100.0 * s.ratio.high:.1f}",
            )
            for s in trials.successes
        ),
        _measured(trials.seconds.median, 1e3),
        _measured(trials.seconds.mean, 1e3),
        # A matcher that does not count its evaluations reports none.
        Cell(number(trials.evaluations_mean or math.nan).removesuffix(".0")),
    ]


def _unanswered(comparison: Comparison) -> str:
    """Say why there were trials without an answer, the most frequent reasons first."""
    reasons = [
        f"{matcher.label} {count} times ({reason[:160]})"
        for matcher in comparison.matchers
        if matcher.trials is not None
        for reason, count in list(matcher.trials.unanswered.items())[:3]
    ]
    return f"No answer: {'; '.join(reasons)}." if reasons else "Every trial got an answer."


def _measured(measured: Measured, scale: float = 1.0) -> Cell:
    if not math.isfinite(measured.value):
        return Cell(number(measured.value))
    return Cell(
        number(measured.value, scale), f"{number(measured.low, scale)} to {number(measured.high, scale)}"
    )


def _spread(spread: Spread, scale: float = 1.0) -> list[Cell]:
    return [_measured(spread.mean, scale), _measured(spread.median, scale)]


def _trial_rows(comparison: Comparison, cells: Callable[[MatcherTrials], list[Cell]]) -> list[Row]:
    return [
        Row(m.label, cells(m.trials)) if m.trials is not None else Row(m.label, note=missing(m, "trials"))
        for m in comparison.matchers
    ]


def _slam_rows(comparison: Comparison, cells: Callable[[SlamOutcome], list[Cell]]) -> list[Row]:
    return [
        Row(m.label, cells(m.slam)) if m.slam is not None else Row(m.label, note=missing(m, "slam"))
        for m in comparison.matchers
    ]


def missing(matcher: MatcherOutcome, stage: str) -> str:
    """Why a matcher has no result for ``trials`` or ``slam``, in a line."""
    for failure in matcher.failures:
        if failure.stage == "unavailable":
            return f"unavailable: {failure.reason}"
        if failure.stage == stage:
            return f"failed: {failure.reason}"
    return "not run"


def _accuracy_columns(done: Sequence[SlamOutcome]) -> list[tuple[str, Callable[[Accuracy], Cell]]]:
    columns: list[tuple[str, Callable[[Accuracy], Cell]]] = []
    if any(slam.accuracy.relations for slam in done):
        columns += [
            ("relations, translation mean ± std (m)", lambda a: _mean_std(a, "translation", "m", 4)),
            ("relations, rotation mean ± std (°)", lambda a: _mean_std(a, "rotation", "deg", 3)),
        ]
    if any(slam.accuracy.ate for slam in done):
        columns += [
            ("ATE rmse (m)", lambda a: Cell(number((a.ate or {}).get("translation_rmse_m", math.nan)))),
            (
                "ATE heading rmse (°)",
                lambda a: Cell(number((a.ate or {}).get("rotation_rmse_deg", math.nan))),
            ),
        ]
    if any(slam.accuracy.rpe for slam in done):
        columns += [
            ("RPE rmse (m per m)", lambda a: Cell(number((a.rpe or {}).get("translation_rmse_m", math.nan)))),
            ("RPE rmse (° per m)", lambda a: Cell(number((a.rpe or {}).get("rotation_rmse_deg", math.nan)))),
        ]
    return columns


def _mean_std(accuracy: Accuracy, name: str, unit: str, digits: int) -> Cell:
    if accuracy.relations is None:
        return Cell(number(math.nan))
    mean, std = accuracy.relations[f"{name}_mean_{unit}"], accuracy.relations[f"{name}_std_{unit}"]
    return Cell(f"{mean:.{digits}f} ± {std:.{digits}f}")


def _accuracy_explanation(done: Sequence[SlamOutcome]) -> str:
    parts = []
    relations = next((slam.accuracy.relations for slam in done if slam.accuracy.relations), None)
    if relations:
        parts.append(
            f"Relations: error of the estimated relative pose against {relations['count']:.0f} verified ones "
            "(Kuemmerle et al. 2009)."
        )
    if any(slam.accuracy.ate for slam in done):
        parts.append(
            "ATE: root mean square distance from the exact trajectory after the best rigid alignment. RPE: the same "
            "over stretches of 1 m."
        )
    parts.append("One run each, so no intervals.")
    return " ".join(parts)
