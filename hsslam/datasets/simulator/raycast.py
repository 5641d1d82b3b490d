"""Exact ranges from a pose to the edges of a floor plan."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.scan import ScanGeometry
from hsslam.se2 import Poses


def raycast(
    segments: NDArray[np.float64], poses: Poses, geometry: ScanGeometry, beams: int
) -> NDArray[np.float64]:
    """Distance along each beam to the first edge it meets.

    Parameters
    ----------
    segments : float64 (S, 4)
        x1, y1, x2, y2 of each edge (m).
    poses : Poses
        (N, 3) poses of the laser, or one of shape (3,).
    geometry : ScanGeometry
        Angle of the first beam and from beam to beam (positive); the range limits are not applied.
    beams : int
        Beams of a scan.

    Returns
    -------
    float64 (N, beams), or (beams,) for one pose
        Metres; infinite where a beam meets nothing.

    Raises
    ------
    ValueError
        Beams that do not run counter-clockwise, or more than once around.
    """
    if not 0.0 < geometry.angle_increment * max(beams - 1, 1) <= 2.0 * math.pi + 1e-9:
        raise ValueError("beams run counter-clockwise (angle_increment > 0) and at most once around")
    many = np.ascontiguousarray(np.atleast_2d(poses), dtype=np.float64)
    segments = np.ascontiguousarray(segments, dtype=np.float64)
    ranges = _cast(segments, many, geometry.angle_min, geometry.angle_increment, beams)
    return ranges if np.ndim(poses) == 2 else ranges[0]


@kernel
def _cast(
    segments: NDArray[np.float64], poses: Poses, angle_min: float, increment: float, beams: int
) -> NDArray[np.float64]:
    # Seen from a pose, an edge covers one interval of angles: only the beams in it are intersected with it.
    ranges = np.full((poses.shape[0], beams), np.inf)
    cosine, sine = np.empty(beams), np.empty(beams)
    turn = 2.0 * math.pi
    for i in range(poses.shape[0]):
        x, y, first_angle = poses[i, 0], poses[i, 1], poses[i, 2] + angle_min
        for k in range(beams):
            cosine[k] = math.cos(first_angle + k * increment)
            sine[k] = math.sin(first_angle + k * increment)
        for j in range(segments.shape[0]):
            px, py = segments[j, 0] - x, segments[j, 1] - y
            ex, ey = segments[j, 2] - segments[j, 0], segments[j, 3] - segments[j, 1]
            # Twice the area of the triangle to the edge; its sign tells on which side of it the laser is.
            area = px * ey - py * ex
            if area == 0.0:
                continue
            dot = px * (px + ex) + py * (py + ey)
            sweep = abs(math.atan2(area, dot))
            start = math.atan2(py, px) if area > 0.0 else math.atan2(py + ey, px + ex)
            start = (start - first_angle) % turn
            for _ in range(2):
                # The margin keeps a beam that runs exactly into a corner from slipping between two edges.
                low = max(math.ceil(start / increment - 1e-7), 0)
                high = min(math.floor((start + sweep) / increment + 1e-7), beams - 1)
                for k in range(low, high + 1):
                    across = cosine[k] * ey - sine[k] * ex
                    if across != 0.0:
                        distance = area / across
                        if 0.0 < distance < ranges[i, k]:
                            ranges[i, k] = distance
                start -= turn
    return ranges
