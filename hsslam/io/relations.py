"""Relations of the Freiburg SLAM evaluation: true relative poses between two scans of a log.

A line is ``t1 t2 x y z roll pitch yaw``: the pose of the robot at ``t2`` in its frame at ``t1`` (Kuemmerle et
al., "On measuring the accuracy of SLAM algorithms", Autonomous Robots 27, 2009).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.table import read_table, whole_numbers, wrapped
from hsslam.se2 import Poses

STAMP_TOLERANCE = 5e-6
"""A stamp names the scan within this (s): some relations files print five digits of the log's six."""

_COLUMNS = ("t1", "t2", "x", "y", "z", "roll", "pitch", "yaw")
_INDEX_COLUMNS = ("i1", "i2", "t1", "t2", "dx", "dy", "dtheta")
_ROUNDING = 5e-7


@dataclass(frozen=True, eq=False)
class Relations:
    """True relative poses between pairs of scans.

    Parameters
    ----------
    first, second : int64 (R,)
        Numbers of the two scans in their log, from 0.
    poses : Poses
        (R, 3) robot pose at ``second`` seen from the one at ``first``.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    poses: Poses

    def __len__(self) -> int:
        return len(self.first)


def read_relations(
    path: Path | str, stamps: NDArray[np.float64] | None = None, index: Path | str | None = None
) -> Relations:
    """Read relations and find the scans that they are between.

    The index file names scans by number and is taken where given. Else a stamp names the scan that has
    exactly this stamp, or the one nearest to it within `STAMP_TOLERANCE`; where several scans share it, the
    first. (In the Intel and MIT CSAIL logs no two scans share a stamp, and both ways find the same scans.)

    Parameters
    ----------
    path : path
        The relations, ``t1 t2 x y z roll pitch yaw``; z, roll and pitch are not used.
    stamps : float64 (N,), optional
        Stamps of the log's scans, in their order.
    index : path, optional
        CSV with the header ``i1,i2,t1,t2,dx,dy,dtheta``: a line for every relation, in the same order.

    Raises
    ------
    DataError
        A malformed line, a stamp that names no scan, or an index file that does not belong to the relations.
    ValueError
        Neither ``stamps`` nor ``index`` given.
    """
    if stamps is None and index is None:
        raise ValueError("relations need the stamps of the scans, or an index file, to find the scans")
    table, lines = read_table(path, _COLUMNS)
    if not len(table):
        raise DataError(f"{path}: no relations in it; expected lines of {' '.join(_COLUMNS)}")
    poses = np.column_stack((table[:, 2], table[:, 3], wrapped(table[:, 7])))
    if index is not None:
        first, second = _read_index(Path(index), table, Path(path), None if stamps is None else len(stamps))
    else:
        assert stamps is not None
        first, second = (_find(table[:, c], stamps, Path(path), lines) for c in (0, 1))
    return Relations(first, second, poses)


def write_relations(
    path: Path | str,
    relations: Relations,
    stamps: NDArray[np.float64],
    index: Path | str | None = None,
) -> None:
    """Write relations, and their index file where one is asked for; `read_relations` reads both.

    Parameters
    ----------
    path : path
        The relations file.
    relations : Relations
        What to write.
    stamps : float64 (N,)
        Stamps of the log's scans.
    index : path, optional
        The index file.
    """
    rows = list(zip(relations.first, relations.second, relations.poses, strict=True))
    with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as out:
        for i, j, (x, y, theta) in rows:
            pose = f"{x:.9f} {y:.9f} 0 0 0 {theta:.9f}"
            out.write(f"{stamps[i]:.6f} {stamps[j]:.6f} {pose}\n")
    if index is not None:
        with atomic_path(index) as temporary, temporary.open("w", encoding="ascii") as out:
            out.write(",".join(_INDEX_COLUMNS) + "\n")
            for i, j, (x, y, theta) in rows:
                out.write(f"{i},{j},{stamps[i]:.6f},{stamps[j]:.6f},{x:.9f},{y:.9f},{theta:.9f}\n")


def _find(
    wanted: NDArray[np.float64], stamps: NDArray[np.float64], path: Path, lines: list[int]
) -> NDArray[np.int64]:
    """Numbers of the scans that have the wanted stamps."""
    if not len(stamps):
        raise DataError(f"{path}: the log has no scans that its relations could be between")
    # A stable sort keeps scans of equal stamp in the log's order, so the left end of a run is the first.
    order = np.argsort(stamps, kind="stable")
    ordered = stamps[order]
    after = np.searchsorted(ordered, wanted, side="left").clip(max=len(ordered) - 1)
    before = (after - 1).clip(min=0)
    take_before = np.abs(ordered[before] - wanted) < np.abs(ordered[after] - wanted)
    near = np.where(take_before, before, after)
    near = np.searchsorted(ordered, ordered[near], side="left")
    distance = np.abs(ordered[near] - wanted)
    # Printed stamps are rounded, and so are their differences in binary.
    bad = np.flatnonzero(distance > STAMP_TOLERANCE + _ROUNDING)
    if len(bad):
        row = int(bad[0])
        raise DataError(
            f"{path}:{lines[row]}: no scan has the stamp {wanted[row]:.6f} (the nearest is "
            f"{distance[row]:.6f} s away); are these the relations of this log?"
        )
    return order[near].astype(np.int64)


def _read_index(
    index: Path, relations: NDArray[np.float64], path: Path, scans: int | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    table, lines = read_table(index, _INDEX_COLUMNS, separator=",", header=True)
    if len(table) != len(relations):
        raise DataError(
            f"{index}: {len(table)} lines for the {len(relations)} relations of {path.name}: expected as many"
        )
    differs = np.flatnonzero((np.abs(table[:, 2:4] - relations[:, :2]) > STAMP_TOLERANCE).any(axis=1))
    if len(differs):
        row = int(differs[0])
        raise DataError(
            f"{index}:{lines[row]}: stamps {table[row, 2]:.6f}, {table[row, 3]:.6f}, where {path.name} has "
            f"{relations[row, 0]:.6f}, {relations[row, 1]:.6f}: the two files do not belong together"
        )
    first = whole_numbers(table, 0, "i1", index, lines)
    second = whole_numbers(table, 1, "i2", index, lines)
    if scans is not None:
        beyond = np.flatnonzero(np.maximum(first, second) >= scans)
        if len(beyond):
            row = int(beyond[0])
            raise DataError(
                f"{index}:{lines[row]}: names scan {max(first[row], second[row])}, "
                f"but the log has {scans} scans"
            )
    return first, second
