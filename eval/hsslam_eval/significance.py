"""Which differences between matchers the trials can tell: every pair, by every measure, one family of tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hsslam_eval.comparison import Comparison, MatcherTrials, SlamOutcome
from hsslam_eval.paired_tests import PairedTest, holm, mcnemar, signed_rank

Measure = Literal["success", "displacement", "rotation", "time"]
MEASURES: tuple[Measure, ...] = ("success", "displacement", "rotation", "time")
"""By the first definition of success; errors over all trials; time per match."""


@dataclass(frozen=True)
class Duel:
    """Two matchers by one measure.

    Parameters
    ----------
    first, second : str
        Labels.
    measure : str
        One of `MEASURES`.
    test : PairedTest
        Of the first against the second.
    corrected : float
        p after Holm's correction over the whole family.
    level : float
        Below which ``corrected`` counts.
    """

    first: str
    second: str
    measure: Measure
    test: PairedTest
    corrected: float
    level: float

    @property
    def better(self) -> str:
        """Label of the one that is better; empty where the difference is not significant."""
        if not self.corrected < self.level or self.test.effect == 0.0:
            return ""
        ahead = self.test.effect > 0.0 if self.measure == "success" else self.test.effect < 0.0
        return self.first if ahead else self.second


def duels(comparison: Comparison) -> list[Duel]:
    """Test every pair of matchers that have trials in common by every measure."""
    trials = {m.label: m.trials for m in comparison.matchers if m.trials is not None}
    if len(trials) < 2:
        return []
    level = _level(comparison)
    made = [
        (one, other, measure, _test(trials[one], trials[other], measure))
        for one, other in combinations(trials, 2)
        for measure in MEASURES
    ]
    corrected = holm([test.p for *_, test in made])
    return [
        Duel(one, other, measure, test, float(p), level)
        for (one, other, measure, test), p in zip(made, corrected, strict=True)
    ]


def winners(found: list[Duel]) -> Mapping[Measure, str]:
    """By measure the matcher that is significantly better than every other one, where there is one."""
    out: dict[Measure, str] = {}
    for measure in MEASURES:
        of_measure = [duel for duel in found if duel.measure == measure]
        for label in dict.fromkeys(name for duel in of_measure for name in (duel.first, duel.second)):
            if all(duel.better == label for duel in of_measure if label in (duel.first, duel.second)):
                out[measure] = label
    return out


def slam_winner(comparison: Comparison) -> tuple[str, str]:
    """Matcher whose SLAM error is significantly smaller than that of every other one, and what was tested, in words.

    The runs of a simulated log are paired by seed, each seed being another log. On a recorded log seeds repeat the
    same drive: they show the matcher's own randomness, and no test can make more of them.
    """
    rows = {
        m.label: {r.seed: e for r in m.runs if (e := slam_error(r)) is not None} for m in comparison.matchers
    }
    rows = {label: errors for label, errors in rows.items() if errors}
    level = _level(comparison)
    pairs = list(combinations(rows, 2))
    seeds = min((len(rows[one].keys() & rows[other].keys()) for one, other in pairs), default=0)
    if comparison.dataset.kind != "simulated":
        return (
            "",
            "No winner is marked: seeds repeat the same drive, they show the matcher's own randomness only.",
        )
    if not pairs or len(pairs) * 2.0 ** (1 - seeds) >= level:
        return "", "No winner is marked: with so few runs no paired test can be significant."
    tests = []
    for one, other in pairs:
        shared = sorted(rows[one].keys() & rows[other].keys(), key=str)
        tests.append(signed_rank([rows[one][s] for s in shared], [rows[other][s] for s in shared]))
    better: dict[str, int] = dict.fromkeys(rows, 0)
    for (one, other), test, p in zip(pairs, tests, holm([test.p for test in tests]), strict=True):
        if p < level and test.effect:
            better[one if test.effect < 0.0 else other] += 1
    winner = next((label for label, wins in better.items() if wins == len(rows) - 1), "")
    return winner, (
        f"★: a smaller error than every other matcher by Wilcoxon's signed rank test, paired by seed, Holm's "
        f"correction over {len(pairs)} tests, p < {level:.2g}."
        if winner
        else "No winner is marked: none is significantly better than every other (signed rank test, paired by seed)."
    )


def slam_error(run: SlamOutcome) -> float | None:
    """The error that runs are ranked by (m): of the relations where there are some, else the absolute one."""
    if run.accuracy.relations is not None:
        return run.accuracy.relations["translation_mean_m"]
    return run.accuracy.ate["translation_rmse_m"] if run.accuracy.ate is not None else None


def _level(comparison: Comparison) -> float:
    trials = comparison.config.get("trials", {})
    return 1.0 - float(trials.get("confidence", 0.95))


def unbeaten(found: list[Duel], measure: Measure) -> list[str]:
    """Labels than which no other matcher is significantly better by a measure."""
    of_measure = [duel for duel in found if duel.measure == measure]
    beaten = {duel.second if duel.better == duel.first else duel.first for duel in of_measure if duel.better}
    labels = dict.fromkeys(name for duel in of_measure for name in (duel.first, duel.second))
    return [label for label in labels if label not in beaten]


def decidable(found: list[Duel]) -> bool:
    """Whether there are trials enough for any difference to be significant, however large it is.

    The smallest p of either test is that of N trials which all speak for the same matcher: 2^(1 - N).
    """
    most = max((duel.test.count for duel in found), default=0)
    enough = bool(found) and len(found) * 2.0 ** (1 - most) < found[0].level
    return enough or any(duel.better for duel in found)


def succeeded(trials: MatcherTrials) -> NDArray[np.bool_]:
    """Which trials succeeded by the first definition, (T,)."""
    definition, data = trials.successes[0], trials.data
    near = (np.array(data.displacement_m) < definition.displacement_limit_m) & (
        np.array(data.rotation_deg) < definition.rotation_limit_deg
    )
    answered = np.array([not failure for failure in data.failure], dtype=np.bool_)
    return np.asarray(near & answered, dtype=np.bool_)


_VALUES: dict[Measure, Callable[[MatcherTrials], NDArray[np.float64]]] = {
    "success": lambda trials: succeeded(trials).astype(np.float64),
    "displacement": lambda trials: np.array(trials.data.displacement_m, dtype=np.float64),
    "rotation": lambda trials: np.array(trials.data.rotation_deg, dtype=np.float64),
    "time": lambda trials: np.array(trials.data.seconds, dtype=np.float64),
}


def _test(one: MatcherTrials, other: MatcherTrials, measure: Measure) -> PairedTest:
    # A matcher may lack a seed that failed; what is left of both is still the same trials in the same order.
    shared = set(one.data.seed) & set(other.data.seed)
    first, second = (
        _VALUES[measure](trials)[np.isin(trials.data.seed, list(shared))] for trials in (one, other)
    )
    return mcnemar(first, second) if measure == "success" else signed_rank(first, second)
