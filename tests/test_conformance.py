"""The built-in matchers keep every promise; matchers that break one fail the check that is named after it."""

from __future__ import annotations

import time

import numpy as np
import pytest
from pydantic import ConfigDict, Field

from hsslam.errors import MatcherUnavailableError
from hsslam.matching import Estimate, MatchResult, create
from hsslam.matching.conformance import check_matcher, conformance_checks, parametrize_with_checks
from hsslam_plugins.hide import Hide, HideConfig

CHECKS = dict(conformance_checks())


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize(
    "name", ["csm", "exhaustive", "glasm", "hide", "hsl", "icp", "kiss_icp", "pl_icp", "small_gicp"]
)
def test_built_in_matchers_conform(name: str, check: str) -> None:
    try:
        matcher = create(name)
    except MatcherUnavailableError as error:
        pytest.skip(str(error))
    CHECKS[check](matcher)


class Changed(Hide):
    """HIDE with its answer spoilt by ``spoil``."""

    summary = "HIDE, spoilt"

    def estimate(self, reference, points, guess, window, rng):
        return self.spoil(super().estimate(reference, points, guess, window, rng), guess)

    def spoil(self, found, guess):
        return found


class Lazy(Changed):
    def spoil(self, found, guess):
        return Estimate(guess)


class NeverSays(Changed):
    def spoil(self, found, guess):
        return Estimate(found.pose, diagnostics={"pose": found.pose})


class Unseeded(Changed):
    def spoil(self, found, guess):
        return Estimate(found.pose + np.random.default_rng().normal(0.0, 1e-5, 3))


class Remembers(Changed):
    calls = 0

    def spoil(self, found, guess):
        self.calls += 1
        return Estimate(found.pose + 1e-6 * self.calls)


class Centimetres(Changed):
    def spoil(self, found, guess):
        return Estimate(found.pose, covariance=np.diag((100.0, 100.0, 1e-4)))


class Lopsided(Changed):
    def spoil(self, found, guess):
        return Estimate(found.pose, covariance=1e-4 * np.array([[1.0, 0.5, 0], [0, 1.0, 0], [0, 0, 1.0]]))


class Certain(Changed):
    def spoil(self, found, guess):
        return Estimate(found.pose, covariance=np.zeros((3, 3)))


class TiedToItsFrame(Changed):
    def spoil(self, found, guess):
        return Estimate(found.pose + (0.08 * (np.abs(guess[:2]).max() > 2.0), 0.0, 0.0))


class Scribbler(Changed):
    def estimate(self, reference, points, guess, window, rng):
        found = super().estimate(reference, points, guess, window, rng)
        points[0] += 1e-9
        return found


class NotReentrant(Changed):
    def estimate(self, reference, points, guess, window, rng):
        self.guess = guess
        time.sleep(0.002)
        return super().estimate(reference, points, self.guess, window, rng)


class Unpicklable(Changed):
    def __init__(self, config=None):
        super().__init__(config)
        self.callback = lambda: None


class Unpicked(Changed):
    """Falls over where points fix no pose."""

    def estimate(self, reference, points, guess, window, rng):
        np.linalg.inv(np.cov(points.T))
        if np.linalg.matrix_rank(points - points[0], tol=1e-6) < 2:
            raise np.linalg.LinAlgError("singular")
        return super().estimate(reference, points, guess, window, rng)


class NoSummary(Changed):
    summary = ""


class LooseConfig(HideConfig):
    model_config = ConfigDict(extra="ignore")


class Loose(Changed):
    Config = LooseConfig


class UndescribedConfig(HideConfig):
    colour: int = Field(3)


class Undescribed(Changed):
    Config = UndescribedConfig


class OwnMatch(Hide):
    """Overrides `match`, which plugins must not, and changes the result."""

    summary = "overrides match"

    def match(self, reference, points, guess, window, rng):
        return self.change(super().match(reference, points, guess, window, rng), guess)


class Unwrapped(OwnMatch):
    def change(self, result, guess):
        return MatchResult(
            result.pose + (0.0, 0.0, 2.0 * np.pi),
            result.covariance,
            result.score,
            result.converged,
            result.evaluations,
        )


class Boastful(OwnMatch):
    def change(self, result, guess):
        return MatchResult(result.pose, result.covariance, 1.5, result.converged, 0)


class SinglePrecision(OwnMatch):
    def change(self, result, guess):
        pose = result.pose.astype(np.float32)
        return MatchResult(pose, result.covariance, result.score, result.converged, 0)


class Wanderer(OwnMatch):
    def change(self, result, guess):
        off = result.pose + (0.5, 0.0, 0.0)
        return MatchResult(off, result.covariance, result.score, result.converged, 0)


class AlwaysConverges(OwnMatch):
    def change(self, result, guess):
        return MatchResult(result.pose, result.covariance, result.score, True, result.evaluations)


