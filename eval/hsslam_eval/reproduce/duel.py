"""Tables 1 and 2: two methods on the same trials, over two windows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam_eval.reproduce.data import PairSet, trial_config
from hsslam_eval.reproduce.experiment import Claim, Request, Row, Table, Tell, Value
from hsslam_eval.reproduce.judge import compare, paired
from hsslam_eval.reproduce.methods import Method
from hsslam_eval.reproduce.regret import Optima, find_optima, regret_of
from hsslam_eval.statistics import Interval
from hsslam_eval.trials import TrialOutcome, TrialResult, run_trial, warm_up

SIDES = (0.20, 0.30)
"""L: side of the box that guesses are drawn from (m)."""

HEADINGS = (
    "success (%) <\N{NO-BREAK SPACE}10\N{NO-BREAK SPACE}cm, <\N{NO-BREAK SPACE}0.01\N{NO-BREAK SPACE}rad",
    "success (%) <\N{NO-BREAK SPACE}10\N{NO-BREAK SPACE}cm, <\N{NO-BREAK SPACE}2°",
    "success (%) <\N{NO-BREAK SPACE}5\N{NO-BREAK SPACE}cm, <\N{NO-BREAK SPACE}1°",
    "displacement of successes, mean (cm)",
    "rotation of successes, mean (°)",
    "displacement of all, mean (cm)",
    "rotation of all, mean (°)",
    "time per match, median (ms)",
    "evaluations",
)


@dataclass(frozen=True)
class Published:
    """A row of the paper's Table 1 or 2: ms, share, cm, degrees."""

    milliseconds: float
    success: float
    displacement: float
    rotation: float


@dataclass(frozen=True, eq=False)
class Bout:
    """One method over one window."""

    method: Method
    side: float
    result: TrialResult
    regret: Value | None
    optima: Optima | None


Bouts: TypeAlias = Mapping[tuple[str, float], Bout]
"""By the method's label and the side of the window (m)."""


def fight(request: Request, methods: Sequence[Method], pairs: PairSet, count: int, tell: Tell) -> Bouts:
    """Run every method over every window on the same pairs with the same guesses.

    The methods take turns trial by trial, so that whatever else the machine does slows them all alike.
    """
    bouts = {}
    for side in SIDES:
        config = trial_config(request, count, side)
        outcomes: dict[str, list[TrialOutcome]] = {method.label: [] for method in methods}
        for method in methods:
            warm_up(method.matcher, pairs.pairs, config)
        for trial, pair in enumerate(pairs.pairs):
            for method in methods:
                outcomes[method.label].append(run_trial(method.matcher, pair, config, trial))
            tell(f"{pairs.key} trials, L = {100 * side:.0f} cm", trial + 1, len(pairs.pairs))
        optima = find_optima(pairs.pairs, config, tell)
        for method in methods:
            result = TrialResult.gather(method.label, pairs.key, config, outcomes[method.label])
            regret = None if optima is None else regret_of(method, optima, pairs.pairs, config, tell)
            bouts[method.label, side] = Bout(method, side, result, regret, optima)
    return bouts


def table(
    bouts: Bouts,
    paper: Mapping[tuple[str, float], Published],
    pairs: PairSet,
    methods: Sequence[Method],
) -> Table:
    """Lay the bouts out, the window changing slowest, as in the paper."""
    proofs = [bout.optima.proven for bout in bouts.values() if bout.optima is not None]
    judged, proven = bool(proofs), float(np.mean(proofs or [0.0]))
    rows = [
        Row(f"L = {100 * side:.0f} cm: {method.label}", _cells(bouts[method.label, side], paper, judged))
        for side in SIDES
        for method in methods
    ]
    explanation = (
        f"{len(pairs.pairs)} pairs of scans: {pairs.label}. Guesses are off by up to L/2 along x and y and 10°, and "
        "the same for every method. Success ratios with 95% Wilson intervals, errors with 95% bootstrap intervals. "
        "Errors of successes are those under 10 cm and 0.01 rad. Times are of this machine, reference prepared; "
        "the paper's are of another machine, so compare ratios only."
    )
    if judged:
        explanation += (
            " Regret: hits that the best pose of the window, found by exhaustive search, has over the pose found by "
            "the method, per point of the scan; for methods with the paper's fitness and no refinement. That pose is "
            f"proven the best to less than a point in {100 * proven:.1f}% of the trials."
        )
    return Table(pairs.label, explanation, (*HEADINGS, *(["regret (%)"] if judged else [])), tuple(rows))


def _cells(bout: Bout, paper: Mapping[tuple[str, float], Published], judged: bool) -> tuple[Value | str, ...]:
    told = paper.get((bout.method.label, bout.side))
    said = told if told is not None else Published(math.nan, math.nan, math.nan, math.nan)
    summary = bout.result.summary()
    strict, middle, narrow = (summary.success[name] for name in ("glasm", "10cm_2deg", "5cm_1deg"))
    cells: list[Value | str] = [
        Value.of(strict.ratio, 100.0, 100.0 * said.success),
        Value.of(middle.ratio, 100.0),
        Value.of(narrow.ratio, 100.0),
        Value.of(strict.displacement_m.mean, 100.0, said.displacement),
        Value.of(strict.rotation_deg.mean, 1.0, said.rotation),
        Value.of(summary.displacement_m.mean, 100.0),
        Value.of(summary.rotation_deg.mean),
        Value(1e3 * summary.match_seconds_median, paper=said.milliseconds),
        Value(summary.evaluations_mean),
    ]
    if judged:
        cells.append(bout.regret if bout.regret is not None else "–")  # noqa: RUF001
    return tuple(cells)


def success(
    bouts: Bouts, first: str, second: str, side: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Which trials two methods succeeded in by the GLASM authors' limits, 0 or 1, (T,) each."""
    a, b = (strict_success(bouts[label, side].result).astype(np.float64) for label in (first, second))
    return a, b


def errors(bouts: Bouts, first: str, second: str, side: float, quantity: str) -> Interval:
    """Mean of first minus second of ``displacement`` (m) or ``rotation`` (rad) where both succeed."""
    a, b = bouts[first, side].result, bouts[second, side].result
    both = strict_success(a) & strict_success(b)
    return paired(getattr(a, quantity)[both], getattr(b, quantity)[both])


def speed_claim(bouts: Bouts, first: str, second: str, side: float, at: str, paper: float) -> Claim:
    """Judge that ``first`` takes less time than ``second``; ``paper`` is its ratio of times."""
    a, b = bouts[first, side].result, bouts[second, side].result
    claim = compare(
        f"{at}: {first} converges faster than {second}.",
        paired(a.seconds, b.seconds, "median"),
        "smaller",
        this=first,
        other=second,
        what="time per match",
        unit="ms",
        scale=1e3,
    )
    ratio = float(np.median(a.seconds) / np.median(b.seconds))
    work = float(np.mean(a.evaluations) / np.mean(b.evaluations))
    return replace(
        claim,
        why=f"{claim.why} It takes {ratio:.2f} times as long with {work:.2f} times the evaluations; in the paper "
        f"(another machine) {paper:.2f} times as long.",
    )


def strict_success(result: TrialResult) -> NDArray[np.bool_]:
    """Success by the GLASM authors' limits, (T,)."""
    limit = next(each for each in result.config.thresholds if each.name == "glasm")
    return result.success(limit)


def described(methods: Sequence[Method]) -> dict[str, Any]:
    """Every parameter of every method."""
    return {method.label: method.described() for method in methods}
