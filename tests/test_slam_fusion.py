"""Covariance kernels against the same formulas in NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.se2 import inverse
from hsslam.slam.fusion import (
    GATE,
    fuse,
    inverse3,
    largest_variance,
    of_inverse,
    rotated,
    share_left,
    squared_mahalanobis,
)

Matrix = NDArray[np.float64]


@st.composite
def covariances(draw: st.DrawFn) -> Matrix:
    """Positive definite, well conditioned, of the size that covariances of matches have."""
    root = np.array(draw(st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9))).reshape(3, 3)
    scale = draw(st.floats(1e-3, 0.1))
    out: Matrix = scale**2 * (root @ root.T + 0.1 * np.eye(3))
    return out


@st.composite
def poses(draw: st.DrawFn) -> Matrix:
    return np.array([draw(st.floats(-50.0, 50.0)), draw(st.floats(-50.0, 50.0)), draw(st.floats(-3.1, 3.1))])


def wrapped(angle: float) -> float:
    return math.atan2(math.sin(angle), math.cos(angle))


@settings(deadline=None)  # the first call compiles
@given(covariances(), st.floats(-10.0, 10.0))
def test_rotated_is_a_congruence(covariance: Matrix, angle: float) -> None:
    """A vector v of the old frame is R(-angle) v in the frame that is turned by angle."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(rotated(covariance, angle), turn @ covariance @ turn.T, atol=1e-15)
    np.testing.assert_allclose(rotated(rotated(covariance, angle), -angle), covariance, atol=1e-15)


@settings(deadline=None)
@given(covariances(), poses())
def test_the_covariance_of_an_inverse_follows_its_derivatives(covariance: Matrix, pose: Matrix) -> None:
    steps = 1e-6 * np.eye(3)
    change = np.array([(inverse(pose + step) - inverse(pose - step)) / 2e-6 for step in steps]).T
    np.testing.assert_allclose(of_inverse(covariance, pose), change @ covariance @ change.T, atol=1e-6)
    there_and_back = of_inverse(of_inverse(covariance, pose), inverse(pose))
    np.testing.assert_allclose(there_and_back, covariance, atol=1e-9)


@settings(deadline=None)
@given(covariances())
def test_the_largest_variance_is_an_eigenvalue(covariance: Matrix) -> None:
    assert largest_variance(covariance) == pytest.approx(np.linalg.eigvalsh(covariance[:2, :2])[1])


@settings(deadline=None)
@given(covariances())
def test_inverse3_inverts(covariance: Matrix) -> None:
    np.testing.assert_allclose(inverse3(covariance) @ covariance, np.eye(3), atol=1e-9)


@settings(deadline=None)
@given(poses(), covariances())
def test_squared_mahalanobis(deviation: Matrix, covariance: Matrix) -> None:
    expected = deviation @ np.linalg.solve(covariance, deviation)
    assert squared_mahalanobis(deviation, covariance) == pytest.approx(expected, rel=1e-8)


@settings(deadline=None)
@given(poses(), covariances(), poses(), covariances())
def test_fuse_is_the_information_weighted_mean(
    predicted: Matrix, prior: Matrix, direction: Matrix, covariance: Matrix
) -> None:
    length = math.sqrt(direction @ np.linalg.solve(prior + covariance, direction))
    offset = direction / max(length, 1.0)  # inside the gate
    matched = predicted + offset
    matched[2] = wrapped(matched[2])
    pose, posterior = fuse(predicted, prior, matched, covariance)
    prior_information, match_information = np.linalg.inv(prior), np.linalg.inv(covariance)
    expected_covariance = np.linalg.inv(prior_information + match_information)
    step = expected_covariance @ match_information @ offset
    np.testing.assert_allclose(posterior, expected_covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(pose[:2], predicted[:2] + step[:2], atol=1e-8)
    assert wrapped(pose[2] - predicted[2] - step[2]) == pytest.approx(0.0, abs=1e-8)
    assert -math.pi <= pose[2] < math.pi
    assert (posterior == posterior.T).all()


@pytest.mark.parametrize(("sigmas", "believed"), [(0.99, False), (1.01, True)])
def test_beyond_the_gate_the_match_alone_counts(sigmas: float, believed: bool) -> None:
    covariance = np.diag([1e-4, 1e-4, 1e-6])
    matched = np.array([sigmas * math.sqrt(GATE * 2e-4), 0.0, 0.0])
    pose, posterior = fuse(np.zeros(3), covariance, matched, covariance)
    if believed:
        assert (pose == matched).all()
        assert (posterior == covariance).all()
    else:
        np.testing.assert_allclose(pose, 0.5 * matched)
        np.testing.assert_allclose(posterior, 0.5 * covariance)


@settings(deadline=None)
@given(st.floats(-3.1, 3.1), st.floats(0.02, 0.1), st.floats(-0.2, 0.2), st.floats(0.2, 10.0))
def test_a_corridor_that_denies_the_heading_has_no_say_in_the_way(
    angle: float, known: float, off: float, open_std: float
) -> None:
    """A Kalman update of the match with the one coordinate that the prediction knows better."""
    along = np.array([math.cos(angle), math.sin(angle), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    prior = np.diag([known**2, known**2, 1e-6])
    covariance = open_std**2 * np.outer(along, along) + 1e-4 * np.outer(across, across)
    covariance[2, 2] = 1e-6
    matched = off * along + np.array([0.0, 0.0, 0.05])
    pose, posterior = fuse(np.zeros(3), prior, matched, covariance)
    gain = covariance @ along / (known**2 + open_std**2)
    np.testing.assert_allclose(pose, matched - gain * off, atol=1e-12)
    np.testing.assert_allclose(posterior, covariance - np.outer(gain, along @ covariance), atol=1e-12)
    assert pose[2] == pytest.approx(0.05)
    assert abs(pose[:2] @ along[:2]) <= abs(off) * known**2 / (known**2 + open_std**2) + 1e-12


def test_a_prediction_that_is_off_along_the_corridor_too_has_none() -> None:
    prior, covariance = np.diag([1e-4, 1e-4, 1e-6]), np.diag([4e-2, 1e-4, 1e-6])
    matched = np.array([0.8, 0.0, 0.05])
    pose, posterior = fuse(np.zeros(3), prior, matched, covariance)
    assert (pose == matched).all()
    assert (posterior == covariance).all()


@settings(deadline=None)
@given(covariances(), covariances())
def test_an_update_leaves_a_share(prior: Matrix, covariance: Matrix) -> None:
    posterior = np.linalg.inv(np.linalg.inv(prior) + np.linalg.inv(covariance))
    assert share_left(prior, prior) == pytest.approx(1.0)
    values, vectors = np.linalg.eigh(posterior[:2, :2])
    least_known = vectors[:, 1]
    expected = values[1] / (least_known @ prior[:2, :2] @ least_known)
    assert share_left(prior, posterior) == pytest.approx(expected, rel=1e-6)


def test_headings_are_fused_across_the_seam() -> None:
    covariance = np.diag([1e-2, 1e-2, 1e-2])
    pose, _ = fuse(
        np.array([0.0, 0.0, math.pi - 0.02]), covariance, np.array([0.0, 0.0, -math.pi + 0.04]), covariance
    )
    assert pose[2] == pytest.approx(-math.pi + 0.01)
