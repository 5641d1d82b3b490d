"""The tables of trials, and what they come to."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from hsslam_eval.comparison import Comparison, MatcherTrials
from hsslam_eval.significance import (
    MEASURES,
    Duel,
    Measure,
    decidable,
    duels,
    succeeded,
    unbeaten,
    winners,
)
from hsslam_eval.tables import Cell, Row, Table, limit_text, measured, missing, number, spread

_ERRORS = ["displacement mean (cm)", "displacement median (cm)", "rotation mean (°)", "rotation median (°)"]


def trial_tables(comparison: Comparison) -> list[Table]:
    """Success and cost; errors over all trials; errors over the successful ones; every pair of matchers."""
    first = next((matcher.trials for matcher in comparison.matchers if matcher.trials is not None), None)
    if first is None:
        return []
    found = duels(comparison)
    best = winners(found)
    definitions = first.successes
    percent = f"{100.0 * comparison.config['trials']['confidence']:.3g} %"
    limits = [limit_text(s.displacement_limit_m, s.rotation_limit_deg) for s in definitions]
    marked = (
        " ★: significantly better than every other matcher here (paired tests below, Holm's correction)."
        if found
        else ""
    )
    tables = [
        Table(
            "success",
            "Success and cost",
            f"Success ratio by each definition of success, with its {percent} Wilson interval; time per match with "
            f"{percent} bootstrap intervals, the reference being prepared; evaluations per match."
            f"{marked} {_unanswered(comparison)}",
            ["trials", "no answer", *(f"success (%) {limit}" for limit in limits)]
            + ["time median (ms)", "time mean (ms)", "evaluations mean"],
            _rows(comparison, lambda label, trials: _success_cells(trials, label, best)),
        ),
        Table(
            "errors-all",
            "Errors over all trials",
            f"{percent} bootstrap intervals; failures included. Where there was no answer, the error is that of the "
            f"guess (mean {number(first.initial_displacement_m, 100.0)} cm, {number(first.initial_rotation_deg)}°)."
            f"{marked}",
            ["trials", *_ERRORS],
            _rows(
                comparison,
                lambda label, trials: [
                    _count(trials.count),
                    *spread(trials.displacement_all_m, 100.0, best=best.get("displacement") == label),
                    *spread(trials.rotation_all_deg, best=best.get("rotation") == label),
                ],
            ),
        ),
        Table(
            "errors-successes",
            f"Errors over the successful trials ({limits[0]})",
            f"{percent} bootstrap intervals. Errors of successes alone flatter a matcher that seldom succeeds; read "
            "them beside the success ratio. Not tested: each matcher's successes are other trials.",
            ["successes", *_ERRORS],
            _rows(
                comparison,
                lambda label, trials: [
                    _count(trials.successes[0].count),
                    *spread(trials.successes[0].displacement_m, 100.0),
                    *spread(trials.successes[0].rotation_deg),
                ],
            ),
        ),
    ]
    return [*tables, _pairs(found, limits[0])] if found else tables


def verdict(comparison: Comparison) -> str:
    """Who is ahead in the trials: named only where it is significantly better than every other one.

    A matcher that never answered or never succeeded is called so, and never one that is beaten by none.
    """
    found = duels(comparison)
    if not found:
        return ""
    best, level = winners(found), found[0].level
    trials = {m.label: m.trials for m in comparison.matchers if m.trials is not None}
    silent = [label for label, of in trials.items() if sum(of.unanswered.values()) == of.count]
    failed = [label for label, of in trials.items() if not succeeded(of).any() and label not in silent]
    what: dict[Measure, tuple[str, str]] = {
        "success": ("succeeds more often than every other matcher", "success"),
        "displacement": ("has smaller displacement errors than every other matcher", "displacement error"),
        "rotation": ("has smaller rotation errors than every other matcher", "rotation error"),
        "time": ("is faster than every other matcher", "time"),
    }
    parts = []
    if not decidable(found):
        most = max(duel.test.count for duel in found)
        parts.append(
            f"Too few trials to tell who is better: with {most} of them, none of the {len(found)} differences "
            "tested could be significant."
        )
    else:
        for measure in MEASURES:
            claim, name = what[measure]
            if measure in best:
                parts.append(f"{best[measure]} {claim}.")
                continue
            out = {*silent, *failed} if measure == "success" else {*silent}
            first = [label for label in unbeaten(found, measure) if label not in out]
            parts.append(
                f"No single best in {name}: {_listed(first)} {'are' if len(first) > 1 else 'is'} beaten by none."
            )
    if failed:
        parts.append(f"{_listed(failed)} never succeeded.")
    if silent:
        parts.append(f"{_listed(silent)} never gave an answer.")
    lost = [m.label for m in comparison.matchers if any(failure.stage == "trials" for failure in m.failures)]
    if lost:
        parts.append(f"Trials failed, see what is missing: {_listed(lost)}.")
    return f"{' '.join(parts)} (Paired tests, corrected p < {level:.2g}.)"


def _listed(labels: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(labels[:-1]), labels[-1]])) if labels else "nobody"


def _success_cells(trials: MatcherTrials, label: str, best: Mapping[Measure, str]) -> list[Cell]:
    return [
        _count(trials.count),
        _count(sum(trials.unanswered.values())),
        *(
            Cell(
                f"{100.0 * s.ratio.value:.1f}",
                f"{100.0 * s.ratio.low:.1f} to {100.0 * s.ratio.high:.1f}",
                place == 0 and best.get("success") == label,
                (100.0 * s.ratio.value, 100.0 * s.ratio.low, 100.0 * s.ratio.high),
            )
            for place, s in enumerate(trials.successes)
        ),
        measured(trials.seconds.median, 1e3, best=best.get("time") == label),
        measured(trials.seconds.mean, 1e3),
        # A matcher that does not count its evaluations reports none.
        Cell(number(trials.evaluations_mean or math.nan).removesuffix(".0")),
    ]


def _count(value: int) -> Cell:
    return Cell(str(value))


def _unanswered(comparison: Comparison) -> str:
    """Say why there were trials without an answer, the most frequent reasons first."""
    reasons = [
        f"{matcher.label} {count} of {matcher.trials.count} ({reason[:160]})"
        for matcher in comparison.matchers
        if matcher.trials is not None
        for reason, count in list(matcher.trials.unanswered.items())[:3]
    ]
    return f"No answer: {'; '.join(reasons)}." if reasons else "Every trial got an answer."


def _rows(comparison: Comparison, cells: Callable[[str, MatcherTrials], list[Cell]]) -> list[Row]:
    return [
        Row(m.label, cells(m.label, m.trials))
        if m.trials is not None
        else Row(m.label, note=missing(m, "trials"))
        for m in comparison.matchers
    ]


_UNITS: dict[Measure, tuple[str, float]] = {
    "success": ("Δ success (points)", 100.0),
    "displacement": ("Δ displacement (cm)", 100.0),
    "rotation": ("Δ rotation (°)", 1.0),
    "time": ("Δ time (ms)", 1e3),
}


def _pairs(found: list[Duel], limit: str) -> Table:
    headings = [heading for measure in MEASURES for heading in (_UNITS[measure][0], "p")]
    of_pair: dict[tuple[str, str], list[Duel]] = {}
    for duel in found:
        of_pair.setdefault((duel.first, duel.second), []).append(duel)
    rows = [
        Row(f"{one} – {other}", [cell for duel in of_one for cell in _duel(duel)])  # noqa: RUF001
        for (one, other), of_one in of_pair.items()
    ]
    return Table(
        "pairs",
        "Every pair of matchers",
        f"Δ: first minus second on the same trials; p: two-sided, after Holm's correction over all {len(found)} tests "
        f"of this table; bold below {found[0].level:.2g}. Success ({limit}): McNemar's exact test; below Δ in how many "
        "trials only the first and only the second succeeded. Errors over all trials and times: Wilcoxon's signed rank "
        "test; Δ is the median difference, r the rank-biserial correlation of the pairs (-1: the first always "
        "smaller). Trials on one pair of scans with different guesses count as independent.",
        headings,
        rows,
        "pair",
        mark="",
        second="effect",
    )


def _duel(duel: Duel) -> list[Cell]:
    test, scale = duel.test, _UNITS[duel.measure][1]
    effect = f"{test.wins} : {test.losses}" if duel.measure == "success" else f"r = {test.effect:+.2f}"
    shown = number(test.difference, scale)
    if not shown.strip("-0."):
        shown = "0"
    elif test.difference > 0.0:
        shown = f"+{shown}"
    p = duel.corrected
    return [
        Cell(
            shown,
            effect,
            bool(duel.better),
            (scale * test.difference, test.effect),
        ),
        Cell("< 0.001" if p < 0.001 else f"{p:.3f}", "", bool(duel.better), (p,)),
    ]
