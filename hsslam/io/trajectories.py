"""Trajectories of any format: which one a file is, how it is read and written."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.compressed import read_lines
from hsslam.io.kitti import read_kitti, write_kitti
from hsslam.io.trajectory_csv import read_trajectory_csv
from hsslam.io.tum import read_tum, write_tum
from hsslam.trajectory import Trajectory

SUFFIXES = {".tum": "tum", ".kitti": "kitti", ".csv": "csv", ".txt": "txt"}
"""What a name asks for; ``.txt`` may be TUM or KITTI, its columns tell."""

_HEADER = b"scan,x,y,theta"
_COLUMNS = {8: "tum", 12: "kitti"}


def detect_trajectory(path: Path | str) -> str | None:
    """``tum``, ``kitti`` or ``csv`` by the name and the first line; None where a file is no trajectory."""
    path = Path(path)
    if SUFFIXES.get(path.suffix.lower()) is None or not path.is_file():
        return None
    first = next((line.strip() for line in read_lines(path) if line.strip() and line[:1] != b"#"), b"")
    if path.suffix.lower() == ".csv":
        return "csv" if first.replace(b" ", b"") == _HEADER else None
    if path.suffix.lower() == ".txt":
        words = first.split()
        return _COLUMNS.get(len(words)) if words and not words[0][:1].isalpha() else None
    return SUFFIXES[path.suffix.lower()]


def read_trajectory(path: Path | str) -> Trajectory:
    """Read a trajectory of any format; stamps are NaN where the format has none.

    Raises
    ------
    DataError
        As the format's own reader does; a file that is no trajectory.
    """
    name = detect_trajectory(path)
    if name is None:
        raise DataError(
            f"{path}: expected a trajectory: TUM (8 columns), KITTI (12 columns) or CSV with scan,x,y,theta"
        )
    return {"tum": read_tum, "kitti": read_kitti, "csv": read_trajectory_csv}[name](path)


def write_trajectory(path: Path | str, trajectory: Trajectory, name: str) -> None:
    """Write a trajectory as ``tum``, ``kitti`` or ``csv``.

    Raises
    ------
    DataError
        TUM asked for a trajectory without stamps; the folder cannot be written to.
    """
    if name == "kitti":
        write_kitti(path, trajectory)
    elif name == "csv":
        rows = zip(trajectory.indices.tolist(), trajectory.poses.tolist(), strict=True)
        with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as out:
            out.write(_HEADER.decode() + "\n")
            out.writelines(f"{scan},{x!r},{y!r},{theta!r}\n" for scan, (x, y, theta) in rows)
    else:
        if np.isnan(trajectory.stamps).any():
            raise DataError(
                f"{path}: TUM has stamps, and the trajectory has none; say which log it is of: --stamps LOG"
            )
        write_tum(path, trajectory)


def with_stamps(trajectory: Trajectory, stamps: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Trajectory:
    """The trajectory with the stamps of its scans; ``stamps`` are those of all scans of the log.

    Raises
    ------
    DataError
        The trajectory names a scan that the log does not have.
    """
    beyond = trajectory.indices[trajectory.indices >= len(stamps)]
    if len(beyond):
        raise DataError(
            f"the trajectory names scan {beyond[0]}, but the log has {len(stamps):,} scans; expected the log that it "
            "was made from"
        )
    return Trajectory(stamps[trajectory.indices], trajectory.poses, trajectory.indices)
