"""Trajectories as ``scan,x,y,theta``: poses by the number of the scan, for some or all scans of a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.table import read_table, whole_numbers, wrapped
from hsslam.trajectory import Trajectory

_COLUMNS = ("scan", "x", "y", "theta")


def read_trajectory_csv(path: Path | str, stamps: NDArray[np.float64] | None = None) -> Trajectory:
    """Read a trajectory with the header ``scan,x,y,theta``: number of the scan from 0, metres, radians.

    Parameters
    ----------
    path : path
        The file.
    stamps : float64 (N,), optional
        Stamps of all scans of the log; NaN where left out.

    Raises
    ------
    DataError
        No such file, a malformed line, no pose, scans out of order or beyond the log.
    """
    table, lines = read_table(path, _COLUMNS, separator=",", header=True)
    if not len(table):
        raise DataError(f"{path}: no poses in it; expected lines of {','.join(_COLUMNS)}")
    scans = whole_numbers(table, 0, "scan", path, lines)
    back = np.flatnonzero(np.diff(scans) <= 0)
    if len(back):
        row = int(back[0]) + 1
        raise DataError(
            f"{path}:{lines[row]}: scan {scans[row]} after scan {scans[row - 1]}: expected rising numbers"
        )
    if stamps is not None and scans[-1] >= len(stamps):
        raise DataError(f"{path}:{lines[-1]}: names scan {scans[-1]}, but the log has {len(stamps)} scans")
    own = np.full(len(scans), np.nan) if stamps is None else stamps[scans]
    return Trajectory(own, np.column_stack((table[:, 1], table[:, 2], wrapped(table[:, 3]))), scans)
