"""Confidence intervals: they cover, they repeat, they behave at the ends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binomtest

from hsslam_eval.statistics import bootstrap_interval, wilson_interval


@pytest.mark.parametrize("statistic", ["mean", "median"])
def test_bootstrap_covers_the_truth_about_as_often_as_it_says(statistic: str) -> None:
    rng = np.random.default_rng(1)
    true = 1.0 if statistic == "mean" else math.log(2.0)
    covered = 0
    for run in range(300):
        sample = rng.exponential(size=80)
        interval = bootstrap_interval(sample, statistic, seed=run, resamples=400)  # type: ignore[arg-type]
        covered += interval.low <= true <= interval.high
    assert 0.88 <= covered / 300 <= 0.985


@settings(deadline=None, max_examples=30)
@given(values=st.lists(st.floats(0.0, 100.0), min_size=1, max_size=40), seed=st.integers(0, 99))
def test_bootstrap_is_ordered_inside_the_sample_and_repeats(values: list[float], seed: int) -> None:
    found = bootstrap_interval(values, "median", seed=seed, resamples=200)
    assert min(values) <= found.low <= found.high <= max(values)
    assert found.value == np.median(values)
    assert found == bootstrap_interval(values, "median", seed=seed, resamples=200)


def test_bootstrap_narrows_with_the_sample_and_widens_with_the_confidence() -> None:
    sample = np.random.default_rng(2).normal(size=1600)

    def width(size: int, confidence: float = 0.95) -> float:
        found = bootstrap_interval(sample[:size], confidence=confidence)
        return found.high - found.low

    assert width(1600) == pytest.approx(width(100) / 4, rel=0.4)
    assert width(100, 0.99) > width(100, 0.8)


def test_bootstrap_in_batches_is_bootstrap() -> None:
    sample = np.random.default_rng(3).normal(size=30_000)
    found = bootstrap_interval(sample, seed=5, resamples=300)
    assert found.high - found.low == pytest.approx(2 * 1.96 / math.sqrt(30_000), rel=0.3)


def test_bootstrap_of_nothing_and_of_one() -> None:
    assert math.isnan(bootstrap_interval([]).value)
    one = bootstrap_interval([2.5])
    assert (one.value, one.low, one.high) == (2.5, 2.5, 2.5)


@settings(deadline=None, max_examples=50)
@given(trials=st.integers(1, 2000), share=st.floats(0.0, 1.0), confidence=st.sampled_from([0.8, 0.95, 0.99]))
def test_wilson_is_scipys(trials: int, share: float, confidence: float) -> None:
    successes = round(share * trials)
    found = wilson_interval(successes, trials, confidence)
    expected = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    assert found.low == pytest.approx(expected.low, abs=1e-12)
    assert found.high == pytest.approx(expected.high, abs=1e-12)
    assert found.low <= found.value <= found.high


def test_wilson_without_trials_knows_nothing() -> None:
    found = wilson_interval(0, 0)
    assert math.isnan(found.value)
    assert (found.low, found.high) == (0.0, 1.0)
    with pytest.raises(ValueError, match="3 successes in 2 trials"):
        wilson_interval(3, 2)