class MatchesAnything(Hide):
    """Checks and cleans nothing."""

    summary = "overrides match"

    def match(self, reference, points, guess, window, rng):
        points = np.nan_to_num(np.resize(np.asarray(points, dtype=np.float64), (200, 2)))
        return super().match(reference, points, np.resize(np.nan_to_num(guess), 3), window, rng)


class ContiguousOnly(Hide):
    """Reads the memory of its points as if it were contiguous."""

    summary = "overrides match"

    def match(self, reference, points, guess, window, rng):
        flat = points if points.base is None or points.flags.c_contiguous else points.base
        flat = np.ascontiguousarray(flat.T if flat.shape[0] == 2 else flat)
        return super().match(reference, flat.reshape(-1, 2), guess, window, rng)


class ManyOthers(Hide):
    """Answers to several scans in the order of their lengths."""

    summary = "overrides match_many"

    def match_many(self, reference, scans, guesses, window, rng):
        order = np.argsort([len(scan) for scan in scans], kind="stable")
        return super().match_many(reference, [scans[i] for i in order], guesses[order], window, rng)


class ManyFewer(Hide):
    """Leaves out what did not converge."""

    summary = "overrides match_many"

    def match_many(self, reference, scans, guesses, window, rng):
        found = super().match_many(reference, scans, guesses, window, rng)
        return found.only(found.converged)


class Forgets(Hide):
    """Knows the newest scan only."""

    summary = "overrides extend"

    def extend(self, reference, points):
        return self.prepare(points)


class Misplaces(Hide):
    """Adds every scan a little further away."""

    summary = "overrides extend"

    def extend(self, reference, points):
        return super().extend(reference, points + 0.1 * (1.0 + len(reference.points) / 90.0))


BAD = [
    (Forgets, "extend"),
    (Misplaces, "extend"),
    (ManyOthers, "many"),
    (ManyFewer, "many"),
    (Lazy, "accuracy"),
    (NeverSays, "result_types"),
    (SinglePrecision, "result_types"),
    (Unseeded, "determinism"),
    (Remembers, "determinism"),
    (Centimetres, "covariance"),
    (Lopsided, "covariance"),
    (Certain, "covariance"),
    (TiedToItsFrame, "frame_invariance"),
    (Scribbler, "inputs_untouched"),
    (NotReentrant, "threads"),
    (Unpicklable, "pickle"),
    (Unpicked, "degenerate_points"),
    (NoSummary, "summary"),
    (Loose, "config"),
    (Undescribed, "config"),
    (Unwrapped, "theta_range"),
    (Boastful, "score"),
    (Wanderer, "window"),
    (AlwaysConverges, "too_few_points"),
    (MatchesAnything, "not_finite_rows"),
    (MatchesAnything, "wrong_shapes"),
    (ContiguousOnly, "array_layouts"),
]


def test_the_unspoilt_base_of_the_bad_matchers_conforms() -> None:
    check_matcher(Changed)


def test_every_check_is_shown_to_fail() -> None:
    assert {check for _, check in BAD} == set(CHECKS)


@pytest.mark.parametrize(("matcher", "check"), BAD, ids=lambda case: getattr(case, "__name__", case))
def test_a_bad_matcher_fails_the_right_check(matcher: type[Hide], check: str) -> None:
    others = set(CHECKS) - {check}
    with pytest.raises(
        AssertionError, match=rf"{matcher.__name__} fails 1 conformance check\(s\):\n{check}: ."
    ):
        check_matcher(matcher, exempt=others)


def test_one_flaw_does_not_fail_unrelated_checks() -> None:
    check_matcher(NoSummary, exempt=["summary"])
    check_matcher(Loose, exempt=["config"])
    check_matcher(NotReentrant, exempt=["threads"])


def test_all_failures_are_told_at_once() -> None:
    with pytest.raises(AssertionError) as caught:
        check_matcher(Boastful(), exempt=())
    assert "score: " in str(caught.value)
    assert "too_few_points: " in str(caught.value)


def test_instances_classes_and_names_are_taken() -> None:
    everything = set(CHECKS) - {"config", "summary"}
    check_matcher(Hide(HideConfig(memory_size=12)), exempt=everything)
    check_matcher(Hide, exempt=everything)
    check_matcher("hide", exempt=everything)


def test_an_exemption_that_names_no_check_is_an_error() -> None:
    with pytest.raises(ValueError, match="determinsm"):
        check_matcher(Hide, exempt=["determinsm"])


@parametrize_with_checks([Hide])
def test_parametrize_with_checks_gives_one_test_per_promise(matcher, check) -> None:
    assert isinstance(matcher, Hide)
    assert check in CHECKS.values()


class NotFinite(Hide):
    summary = "never finds anything"

    def estimate(self, reference, points, guess, window, rng):
        return Estimate(np.full(3, np.nan))


def test_answers_that_are_rejected_are_called_so() -> None:
    with pytest.raises(AssertionError, match="answers were rejected: the answer is not finite"):
        check_matcher(NotFinite(), exempt=["score"])
