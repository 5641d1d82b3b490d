"""Points as a PLY file, which CloudCompare, MeshLab and Open3D open."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hsslam.io.atomic import atomic_path
from hsslam.se2 import Points


def write_ply(path: Path | str, points: Points, scans: NDArray[np.int64]) -> None:
    """Write points of a map as binary PLY: x, y, z = 0 (m) as 64-bit floats and the number of the scan.

    Parameters
    ----------
    path : path
        The file.
    points : Points
        (N, 2) m in the frame of the map.
    scans : int64 (N,)
        Number of the scan that each point is from.

    Raises
    ------
    DataError
        The folder cannot be written to.
    """
    vertices = np.zeros(len(points), dtype=[("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("scan", "<i4")])
    vertices["x"], vertices["y"], vertices["scan"] = points[:, 0], points[:, 1], scans
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        "comment points of an hsslam map, metres\n"
        f"element vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\nproperty int scan\nend_header\n"
    )
    with atomic_path(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + vertices.tobytes())
