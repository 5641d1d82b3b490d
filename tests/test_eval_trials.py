"""Trials: a matcher that is right, off, or raises, as it is told; the same guesses for all."""

from __future__ import annotations

import json
import math
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydantic import ValidationError

from hsslam.errors import DataError
from hsslam.matching import Estimate, Matcher, MatcherConfig, Reference, SearchWindow, create, register
from hsslam.se2 import Points, Pose, inverse, pose, transform
from hsslam_eval.trial_config import SuccessThreshold
from hsslam_eval.trials import TrialConfig, TrialPair, TrialResult, run_trial, run_trials, trial_guess

SQUARE = np.vstack([np.column_stack((np.linspace(0, 4, 41), np.full(41, y))) for y in (0.0, 3.0)])


class OracleConfig(MatcherConfig):
    """How far off the oracle is, and when it fails."""

    shift: float = 0.0
    turn: float = 0.0
    raise_every: int = 0


class Oracle(Matcher[OracleConfig]):
    """Knows which of its points is which, so it finds the truth, then errs as told."""

    Config: ClassVar[type[MatcherConfig]] = OracleConfig
    calls: ClassVar[list[tuple[Pose, float]]] = []

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        Oracle.calls.append((guess, rng.random()))
        if self.config.raise_every and len(Oracle.calls) % self.config.raise_every == 0:
            raise RuntimeError("no luck")
        a, b = points[:2]
        c, d = reference.points[:2]
        theta = math.atan2(*(d - c)[::-1]) - math.atan2(*(b - a)[::-1])
        turned = transform(pose(0.0, 0.0, theta), a[None])[0]
        found = pose(c[0] - turned[0] + self.config.shift, c[1] - turned[1], theta + self.config.turn)
        return Estimate(found, evaluations=7)


register("test_eval_oracle", Oracle)


def pairs(count: int, seed: int = 0) -> list[TrialPair]:
    rng = np.random.default_rng(seed)
    truths = rng.uniform([-0.5, -0.5, -3.1], [0.5, 0.5, 3.1], (count, 3))
    return [
        TrialPair(SQUARE, transform(inverse(truth), SQUARE), truth, "split", i, i)
        for i, truth in enumerate(truths)
    ]


def run(count: int = 12, config: TrialConfig | None = None, **parameters: Any) -> TrialResult:
    Oracle.calls.clear()
    config = config or TrialConfig(warm_up=0, resamples=200)
    return run_trials("oracle", create("test_eval_oracle", parameters), pairs(count), config)


def test_a_perfect_matcher_succeeds_in_every_trial() -> None:
    result = run()
    assert len(result) == 12
    assert result.displacement.max() < 1e-9
    assert result.rotation.max() < 1e-9
    assert result.initial_displacement.min() > 1e-6
    assert result.score.min() == 1.0
    assert (result.seconds > 0).all()
    assert (result.prepare_seconds > 0).all()
    assert result.converged.all()
    summary = result.summary()
    assert summary.protocol == "split"
    assert (summary.trials, summary.seed, summary.evaluations_mean, summary.failures) == (12, 0, 7.0, {})
    for success in summary.success.values():
        assert success.successes == 12
        assert success.ratio.value == 1.0
        assert 0.7 < success.ratio.low < 1.0
        assert success.displacement_m.mean.value < 1e-9


def test_thresholds_are_told_apart_and_errors_are_over_successes_and_over_all() -> None:
    config = TrialConfig(warm_up=0, resamples=200, half_xy=0.5, half_theta_deg=20.0)
    summary = run(config=config, shift=0.03, turn=math.radians(1.5)).summary()
    assert {name: success.successes for name, success in summary.success.items()} == {
        "glasm": 0,
        "10cm_2deg": 12,
        "5cm_1deg": 0,
    }
    for spread in (summary.success["10cm_2deg"].displacement_m, summary.displacement_m):
        assert spread.count == 12
        assert spread.mean.value == pytest.approx(0.03)
        assert spread.median.value == pytest.approx(0.03)
    assert summary.rotation_deg.mean.value == pytest.approx(1.5)
    assert summary.success["glasm"].displacement_m.count == 0
    assert math.isnan(summary.success["glasm"].displacement_m.mean.value)


def test_a_matcher_that_raises_loses_that_trial_only() -> None:
    result = run(raise_every=3)
    failed = ~result.answered
    assert failed.tolist() == [False, False, True] * 4
    assert result.failures[2] == "RuntimeError: no luck"
    np.testing.assert_array_equal(result.displacement[failed], result.initial_displacement[failed])
    np.testing.assert_array_equal(result.rotation[failed], result.initial_rotation[failed])
    assert np.isnan(result.seconds[failed]).all()
    assert np.isfinite(result.seconds[~failed]).all()
    summary = result.summary()
    assert summary.failures == {"RuntimeError: no luck": 4}
    assert summary.success["glasm"].successes == 8
    assert summary.evaluations_mean == 7.0
    assert math.isfinite(summary.match_seconds_median)


