"""Trajectories in the TUM format: ``stamp x y z qx qy qz qw`` a line, as evo and many others read it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.table import read_table, wrapped
from hsslam.trajectory import Trajectory

_COLUMNS = ("stamp", "x", "y", "z", "qx", "qy", "qz", "qw")
_NORM_TOLERANCE = 0.01


def write_tum(path: Path | str, trajectory: Trajectory) -> None:
    """Write a trajectory, a line per pose in its order: z, qx and qy are 0; stamps read back to the last bit.

    Raises
    ------
    DataError
        The folder cannot be written to.
    """
    half = 0.5 * trajectory.poses[:, 2]
    with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as out:
        rows = zip(trajectory.stamps.tolist(), trajectory.poses, np.sin(half), np.cos(half), strict=True)
        for stamp, (x, y, _), qz, qw in rows:
            out.write(f"{stamp!r} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}\n")


def read_tum(path: Path | str) -> Trajectory:
    """Read a trajectory; x, y and the yaw of each pose are kept, and poses are numbered from 0.

    Raises
    ------
    DataError
        No such file, no pose in it, a malformed line, or a quaternion that is not of unit length.
    """
    table, lines = read_table(path, _COLUMNS)
    if not len(table):
        raise DataError(f"{path}: no poses in it; expected lines of {' '.join(_COLUMNS)}")
    qx, qy, qz, qw = table[:, 4:].T
    bad = np.flatnonzero(np.abs(np.linalg.norm(table[:, 4:], axis=1) - 1.0) > _NORM_TOLERANCE)
    if len(bad):
        row = int(bad[0])
        found = " ".join(f"{q:g}" for q in table[row, 4:])
        raise DataError(f"{path}:{lines[row]}: expected a quaternion qx qy qz qw of length 1, found {found}")
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    poses = np.column_stack((table[:, 1], table[:, 2], wrapped(yaw)))
    return Trajectory(table[:, 0].copy(), poses, np.arange(len(table), dtype=np.int64))
