"""Pose graphs in the plane as g2o files: ``VERTEX_SE2`` and ``EDGE_SE2`` lines.

An edge of the file holds the information matrix of g2o's error, which lives in the frame of the measured
pose. hsslam's covariances are of (x, y, theta) in the frame of the edge's first pose, as a match gives them;
reading and writing turn one into the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.compressed import read_lines
from hsslam.se2 import Pose, Poses, wrap

GraphEdge: TypeAlias = tuple[int, int, Pose, NDArray[np.float64]]
"""Row of the first pose, row of the second, second seen from first, covariance (3, 3)."""

_VERTEX = "VERTEX_SE2 id x y theta"
_EDGE = "EDGE_SE2 i j dx dy dtheta I11 I12 I13 I22 I23 I33"
_UPPER = np.triu_indices(3)


def write_g2o(path: Path | str, poses: Poses, edges: Iterable[GraphEdge]) -> None:
    """Write a pose graph.

    No vertex is marked with ``FIX``: gtsam's reader drops every line after one, and g2o fixes the first
    itself.

    Parameters
    ----------
    path : path
        The file.
    poses : Poses
        (K, 3); row k becomes vertex k.
    edges : iterable of GraphEdge
        Constraints between them.

    Raises
    ------
    DataError
        The folder cannot be written to.
    numpy.linalg.LinAlgError
        A covariance without an inverse.
    """
    with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as out:
        for k, (x, y, theta) in enumerate(poses):
            out.write(f"VERTEX_SE2 {k} {x:.9f} {y:.9f} {theta:.9f}\n")
        for i, j, (x, y, theta), covariance in edges:
            turn = _turn(theta)
            information = np.linalg.inv(turn.T @ covariance @ turn)
            upper = " ".join(f"{value:.12g}" for value in (0.5 * (information + information.T))[_UPPER])
            out.write(f"EDGE_SE2 {i} {j} {x:.9f} {y:.9f} {theta:.9f} {upper}\n")


def read_g2o(path: Path | str) -> tuple[Poses, list[GraphEdge]]:
    """Read a pose graph.

    Returns
    -------
    poses : Poses
        (K, 3) in the order of the vertices' numbers.
    edges : list of GraphEdge
        In the file's order; ``i`` and ``j`` are rows of ``poses``.

    Raises
    ------
    DataError
        No such file, no vertex, a malformed or unknown line, an edge to a vertex that is not there,
        information that is not positive definite.
    """
    vertices: dict[int, Pose] = {}
    raw: list[tuple[int, int, int, list[float]]] = []
    for number, line in enumerate(read_lines(path), start=1):
        words = line.split()
        if not words or words[0].startswith(b"#") or words[0] == b"FIX":
            continue
        where = f"{path}:{number}"
        if words[0] == b"VERTEX_SE2":
            (name,), (x, y, theta) = _parse(words, 1, _VERTEX, where)
            if name in vertices:
                raise DataError(f"{where}: vertex {name} is there already; expected each number once")
            vertices[name] = np.array([x, y, wrap(theta)])
        elif words[0] == b"EDGE_SE2":
            (i, j), values = _parse(words, 2, _EDGE, where)
            raw.append((number, i, j, values))
        else:
            found = words[0][:40].decode("utf-8", "replace")
            raise DataError(f"{where}: expected VERTEX_SE2, EDGE_SE2 or FIX, found {found!r}")
    if not vertices:
        raise DataError(f"{path}: no vertices in it; expected lines of {_VERTEX}")
    names = sorted(vertices)
    row = {name: k for k, name in enumerate(names)}
    edges = []
    for number, i, j, values in raw:
        for name in (i, j):
            if name not in row:
                raise DataError(
                    f"{path}:{number}: the edge names vertex {name}, which the file does not hold"
                )
        relative = np.array([values[0], values[1], wrap(values[2])])
        edges.append((row[i], row[j], relative, _covariance(values[3:], values[2], f"{path}:{number}")))
    return np.array([vertices[name] for name in names]), edges


def _covariance(upper: list[float], theta: float, where: str) -> NDArray[np.float64]:
    information = np.zeros((3, 3))
    information[_UPPER] = upper
    information = information + np.triu(information, 1).T
    try:
        np.linalg.cholesky(information)
    except np.linalg.LinAlgError:
        raise DataError(f"{where}: expected a positive definite information matrix, found {upper}") from None
    turn = _turn(theta)
    covariance: NDArray[np.float64] = turn @ np.linalg.inv(information) @ turn.T
    return covariance


def _turn(theta: float) -> NDArray[np.float64]:
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _parse(words: list[bytes], names: int, expected: str, where: str) -> tuple[list[int], list[float]]:
    width = len(expected.split())
    try:
        if len(words) != width:
            raise ValueError
        numbers = [int(word) for word in words[1 : 1 + names]]
        values = [float(word) for word in words[1 + names :]]
        if not all(map(math.isfinite, values)):
            raise ValueError
    except ValueError:
        found = b" ".join(words)[:80].decode("utf-8", "replace")
        raise DataError(f"{where}: expected {expected} in finite numbers, found {found!r}") from None
    return numbers, values
