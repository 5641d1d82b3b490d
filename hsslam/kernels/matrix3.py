"""Symmetric 3 x 3 matrices: LAPACK takes longer to be called than these take."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

_SWEEPS = 8


@kernel
def eigen(matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eigenvalues (3,), in no order, and eigenvectors (3, 3), one a column, of a symmetric matrix (Jacobi's method)."""
    m = matrix.copy()
    vectors = np.eye(3)
    for _ in range(_SWEEPS):
        if m[0, 1] * m[0, 1] + m[0, 2] * m[0, 2] + m[1, 2] * m[1, 2] == 0.0:
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if m[p, q] == 0.0:
                    continue
                slope = (m[q, q] - m[p, p]) / (2.0 * m[p, q])
                t = math.copysign(1.0, slope) / (abs(slope) + math.sqrt(1.0 + slope * slope))
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = t * c
                for k in range(3):
                    m[k, p], m[k, q] = c * m[k, p] - s * m[k, q], s * m[k, p] + c * m[k, q]
                for k in range(3):
                    m[p, k], m[q, k] = c * m[p, k] - s * m[q, k], s * m[p, k] + c * m[q, k]
                for k in range(3):
                    vectors[k, p], vectors[k, q] = (
                        c * vectors[k, p] - s * vectors[k, q],
                        s * vectors[k, p] + c * vectors[k, q],
                    )
                m[p, q] = m[q, p] = 0.0
    return np.array([m[0, 0], m[1, 1], m[2, 2]]), vectors


@kernel
def congruence(matrix: NDArray[np.float64], basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """``basis.T @ matrix @ basis``."""
    out = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for k in range(3):
                for n in range(3):
                    out[i, j] += basis[k, i] * matrix[k, n] * basis[n, j]
    return out


@kernel
def deflate(
    information: NDArray[np.float64], spurious: NDArray[np.float64], factor: float
) -> NDArray[np.float64]:
    """What of ``information`` stands out of ``factor`` times ``spurious``, direction by direction.

    In the basis in which the one is the identity and the other diagonal, with ``m`` on its diagonal, what is left
    is ``max(1 - factor * m, 0)``: never negative, as the plain difference can be.

    Parameters
    ----------
    information, spurious : float64 (3, 3)
        Positive semidefinite.
    """
    values, axes = eigen(information)
    least = 1e-12 * max(values[0], values[1], values[2]) + 1e-300
    root, whitening = np.empty((3, 3)), np.empty((3, 3))
    for k in range(3):
        length = math.sqrt(max(values[k], least))
        for i in range(3):
            root[i, k], whitening[i, k] = axes[i, k] * length, axes[i, k] / length
    shares, turned = eigen(congruence(spurious, whitening))
    out = np.zeros((3, 3))
    for k in range(3):
        left = max(1.0 - factor * shares[k], 0.0)
        for i in range(3):
            x = root[i, 0] * turned[0, k] + root[i, 1] * turned[1, k] + root[i, 2] * turned[2, k]
            for j in range(3):
                y = root[j, 0] * turned[0, k] + root[j, 1] * turned[1, k] + root[j, 2] * turned[2, k]
                out[i, j] += left * x * y
    return out
