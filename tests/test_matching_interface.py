"""What `Matcher.match` does for every plugin: clean, reject, score, covariance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam import se2
from hsslam.kernels.window import inside, kept
from hsslam.matching import Estimate, Matcher, MatcherConfig, Reference, SearchWindow, clean

WINDOW = SearchWindow(0.3, 0.3, 0.2)


class Oracle(Matcher[MatcherConfig]):
    """Answers what it was told to."""

    def __init__(self, answer: Estimate) -> None:
        super().__init__()
        self.answer = answer
        self.seen: list[NDArray[np.float64]] = []

    def estimate(self, reference, points, guess, window, rng):
        self.seen.append(points)
        return self.answer


def match(answer, points, guess=(0.0, 0.0, 0.0), reference=None, window=WINDOW):
    oracle = Oracle(answer if isinstance(answer, Estimate) else Estimate(np.array(answer, dtype=np.float64)))
    known = oracle.prepare(points if reference is None else reference)
    return oracle.match(known, points, np.array(guess), window, np.random.default_rng(0)), oracle


@pytest.fixture
def room(room_pair) -> NDArray[np.float64]:
    return room_pair[0]


def test_an_answer_inside_the_window_is_kept(room) -> None:
    result, _ = match(Estimate(np.array([0.1, -0.2, 0.05]), True, 17, None, {"note": 1}), room)
    assert result.pose == pytest.approx([0.1, -0.2, 0.05])
    assert result.converged
    assert result.evaluations == 17
    assert result.diagnostics["note"] == 1


@pytest.mark.parametrize("answer", [(0.31, 0.0, 0.0), (0.0, -0.31, 0.0), (0.0, 0.0, 0.21), (50.0, 0.0, 0.0)])
def test_an_answer_outside_the_window_is_rejected(room, answer) -> None:
    result, _ = match(Estimate(np.array(answer), True, 3, np.eye(3) * 1e-9), room)
    assert result.pose.tolist() == [0.0, 0.0, 0.0]
    assert not result.converged
    assert "window" in result.diagnostics["rejected"]
    assert result.evaluations == 3
    assert result.covariance[0, 0] > 1e-9


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (None, "Oracle.estimate returned NoneType: expected hsslam.matching.Estimate"),
        ((0.0, 0.0, 0.0), "Oracle.estimate returned tuple: expected hsslam.matching.Estimate"),
        (Estimate(np.zeros((2, 2))), r"returned a pose of shape \(2, 2\): expected three numbers"),
        (Estimate("here"), "returned a pose 'here': expected three numbers"),
        (Estimate(None), r"returned a pose of shape \(\): expected three numbers"),
    ],
)
def test_an_answer_that_is_none_is_told(room, answer, said) -> None:
    oracle = Oracle(answer)
    with pytest.raises(TypeError, match=said):
        oracle.match(oracle.prepare(room), room, np.zeros(3), WINDOW, np.random.default_rng(0))


def test_three_numbers_of_any_kind_are_a_pose(room) -> None:
    result, _ = match(Estimate([0, 0, 0]), room)
    assert result.pose.dtype == np.float64 and result.converged


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_an_answer_that_is_not_finite_is_rejected(room, bad) -> None:
    result, _ = match((0.0, bad, 0.0), room)
    assert result.pose.tolist() == [0.0, 0.0, 0.0]
    assert not result.converged
    assert "not finite" in result.diagnostics["rejected"]


def test_the_window_reaches_over_the_seam_of_the_circle(room) -> None:
    turned = se2.transform(np.array([0.0, 0.0, np.pi]), room)
    result, _ = match((0.0, 0.0, -np.pi + 0.05), room, guess=(0.0, 0.0, np.pi - 0.05), reference=turned)
    assert result.converged
    assert result.pose[2] == pytest.approx(-np.pi + 0.05)


def test_theta_is_wrapped(room) -> None:
    result, _ = match((0.0, 0.0, 2 * np.pi + 0.1), room)
    assert result.pose[2] == pytest.approx(0.1)


def test_the_score_is_the_share_of_points_near_the_surface(room) -> None:
    at_truth, _ = match((0.0, 0.0, 0.0), room)
    assert at_truth.score == 1.0
    half_lost = np.vstack((room, room + (100.0, 0.0)))
    result, _ = match((0.0, 0.0, 0.0), half_lost, reference=room)
    assert result.score == pytest.approx(0.5)


def test_the_distance_of_the_score_is_a_setting(room) -> None:
    wall = np.column_stack((np.linspace(-2.0, 2.0, 81), np.zeros(81)))
    shifted = wall + (0.0, 0.08)
    scores = []
    for distance in (0.05, 0.1):
        oracle = Oracle(Estimate(np.zeros(3)))
        oracle.config = MatcherConfig(score_distance=distance)
        found = oracle.match(oracle.prepare(wall), shifted, np.zeros(3), WINDOW, np.random.default_rng(0))
        scores.append(found.score)
    assert scores == [0.0, 1.0]


def test_the_plugins_own_covariance_wins(room) -> None:
    own = np.diag((1e-4, 2e-4, 3e-4))
    result, _ = match(Estimate(np.zeros(3), covariance=own), room)
    assert np.array_equal(result.covariance, own)


def test_covariance_knows_the_direction_that_a_corridor_leaves_open() -> None:
    x = np.linspace(-4.0, 4.0, 161)
    corridor = np.vstack((np.column_stack((x, np.full(161, 1.0))), np.column_stack((x, np.full(161, -1.0)))))
    along_x, _ = match((0.0, 0.0, 0.0), corridor)
    assert along_x.covariance[0, 0] > 100 * along_x.covariance[1, 1]
    turned = corridor[:, ::-1].copy()
    along_y, _ = match((0.0, 0.0, 0.0), turned)
    assert along_y.covariance[1, 1] > 100 * along_y.covariance[0, 0]
    assert along_x.covariance[0, 0] <= WINDOW.half_x**2


def test_covariance_shrinks_with_more_points(room) -> None:
    few, _ = match((0.0, 0.0, 0.0), room[::6], reference=room)
    many, _ = match((0.0, 0.0, 0.0), room, reference=room)
    assert np.trace(many.covariance) < np.trace(few.covariance)


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=3, max_size=40), st.integers(0, 99)
)
def test_score_and_covariance_are_sound_for_any_points(rows, seed) -> None:
    points = np.array(rows)
    guess = np.random.default_rng(seed).normal(size=3)
    result, _ = match(guess, points, guess=guess)
    assert 0.0 <= result.score <= 1.0
    assert np.array_equal(result.covariance, result.covariance.T)
    assert np.linalg.eigvalsh(result.covariance)[0] > 0.0
    assert np.isfinite(result.covariance).all()


@pytest.mark.parametrize("few", [np.empty((0, 2)), np.ones((2, 2)), np.full((9, 2), np.nan)])
def test_too_few_points_never_reach_the_plugin(room, few) -> None:
    for scan, reference in ((few, room), (room, few)):
        result, oracle = match((0.1, 0.1, 0.1), scan, guess=(0.0, 0.2, 0.0), reference=reference)
        assert oracle.seen == []
        assert result.pose.tolist() == [0.0, 0.2, 0.0]
        assert not result.converged
        assert result.score == 0.0
        assert "fewer than 3 points" in result.diagnostics["rejected"]
        assert np.linalg.eigvalsh(result.covariance)[0] > 0.0


def test_plugins_see_finite_contiguous_float64(room) -> None:
    noisy = np.insert(room, [0, 50], np.nan, axis=0).astype(np.float32)[:, ::-1]
    _, oracle = match((0.0, 0.0, 0.0), noisy)
    (seen,) = oracle.seen
    assert seen.dtype == np.float64
    assert seen.flags.c_contiguous
    assert np.isfinite(seen).all()
    assert len(seen) == len(room)


@pytest.mark.parametrize("wrong", [np.zeros(4), np.zeros((4, 3)), np.zeros((2, 2, 2)), np.float64(1.0)])
def test_points_of_a_wrong_shape(room, wrong) -> None:
    with pytest.raises(ValueError, match=r"shape \(N, 2\)"):
        clean(wrong)
    with pytest.raises(ValueError, match=r"shape \(N, 2\)"):
        match((0.0, 0.0, 0.0), wrong, reference=room)
    with pytest.raises(ValueError, match=r"shape \(N, 2\)"):
        match((0.0, 0.0, 0.0), room, reference=wrong)


@pytest.mark.parametrize("guess", [(0.0, 0.0), (0.0, 0.0, np.nan), (np.inf, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)])
def test_a_guess_that_is_no_pose(room, guess) -> None:
    with pytest.raises(ValueError, match="three finite numbers"):
        match((0.0, 0.0, 0.0), room, guess=guess)


def test_clean_copies_nothing_that_is_clean_already(room) -> None:
    assert np.shares_memory(clean(room), room)


@settings(deadline=None, max_examples=100)
@given(
    st.tuples(*[st.floats(0.01, 2.0)] * 3),
    st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    st.tuples(st.floats(-10, 10), st.floats(-10, 10), st.floats(-3.14, 3.14)),
)
def test_the_window_is_a_box_around_the_guess(half, offset, guess) -> None:
    window, centre = SearchWindow(*half), np.array(guess)
    pose = se2.pose(*(centre + offset))
    expected = all(abs(o) <= h for o, h in zip(offset, half, strict=True))
    borderline = any(abs(abs(o) - h) < 1e-6 for o, h in zip(offset, half, strict=True))
    assert borderline or window.contains(centre, pose) == expected
    assert inside(centre, window.half, pose) == window.contains(centre, pose)
    for slack in (0.0, 0.3):
        expected = window.keep(centre, pose, slack)
        np.testing.assert_array_equal(kept(centre, window.half, pose, slack), expected)


def test_a_pose_that_is_not_finite_is_in_no_window() -> None:
    window, centre = SearchWindow(1.0, 1.0, 1.0), np.zeros(3)
    for value in (np.nan, np.inf):
        for d in range(3):
            pose = np.where(np.arange(3) == d, value, 0.0)
            assert not window.contains(centre, pose)
            assert not inside(centre, window.half, pose)


def test_a_reference_builds_its_surface_once(room) -> None:
    reference = Reference(room)
    assert reference.surface is reference.surface


def test_the_default_config_is_made_by_the_class() -> None:
    assert Oracle(Estimate(np.zeros(3))).config == MatcherConfig()
