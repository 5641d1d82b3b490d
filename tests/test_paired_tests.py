"""Paired tests: against tables and formulas worked by hand, and their symmetries."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hsslam_eval.paired_tests import holm, mcnemar, signed_rank

FINITE = st.floats(-1e3, 1e3, allow_nan=False).map(lambda value: round(value, 3))


def test_signed_rank_by_hand() -> None:
    # Differences 1, 2, 3, -4, 5: ranks of the positive ones 1 + 2 + 3 + 5 = 11, of the negative one 4.
    found = signed_rank([1.0, 2.0, 3.0, 0.0, 5.0], [0.0, 0.0, 0.0, 4.0, 0.0])
    assert found.effect == pytest.approx((11.0 - 4.0) / 15.0)
    assert (found.count, found.wins, found.losses, found.difference) == (5, 4, 1, 2.0)
    # Of the 32 signs of five ranks, ten give a sum of at most 4, and as many at least 11: p = 14 / 32.
    sums = [sum(rank for rank in range(1, 6) if signs >> (rank - 1) & 1) for signs in range(32)]
    assert found.p == pytest.approx(2.0 * sum(total <= 4 for total in sums) / 32.0)


def test_mcnemar_by_hand() -> None:
    # Decided nine to one: p = 2 (C(10,0) + C(10,1)) / 2^10.
    first = [True] * 9 + [False] + [True] * 20
    second = [False] * 9 + [True] + [True] * 20
    found = mcnemar(first, second)
    assert found.p == pytest.approx(2.0 * 11.0 / 1024.0)
    assert (found.wins, found.losses, found.effect) == (9, 1, pytest.approx(0.8))
    assert found.difference == pytest.approx(8.0 / 30.0)


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == pytest.approx([1.0, 1.0])
    assert len(holm([])) == 0


@settings(max_examples=30, deadline=None)
@given(arrays(np.float64, 20, elements=FINITE), arrays(np.float64, 20, elements=FINITE))
def test_swapping_the_two_changes_signs_only(first: np.ndarray, second: np.ndarray) -> None:
    one, other = signed_rank(first, second), signed_rank(second, first)
    assert one.p == pytest.approx(other.p)
    assert one.effect == pytest.approx(-other.effect)
    assert (one.wins, one.losses) == (other.losses, other.wins)
    one, other = mcnemar(first > 0, second > 0), mcnemar(second > 0, first > 0)
    assert one.p == pytest.approx(other.p) and one.difference == pytest.approx(-other.difference)


@given(st.lists(st.floats(0.0, 1.0), max_size=20))
def test_holm_only_raises_and_keeps_the_order(values: list[float]) -> None:
    corrected = holm(values)
    assert all(new >= old and new <= 1.0 for new, old in zip(corrected, values, strict=True))
    assert all(np.diff(corrected[np.argsort(values, kind="stable")]) >= 0.0)
    # Bonferroni's correction is never milder.
    assert all(new <= min(1.0, len(values) * old) + 1e-12 for new, old in zip(corrected, values, strict=True))


def test_nothing_to_tell_apart() -> None:
    same = signed_rank([1.0, 2.0], [1.0, 2.0])
    assert (same.p, same.effect) == (1.0, 0.0)
    missing = signed_rank([math.nan, math.nan], [1.0, 2.0])
    assert (missing.count, missing.p) == (0, 1.0) and math.isnan(missing.difference)
    assert mcnemar([True, False], [True, False]).p == 1.0


def test_noise_alone_is_seldom_significant() -> None:
    rng = np.random.default_rng(0)
    p = [signed_rank(*rng.normal(size=(2, 40))).p for _ in range(400)]
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09
