"""Answers that fit badly and deny odometry, told by a matcher that gives no other."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from conftest import room_scan_at
from numpy.typing import NDArray

from hsslam.config import TrackerSection
from hsslam.matching import Estimate, Matcher, MatcherConfig
from hsslam.matching.interface import Reference, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose
from hsslam.slam.expectation import Expectation
from hsslam.slam.locator import Locator
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import GrowingSubmap

WRONG = np.array([0.0, 0.0, math.radians(6.0)])


class Stubborn(Matcher[MatcherConfig]):
    """Answers the same pose, whatever it is asked, and is sure of it."""

    def __init__(self, answer: Pose) -> None:
        super().__init__(MatcherConfig())
        self._answer = answer

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        return Estimate(self._answer.copy(), covariance=np.diag([1e-6, 1e-6, 1e-6]))


def located(answer: Pose, usual: float) -> MatchResult:
    """A scan of the room from where odometry says that it is, found by a stubborn matcher."""
    matcher: Matcher[Any] = Stubborn(answer)
    submap = GrowingSubmap(matcher, room_scan_at(np.zeros(3), beams=361).robot_points, np.zeros(3))
    expected = Expectation(
        pose=np.zeros(3),
        covariance=np.diag([0.01, 0.01, 0.02]) ** 2,
        repeated=np.zeros(3),
        told=True,
        leaps=False,
        score=usual,
    )
    points = room_scan_at(np.zeros(3), beams=361, noise=0.005, seed=1).robot_points
    rng = np.random.default_rng(0)
    return Locator(TrackerSection(), matcher, submap, points, rng, Stopwatch()).locate(expected)


def deviations(result: MatchResult) -> NDArray[np.float64]:
    return np.asarray(np.sqrt(np.diag(result.covariance)))


def test_an_answer_that_fits_badly_and_denies_odometry_is_not_sure() -> None:
    found = located(WRONG, usual=0.95)
    assert found.score < 0.8
    assert deviations(found)[2] == pytest.approx(abs(WRONG[2]), rel=0.05)


def test_an_answer_that_fits_as_ever_may_deny_odometry() -> None:
    usual = located(WRONG, usual=0.0).score
    assert deviations(located(WRONG, usual))[2] < 0.01


def test_an_answer_that_fits_badly_where_odometry_has_it_stays_sure() -> None:
    near = np.array([0.0, 0.0, math.radians(1.5)])
    assert deviations(located(near, usual=1.3))[2] < 0.01
