"""Poses against homogeneous matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam import se2

METRES = st.floats(-1e3, 1e3)
RADIANS = st.floats(-20.0, 20.0)


@st.composite
def poses(draw: st.DrawFn) -> NDArray[np.float64]:
    return se2.pose(draw(METRES), draw(METRES), draw(RADIANS))


def close(a: NDArray[np.float64], b: NDArray[np.float64], tolerance: float = 1e-8) -> bool:
    """Equal poses, headings on the circle."""
    return bool(np.abs(a[:2] - b[:2]).max() < tolerance and abs(math.sin((a[2] - b[2]) / 2)) < tolerance)


def check_range(theta: float) -> None:
    assert -math.pi <= theta < math.pi


@settings(deadline=None, max_examples=200)
@given(
    st.one_of(RADIANS, st.floats(-1e6, 1e6), st.sampled_from([math.pi, -math.pi, 3 * math.pi, -1e-17, -0.0]))
)
def test_wrap_keeps_the_direction_and_stays_in_range(theta: float) -> None:
    wrapped = se2.wrap(theta)
    check_range(wrapped)
    assert math.cos(wrapped) == pytest.approx(math.cos(theta), abs=1e-8)
    assert math.sin(wrapped) == pytest.approx(math.sin(theta), abs=1e-8)


@pytest.mark.parametrize("turns", [-3, -1, 1, 5])
def test_wrap_of_odd_half_turns_is_minus_pi(turns: int) -> None:
    assert se2.wrap(turns * math.pi) == pytest.approx(-math.pi)


@settings(deadline=None, max_examples=100)
@given(poses(), poses())
def test_compose_is_the_matrix_product(a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    out = se2.compose(a, b)
    check_range(out[2])
    assert close(out, se2.from_matrix(se2.matrix(a) @ se2.matrix(b)))


@settings(deadline=None, max_examples=100)
@given(poses())
def test_inverse_is_the_matrix_inverse(a: NDArray[np.float64]) -> None:
    out = se2.inverse(a)
    check_range(out[2])
    assert close(out, se2.from_matrix(np.linalg.inv(se2.matrix(a))))
    assert close(se2.compose(a, out), np.zeros(3))


@settings(deadline=None, max_examples=100)
@given(poses(), poses())
def test_between_is_what_compose_undoes(a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    out = se2.between(a, b)
    check_range(out[2])
    assert close(out, se2.from_matrix(np.linalg.inv(se2.matrix(a)) @ se2.matrix(b)))
    assert close(se2.compose(a, out), b)


@settings(deadline=None, max_examples=50)
@given(poses(), poses(), poses())
def test_compose_is_associative(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> None:
    left, right = se2.compose(se2.compose(a, b), c), se2.compose(a, se2.compose(b, c))
    assert close(left, right)


@settings(deadline=None, max_examples=100)
@given(poses(), poses(), st.floats(0.0, 1.0))
def test_interpolation_turns_the_short_way(a: NDArray[np.float64], b: NDArray[np.float64], t: float) -> None:
    assert close(se2.interpolate(a, b, 0.0), a)
    assert close(se2.interpolate(a, b, 1.0), b)
    out = se2.interpolate(a, b, t)
    check_range(out[2])
    assert np.allclose(out[:2], (1.0 - t) * a[:2] + t * b[:2])
    turned = abs(se2.wrap(b[2] - a[2]))
    assert abs(se2.wrap(out[2] - a[2])) == pytest.approx(t * turned, abs=1e-8)


def test_interpolation_crosses_the_seam_of_the_circle() -> None:
    a, b = se2.pose(0.0, 0.0, math.radians(170.0)), se2.pose(2.0, 4.0, math.radians(-170.0))
    middle = se2.interpolate(a, b, 0.5)
    assert close(middle, np.array([1.0, 2.0, -math.pi]))
    beyond = se2.interpolate(a, b, 2.0)
    assert close(beyond, np.array([4.0, 8.0, math.radians(-150.0)]))


@settings(deadline=None, max_examples=50)
@given(poses(), st.lists(st.tuples(METRES, METRES), max_size=20))
def test_transform_is_the_matrix_applied(a: NDArray[np.float64], rows: list[tuple[float, float]]) -> None:
    points = np.array(rows, dtype=np.float64).reshape(-1, 2)
    homogeneous = np.column_stack((points, np.ones(len(points))))
    assert np.allclose(se2.transform(a, points), (homogeneous @ se2.matrix(a).T)[:, :2])


def test_the_many_functions_are_the_single_ones_row_by_row(rng: np.random.Generator) -> None:
    a, b = (np.column_stack((rng.normal(size=(40, 2)), rng.uniform(-np.pi, np.pi, 40))) for _ in range(2))
    t = rng.uniform(-0.5, 1.5, 40)
    rows = range(40)
    assert np.array_equal(se2.compose_many(a, b), [se2.compose(a[i], b[i]) for i in rows])
    assert np.array_equal(se2.inverse_many(a), [se2.inverse(a[i]) for i in rows])
    assert np.array_equal(se2.between_many(a, b), [se2.between(a[i], b[i]) for i in rows])
    assert np.array_equal(se2.interpolate_many(a, b, t), [se2.interpolate(a[i], b[i], t[i]) for i in rows])
    assert se2.compose_many(np.empty((0, 3)), np.empty((0, 3))).shape == (0, 3)


@settings(deadline=None, max_examples=50)
@given(poses())
def test_matrix_and_back(a: NDArray[np.float64]) -> None:
    assert close(se2.from_matrix(se2.matrix(a)), a)


def test_functions_leave_their_arguments_alone() -> None:
    a, b = np.array([1.0, 2.0, 3.0]), np.array([-1.0, 0.5, -3.0])
    se2.compose(a, b), se2.between(a, b), se2.inverse(a), se2.interpolate(a, b, 0.3)
    assert a.tolist() == [1.0, 2.0, 3.0]
    assert b.tolist() == [-1.0, 0.5, -3.0]
