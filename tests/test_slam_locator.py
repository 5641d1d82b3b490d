"""Which of two answers is believed, told by a matcher that gives just these two."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import room_scan_at
from numpy.typing import NDArray

from hsslam.config import TrackerSection
from hsslam.matching.interface import Matcher, MatcherConfig, Reference, SearchWindow
from hsslam.matching.results import Estimate
from hsslam.se2 import Points, Pose, pose, transform
from hsslam.slam.expectation import Expectation
from hsslam.slam.locator import Locator
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import GrowingSubmap

STEADY = pose(0.1, 0.0, 0.0)
POINTS = np.random.default_rng(3).uniform(-9.0, 9.0, (200, 2))


class OneOfTwo(Matcher[MatcherConfig]):
    """Answers with the nearer of two poses."""

    covers_window = True
    leapt: Pose

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        return Estimate(
            min(STEADY, self.leapt, key=lambda answer: float(np.abs(answer - guess).sum())).copy()
        )


def locator_in(known: Points, matcher: OneOfTwo) -> Locator:
    """Of a scan of 200 points in a submap."""
    submap = GrowingSubmap(matcher, known, np.zeros(3))
    return Locator(TrackerSection(), matcher, submap, POINTS, np.random.default_rng(0), Stopwatch())


def located(leapt: NDArray[np.float64], steady_points: int, leapt_points: int) -> Pose:
    """Where a scan is, so many of whose 200 points are explained where it goes on and where odometry says it is."""
    matcher = OneOfTwo()
    matcher.leapt = leapt
    known = np.concatenate(
        (transform(STEADY, POINTS[:steady_points]), transform(leapt, POINTS[:leapt_points]))
    )
    expected = Expectation(
        pose=leapt,
        covariance=np.diag([0.2, 0.2, 0.1]) ** 2,
        repeated=STEADY,
        told=True,
        leaps=True,
        score=0.9,
    )
    return locator_in(known, matcher).locate(expected).pose


@pytest.mark.parametrize(
    ("leapt", "steady_points", "leapt_points", "goes_on"),
    [
        (pose(2.1, 0.0, 0.0), 180, 174, True),
        (pose(2.1, 0.0, 0.0), 170, 180, False),
        (pose(0.6, 0.0, 0.0), 180, 174, False),
        (pose(0.6, 0.0, 0.0), 190, 160, True),
    ],
    ids=["impossible", "impossible but it fits better", "possible", "possible but it fits far less"],
)
def test_the_farther_odometry_leaps_the_less_it_takes_to_go_on(
    leapt: NDArray[np.float64], steady_points: int, leapt_points: int, goes_on: bool
) -> None:
    assert located(leapt, steady_points, leapt_points) == pytest.approx(STEADY if goes_on else leapt)


class RestlessHere(OneOfTwo):
    """Answers with the nearer of two poses, and says of one of them that it did not come to rest there."""

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        found = super().estimate(reference, points, guess, window, rng)
        if window.half_x > 0.5:  # the wide search finds something else
            return Estimate(self.leapt.copy())
        return Estimate(found.pose, converged=bool((found.pose != STEADY).any()))


@pytest.mark.parametrize(
    ("here_points", "elsewhere_points", "stays", "believed"),
    [(190, 198, True, True), (140, 110, True, False), (140, 196, False, True)],
    ids=["fits as ever", "fits worse, elsewhere still less", "fits worse than elsewhere"],
)
def test_what_did_not_come_to_rest_gives_way_only_to_what_fits_better(
    here_points: int, elsewhere_points: int, stays: bool, believed: bool
) -> None:
    matcher = RestlessHere()
    matcher.leapt = elsewhere = pose(0.7, 0.1, 0.2)
    known = np.concatenate(
        (transform(STEADY, POINTS[:here_points]), transform(elsewhere, POINTS[:elsewhere_points]))
    )
    expected = Expectation(
        pose=STEADY,
        covariance=np.diag([0.01, 0.01, 0.02]) ** 2,
        repeated=STEADY,
        told=True,
        leaps=False,
        score=0.95,
    )
    found = locator_in(known, matcher).locate(expected)
    assert found.pose == pytest.approx(STEADY if stays else elsewhere)
    assert found.converged is believed


@pytest.mark.parametrize(("more", "stays"), [(5, True), (11, False)])
def test_of_few_returns_many_have_to_fit_better_elsewhere(more: int, stays: bool) -> None:
    """Six more, of which those that lie on new ground where the first answer is count a third there already."""
    matcher = RestlessHere()
    matcher.leapt = elsewhere = pose(0.7, 0.1, 0.2)
    points = POINTS[:24]
    known = np.concatenate((transform(STEADY, points[:12]), transform(elsewhere, points[: 12 + more])))
    expected = Expectation(
        pose=STEADY,
        covariance=np.diag([0.01, 0.01, 0.02]) ** 2,
        repeated=STEADY,
        told=True,
        leaps=False,
        score=0.95,
    )
    submap = GrowingSubmap(matcher, known, np.zeros(3))
    rng = np.random.default_rng(0)
    found = Locator(TrackerSection(), matcher, submap, points, rng, Stopwatch()).locate(expected)
    assert found.pose == pytest.approx(STEADY if stays else elsewhere)


class Drawn(OneOfTwo):
    """In a window that reaches it, the pose that odometry denies; in a narrow one, a place on the way there."""

    on_the_way: Pose

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        far = bool((np.abs(self.leapt - guess) > window.half).any())
        return Estimate((self.on_the_way if far else self.leapt).copy())


@pytest.mark.parametrize("rests", [False, True], ids=["drawn", "at rest"])
def test_an_answer_near_odometry_has_to_stand_at_a_bottom(rests: bool) -> None:
    """A room's walls, seen from where odometry is 12 cm off; and from where walls fit there as well."""
    walls = room_scan_at(np.zeros(3), beams=360, noise=0.002).points
    matcher = Drawn()
    matcher.leapt, matcher.on_the_way = pose(0.12, 0.0, 0.0), pose(0.035, 0.0, 0.0)
    expected = Expectation(
        pose=np.zeros(3),
        covariance=np.diag([0.01, 0.01, 0.01]) ** 2,
        repeated=np.zeros(3),
        told=True,
        leaps=False,
        score=0.9,
    )
    known = transform(matcher.leapt, walls)
    if rests:
        known = np.concatenate((known, transform(matcher.on_the_way, walls)))
    submap = GrowingSubmap(matcher, known, np.zeros(3))
    found = Locator(TrackerSection(), matcher, submap, walls, np.random.default_rng(0), Stopwatch()).locate(
        expected
    )
    assert found.pose == pytest.approx(matcher.on_the_way if rests else matcher.leapt)


