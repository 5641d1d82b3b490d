"""Which scan of a log each pose of a trajectory belongs to."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from hsslam.datasets.dataset import Dataset
from hsslam.errors import DataError
from hsslam.io.trajectory_csv import read_trajectory_csv
from hsslam.io.tum import read_tum
from hsslam.trajectory import Trajectory

_SAME_STAMP = 5e-6
"""Stamps this close are one, written with fewer digits (s)."""


def odometry_of(log: Dataset, progress: Callable[[int], None] | None = None) -> Trajectory:
    """Read the raw odometry of every scan of a log; ``progress`` is told how many were read.

    Raises
    ------
    DataError
        The log cannot be read, or holds no scan.
    """
    stamps, poses, indices = [], [], []
    for done, scan in enumerate(log.scans(), start=1):
        stamps.append(scan.stamp)
        poses.append(scan.odometry)
        indices.append(scan.index)
        if progress is not None:
            progress(done)
    if not poses:
        raise DataError(f"{log.info.name}: holds no scan")
    return Trajectory(np.array(stamps), np.array(poses), np.array(indices, dtype=np.int64))


def read_trajectory(path: Path, odometry: Trajectory) -> Trajectory:
    """Read a trajectory of a log, TUM or CSV (``scan,x,y,theta``), each pose with the number of its scan.

    Raises
    ------
    DataError
        The file cannot be read, or does not belong to the log that the odometry is of.
    """
    if path.suffix == ".csv":
        return read_trajectory_csv(path)
    return place(read_tum(path), odometry, path)


def place(trajectory: Trajectory, odometry: Trajectory, source: Path | str) -> Trajectory:
    """Find the scan that each pose of a TUM file belongs to.

    A file with a line per scan is taken in the log's order. A shorter one goes by stamps, each line to the
    next scan with that very stamp: stamps repeat and step back, so the nearest in time may be another scan.

    Raises
    ------
    DataError
        A stamp is not in what is left of the log.
    """
    if len(trajectory) == len(odometry):
        return Trajectory(odometry.stamps, trajectory.poses, odometry.indices)
    indices = []
    at = 0
    for number, stamp in enumerate(trajectory.stamps, start=1):
        same = np.flatnonzero(np.abs(odometry.stamps[at:] - stamp) < _SAME_STAMP)
        if len(same) == 0:
            raise DataError(
                f"{source}: pose {number}: no scan of the log after those before it has the stamp {stamp:.6f}; "
                f"expected stamps as recorded, or a pose for each of the {len(odometry):,} scans"
            )
        at += int(same[0]) + 1
        indices.append(int(odometry.indices[at - 1]))
    return Trajectory(trajectory.stamps, trajectory.poses, np.array(indices, dtype=np.int64))
