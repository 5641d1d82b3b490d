"""Symmetric 3 x 3 matrices against NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.matrix3 import congruence, deflate, eigen

roots = st.lists(st.floats(-10.0, 10.0), min_size=9, max_size=9).map(lambda v: np.array(v).reshape(3, 3))


@given(roots)
@settings(deadline=None, max_examples=60)
def test_eigenvectors_diagonalise(root: NDArray[np.float64]) -> None:
    matrix = root + root.T
    values, vectors = eigen(matrix)
    assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(matrix), abs=1e-9)
    assert vectors.T @ vectors == pytest.approx(np.eye(3), abs=1e-12)
    assert matrix @ vectors == pytest.approx(vectors * values, abs=1e-9)


@given(roots, roots)
@settings(deadline=None, max_examples=30)
def test_congruence_is_the_product(root: NDArray[np.float64], basis: NDArray[np.float64]) -> None:
    matrix = root @ root.T
    assert congruence(matrix, basis) == pytest.approx(basis.T @ matrix @ basis, rel=1e-9, abs=1e-6)


def test_deflation_is_the_difference_where_that_is_positive() -> None:
    root = np.random.default_rng(0).normal(size=(3, 3))
    information = root @ root.T + np.eye(3)
    spurious = 0.1 * np.diag([1.0, 2.0, 3.0])
    assert deflate(information, spurious, 2.0) == pytest.approx(information - 2.0 * spurious)


@given(roots, roots)
@settings(deadline=None, max_examples=30)
def test_deflation_leaves_no_negative_direction_and_adds_none(
    root: NDArray[np.float64], other: NDArray[np.float64]
) -> None:
    information, spurious = root @ root.T + 0.1 * np.eye(3), other @ other.T
    left = deflate(information, spurious, 1.0)
    assert np.linalg.eigvalsh(left).min() >= -1e-6
    assert np.linalg.eigvalsh(information - left).min() >= -1e-6


def test_deflation_closes_the_direction_that_is_all_noise() -> None:
    information = np.diag([100.0, 0.4, 50.0])
    left = deflate(information, 0.3 * np.eye(3), 2.0)
    assert left == pytest.approx(np.diag([99.4, 0.0, 49.4]))