def test_no_answer_is_no_success_however_good_the_guess() -> None:
    generous = (SuccessThreshold(name="anything", displacement=10.0, rotation=3.2),)
    config = TrialConfig(warm_up=0, resamples=200, thresholds=generous)
    raised = run(config=config, raise_every=1)
    assert raised.summary().success["anything"].successes == 0
    assert raised.summary().to_dict()["match_seconds_median"] is None
    rejected = run(config=config, shift=5.0)
    assert rejected.failures[0] == "the answer left the search window"
    assert np.isfinite(rejected.seconds).all()
    assert rejected.summary().success["anything"].successes == 0


def test_every_matcher_gets_the_same_guesses_and_random_numbers() -> None:
    config = TrialConfig(warm_up=2, seed=5, resamples=200)
    heard: list[list[tuple[Pose, float]]] = []
    for shift in (0.0, 0.02):
        run(config=config, shift=shift)
        heard.append(Oracle.calls[2:])
    for (guess, number), (other, again) in zip(*heard, strict=True):
        np.testing.assert_array_equal(guess, other)
        assert number == again
    assert len({number for _, number in heard[0]}) == 12
    run(config=TrialConfig(warm_up=0, seed=6))
    assert not np.allclose(Oracle.calls[0][0], heard[0][0][0])


def test_a_trial_depends_on_its_number_not_on_the_trials_before_it() -> None:
    config, found = TrialConfig(warm_up=0), run(shift=0.01)
    alone = run_trial(create("test_eval_oracle", {"shift": 0.01}), pairs(12)[7], config, 7)
    assert alone.displacement == found.displacement[7]
    assert alone.initial_displacement == found.initial_displacement[7]


@settings(deadline=None, max_examples=50)
@given(
    trial=st.integers(0, 10**6),
    theta=st.floats(-math.pi, math.pi, exclude_max=True),
    half_xy=st.floats(1e-3, 2.0),
    half_theta_deg=st.floats(0.1, 179.0),
)
def test_the_truth_is_always_within_the_window_of_the_guess(
    trial: int, theta: float, half_xy: float, half_theta_deg: float
) -> None:
    config = TrialConfig(half_xy=half_xy, half_theta_deg=half_theta_deg)
    truth = np.array([1.0, -2.0, theta])
    guess = trial_guess(truth, config, trial)
    assert config.window.contains(guess, truth)
    assert -math.pi <= guess[2] < math.pi


def test_guesses_fill_the_box_evenly() -> None:
    config = TrialConfig()
    guesses = np.array([trial_guess(np.zeros(3), config, trial) for trial in range(2000)])
    scaled = guesses / config.window.half
    assert np.abs(scaled).max() <= 1.0
    np.testing.assert_allclose(scaled.mean(axis=0), 0.0, atol=0.05)
    np.testing.assert_allclose(scaled.std(axis=0), 1 / math.sqrt(3), atol=0.03)
    assert np.abs(np.corrcoef(scaled.T) - np.eye(3)).max() < 0.08


def test_warm_up_does_not_count_and_progress_is_told() -> None:
    Oracle.calls.clear()
    told: list[tuple[int, int]] = []
    result = run_trials(
        "oracle",
        create("test_eval_oracle"),
        pairs(3),
        TrialConfig(warm_up=5),
        lambda done, total: told.append((done, total)),
    )
    assert len(Oracle.calls) == 8
    assert len(result) == 3
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_the_summary_and_the_columns_can_be_written() -> None:
    result = run(raise_every=5)
    again = json.loads(json.dumps(result.summary().to_dict(), allow_nan=False))
    assert again["success"]["glasm"]["ratio"]["value"] == pytest.approx(10 / 12)
    columns: dict[str, NDArray[Any]] = result.columns()
    assert {len(column) for column in columns.values()} == {12}
    assert result.summary() == result.summary()


def test_bad_settings_and_no_pairs_are_refused() -> None:
    with pytest.raises(DataError, match="no pairs"):
        run_trials("oracle", create("test_eval_oracle"), [], TrialConfig())
    twice = SuccessThreshold(name="a", displacement=1.0, rotation=1.0)
    with pytest.raises(ValidationError, match="different names"):
        TrialConfig(thresholds=(twice, twice))
    with pytest.raises(ValidationError):
        TrialConfig.model_validate({"cuont": 3})