@pytest.mark.parametrize("width", [0.5, 3.0], ids=["of a person", "of a wall"])
def test_what_is_as_narrow_as_people_does_not_deny_odometry(width: float) -> None:
    """A wall along the way fits either way; half of the returns are of something that stayed beside the robot."""
    matcher = Drawn()
    matcher.leapt, matcher.on_the_way = pose(-0.2, 0.0, 0.0), pose(0.001, 0.0, 0.0)
    wall = np.column_stack((np.arange(-3.0, 3.0, 0.05), np.full(120, 2.0)))
    beside = np.column_stack((np.full(120, 1.5), np.linspace(-width, 0.0, 120)))
    expected = Expectation(
        pose=np.zeros(3),
        covariance=np.diag([0.01, 0.01, 0.01]) ** 2,
        repeated=np.zeros(3),
        told=True,
        leaps=False,
        score=0.9,
    )
    points = np.concatenate((wall, beside))
    known = np.concatenate((wall + [-4.0, 0.0], wall, transform(matcher.leapt, beside)))
    submap = GrowingSubmap(matcher, known, np.zeros(3))
    found = Locator(TrackerSection(), matcher, submap, points, np.random.default_rng(0), Stopwatch()).locate(
        expected
    )
    assert found.pose == pytest.approx(matcher.on_the_way if width < 1.0 else matcher.leapt)
