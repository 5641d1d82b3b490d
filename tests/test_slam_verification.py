"""Which loops are believed, and when."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hsslam.config import LoopSection
from hsslam.se2 import Poses, between, compose, pose
from hsslam.slam.events import LoopChecked
from hsslam.slam.fusion import GATE
from hsslam.slam.verification import COMPARABLE_GAP, OUTVOTED, LoopVerifier, agree

RULES = LoopSection()
TRUTH: Poses = np.array([pose(0.3 * i, 0.1 * (i % 7), 0.05 * (i % 5)) for i in range(300)])
DRIFT = pose(0.8, -0.5, 0.1)
"""Error of the estimate that separates late keyframes from early ones: loops are a surprise."""
ESTIMATE: Poses = np.array([p if i < 150 else compose(DRIFT, p) for i, p in enumerate(TRUTH)])


def loop(first: int, second: int, **told: object) -> LoopChecked:
    """A true loop that the graph did not foresee, unless told otherwise."""
    fields: dict[str, object] = {
        "accepted": False,
        "reason": "",
        "relative": between(TRUTH[first], TRUTH[second]),
        "covariance": 1e-4 * np.eye(3),
        "score": 0.9,
        "evaluations": 1,
        "expected_std": 0.3,
        "surprise": 100.0,
        **told,
    }
    return LoopChecked(first, second, **fields)  # type: ignore[arg-type]


def verifier(
    ambiguity: Callable[[LoopChecked], float] = lambda _: 0.0, rules: LoopSection = RULES
) -> LoopVerifier:
    return LoopVerifier(rules, ambiguity)


def test_a_foreseen_loop_is_accepted_at_once() -> None:
    (found,) = verifier().judge(loop(10, 200, expected_std=0.9 * RULES.expected_std, surprise=1.0), ESTIMATE)
    assert found.accepted
    assert (found.first, found.second) == (10, 200)


def test_a_loop_whose_match_is_bad_is_refused_at_once() -> None:
    bad = loop(10, 200, reason="score 0.10 below 0.60", expected_std=0.0, surprise=0.0)
    (found,) = verifier().judge(bad, ESTIMATE)
    assert not found.accepted
    assert found.reason == bad.reason


@pytest.mark.parametrize(
    ("expected_std", "surprise"),
    [(1.1 * RULES.expected_std, 1.0), (0.5 * RULES.expected_std, 1.01 * GATE)],
)
def test_unforeseen_loops_wait_until_three_agree(expected_std: float, surprise: float) -> None:
    judge = verifier()
    first, second, third = (
        loop(10 + k, 200 + k, expected_std=expected_std, surprise=surprise) for k in range(3)
    )
    assert judge.judge(first, ESTIMATE) == []
    assert judge.judge(second, ESTIMATE) == []
    found = judge.judge(third, ESTIMATE)
    assert [(f.first, f.second) for f in found] == [(10, 200), (11, 201), (12, 202)]
    assert all(f.accepted and f.agreeing >= 2 and not f.reason for f in found)
    assert judge.close() == []


def test_loops_believed_a_moment_ago_count_as_companions() -> None:
    judge = verifier()
    for k in range(2):
        judge.judge(loop(10 + k, 200 + k, expected_std=0.01, surprise=0.0), ESTIMATE)
    (found,) = judge.judge(loop(14, 204), ESTIMATE)
    assert found.accepted
    assert found.agreeing == 2


def test_false_loops_that_do_not_agree_are_never_accepted(rng: np.random.Generator) -> None:
    judge = verifier()
    for k in range(10):
        elsewhere = pose(*rng.uniform([-3.0, -3.0, -3.1], [3.0, 3.0, 3.1]))
        assert judge.judge(loop(10 + k, 200 + k, relative=elsewhere), ESTIMATE) == []
    found = judge.close()
    assert len(found) == 10
    assert all(not f.accepted and "agree" in f.reason for f in found)


def test_a_false_loop_does_not_ride_on_true_ones() -> None:
    judge = verifier()
    false = loop(10, 200, relative=compose(between(TRUTH[10], TRUTH[200]), pose(0.5, 0.0, 0.0)))
    assert judge.judge(false, ESTIMATE) == []
    found = [f for k in range(1, 4) for f in judge.judge(loop(10 + k, 200 + k), ESTIMATE)]
    assert [f.first for f in found] == [11, 12, 13]
    (left,) = judge.close()
    assert left.first == 10
    assert left.reason == "0 other loops agree with it, not 2"


def test_an_ambiguous_loop_is_refused_with_its_companions() -> None:
    asked: list[int] = []

    def ambiguity(asked_for: LoopChecked) -> float:
        asked.append(asked_for.first)
        return 1.2 * RULES.max_ambiguity

    judge = verifier(ambiguity)
    assert [f for k in range(3) for f in judge.judge(loop(10 + k, 200 + k), ESTIMATE)] == []
    assert asked == [12]
    found = judge.close()
    assert not any(f.accepted for f in found)
    assert found[-1].reason.startswith("ambiguous: another pose scores 1.14")


@pytest.mark.parametrize(("expected_std", "enough"), [(0.33, 3), (0.66, 5), (2.64, 9)])
def test_the_wider_the_search_the_more_loops_must_agree(expected_std: float, enough: int) -> None:
    judge = verifier()
    told = [judge.judge(loop(10 + k, 200 + k, expected_std=expected_std), ESTIMATE) for k in range(enough)]
    assert [len(found) for found in told] == [0] * (enough - 1) + [enough]


def test_a_refused_far_loop_says_how_many_would_have_been_enough() -> None:
    judge = verifier()
    judge.judge(loop(10, 200, expected_std=1.32), ESTIMATE)
    (found,) = judge.close()
    assert found.reason == "0 other loops agree with it, not 6"


def test_many_loops_outvote_an_ambiguity() -> None:
    """Along a corridor any shift explains most points; a dozen keyframes that all say the same are not chance."""
    judge = verifier(lambda _: 1.0)
    enough = 1 + OUTVOTED * RULES.agreeing
    told = [judge.judge(loop(10 + k, 200 + k), ESTIMATE) for k in range(enough)]
    assert not any(told[:-1])
    assert len(told[-1]) == enough


def test_loops_that_more_others_contradict_wait() -> None:
    judge = verifier(lambda asked_for: 1.0 if asked_for.second < 206 else 0.0)
    for k in range(6):
        assert judge.judge(loop(10 + k, 200 + k), ESTIMATE) == []  # ambiguous, but there are six of them
    for k in range(6, 9):
        shifted = between(TRUTH[10 + k], compose(pose(2.8, 0.0, 0.0), TRUTH[200 + k]))
        assert judge.judge(loop(10 + k, 200 + k, relative=shifted), ESTIMATE) == []
    reasons = {found.second: found.reason for found in judge.close()}
    assert reasons[208] == "2 other loops agree with it, but as many with one that contradicts it"


def test_waiting_ends_after_patience_with_a_reason() -> None:
    judge = verifier()
    judge.judge(loop(10, 200), ESTIMATE)
    assert judge.expire(200 + RULES.patience) == []
    (found,) = judge.expire(201 + RULES.patience)
    assert not found.accepted
    assert found.reason == "0 other loops agree with it, not 2"
    assert judge.close() == []


def test_no_companions_needed_where_the_rules_ask_for_none() -> None:
    judge = verifier(rules=LoopSection(agreeing=0))
    (found,) = judge.judge(loop(10, 200), ESTIMATE)
    assert found.accepted


def test_agreement_is_symmetric_and_only_between_loops_near_in_time() -> None:
    a, b = loop(10, 200), loop(14, 207)
    assert agree(a, b, ESTIMATE)
    assert agree(b, a, ESTIMATE)
    assert not agree(a, loop(12, 200), ESTIMATE)  # same scan: the same mistake twice
    assert not agree(a, loop(10, 201 + COMPARABLE_GAP), ESTIMATE)
    assert not agree(loop(80, 200), loop(80 - COMPARABLE_GAP - 1, 201), ESTIMATE)
    turned = compose(between(TRUTH[14], TRUTH[207]), pose(0.0, 0.0, 0.06))
    assert not agree(a, loop(14, 207, relative=turned), ESTIMATE)
