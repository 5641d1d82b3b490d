"""Along a corridor little tells where one is: a look up and down the direction that a scan hardly fixes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.fitness import evaluate, scale, scratch
from hsslam.kernels.raster import Raster
from hsslam.matching.interface import SearchWindow
from hsslam.se2 import Points, Pose

WEAK = 0.2
"""A direction is hardly fixed where this share of what fixes the other one fixes it, or less."""

GAIN = 0.04
"""Share of the points that a pose elsewhere along the direction must hit in addition."""


def slide(
    raster: Raster,
    points: Points,
    lines: NDArray[np.float64],
    pose: Pose,
    guess: Pose,
    window: SearchWindow,
    step: float,
) -> tuple[Pose | None, int]:
    """Look along the direction that a scan's lines hardly fix, as far as the window goes, for a better pose.

    In a corridor a search comes to rest wherever both walls fit: door frames and ends, which would tell, are few of the
    points that it looks at, and within reach of the refinement only once they are nearly right.

    Parameters
    ----------
    raster : Raster
        Of the reference.
    points : Points
        (N, 2) m, the scan.
    lines : float64 (N, 3)
        The scan's, see `hsslam.kernels.surface.lines_of`.
    pose, guess : Pose
        Where the refinement ended, and the middle of the window.
    window : SearchWindow
        What the pose may not leave.
    step : float
        From a pose that is looked at to the next (m).

    Returns
    -------
    (Pose or None, int)
        The pose with most hits, if it has `GAIN` more than ``pose``, and how many poses were looked at.
    """
    better, found, looked = slid(raster.cells, raster.frame, points, lines, pose, guess, window.half, step)
    return (found if better else None), looked


@kernel
def weak_direction(lines: NDArray[np.float64]) -> float:
    """Direction (rad), in the scan's frame, that (N, 3) lines hardly fix; NaN if they fix every one."""
    xx = xy = yy = 0.0
    for i in range(lines.shape[0]):
        xx += lines[i, 0] * lines[i, 0]
        xy += lines[i, 0] * lines[i, 1]
        yy += lines[i, 1] * lines[i, 1]
    middle = 0.5 * (xx + yy)
    root = math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
    if middle - root > WEAK * (middle + root):
        return math.nan
    return 0.5 * math.atan2(2.0 * xy, xx - yy) + 0.5 * math.pi


@kernel
def slid(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    pose: Pose,
    guess: Pose,
    half: NDArray[np.float64],
    step: float,
) -> tuple[bool, Pose, int]:
    """As `slide`: whether a better pose was found, that pose, poses looked at.

    The raster's arrays come first, ``half`` (3,) are the half sides of the window.
    """
    best = pose.copy()
    direction = weak_direction(lines)
    if math.isnan(direction):
        return False, best, 0
    count = points.shape[0]
    scaled = scale(points, lines, frame, count)
    flat, xs, ys, facing, index = cells.reshape(cells.size), scaled[0], scaled[1], scaled[2], scratch()
    x, y, theta = pose
    here = evaluate(flat, cells.shape, frame, xs, ys, facing, count, x, y, theta, 0, index)
    ux, uy = math.cos(theta + direction), math.sin(theta + direction)
    most, spent = here, 1
    steps = int(2.0 * math.hypot(half[0], half[1]) / step)
    for k in range(-steps, steps + 1):
        x, y = pose[0] + k * step * ux, pose[1] + k * step * uy
        if k == 0 or abs(x - guess[0]) > half[0] or abs(y - guess[1]) > half[1]:
            continue
        spent += 1
        hits = evaluate(flat, cells.shape, frame, xs, ys, facing, count, x, y, theta, most + 1, index)
        if hits > most:
            most = hits
            best[0], best[1] = x, y
    return most - here > GAIN * frame[3] * count, best, spent
