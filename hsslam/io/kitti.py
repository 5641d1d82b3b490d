"""Trajectories in the KITTI format: a pose a line, the upper three rows of its 4 x 4 matrix; no stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.table import read_table, wrapped
from hsslam.trajectory import Trajectory

_COLUMNS = tuple(f"r{i}{j}" if j < 3 else f"t{i}" for i in range(3) for j in range(4))
_TOLERANCE = 1e-2


def write_kitti(path: Path | str, trajectory: Trajectory) -> None:
    """Write a trajectory, a line per pose in its order.

    The matrices are those of the robot's poses in the map, x ahead and z up; KITTI's own ground truth is of a
    camera, whose z looks ahead. Stamps and numbers of scans are lost.

    Raises
    ------
    DataError
        The folder cannot be written to.
    """
    theta = trajectory.poses[:, 2]
    with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as out:
        for (x, y, _), c, s in zip(trajectory.poses, np.cos(theta), np.sin(theta), strict=True):
            out.write(f"{c:.12f} {-s:.12f} 0 {x:.9f} {s:.12f} {c:.12f} 0 {y:.9f} 0 0 1 0\n")


def read_kitti(path: Path | str) -> Trajectory:
    """Read a trajectory; x, y and the yaw of each pose are kept. Poses are numbered from 0, stamps are NaN.

    Raises
    ------
    DataError
        No such file, no pose in it, a malformed line, or a matrix that is no rotation.
    """
    table, lines = read_table(path, _COLUMNS)
    if not len(table):
        raise DataError(f"{path}: no poses in it; expected lines of {' '.join(_COLUMNS)}")
    turns = table.reshape(-1, 3, 4)[:, :, :3]
    off = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((off > _TOLERANCE) | (np.linalg.det(turns) < 0.0))
    if len(bad):
        raise DataError(
            f"{path}:{lines[int(bad[0])]}: expected a rotation in the first three columns, found none"
        )
    yaw = np.arctan2(turns[:, 1, 0], turns[:, 0, 0])
    poses = np.column_stack((table[:, 3], table[:, 7], wrapped(yaw)))
    return Trajectory(np.full(len(table), np.nan), poses, np.arange(len(table), dtype=np.int64))
