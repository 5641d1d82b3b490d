"""From the pose that a search found to the answer: refined, and in corridors looked for up and down."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points, Pose
from hsslam.search.polish import polished
from hsslam.search.slide import slid


@kernel
def settle(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    surface_frame: NDArray[np.float64],
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    found: Pose,
    guess: Pose,
    half: NDArray[np.float64],
    iterations: int,
    step: float,
) -> tuple[Pose, int, int]:
    """Refine a pose; see `hsslam.search.polish` and, for corridors, `hsslam.search.slide`.

    Parameters
    ----------
    pieces, nearest, surface_frame : arrays
        Of the reference's `Surface`.
    cells, frame : arrays
        Of the raster that was searched.
    points : Points
        (N, 2) m, the scan.
    lines : float64 (N, 3)
        Through its points: see `hsslam.kernels.surface.scan_lines`.
    found, guess : Pose
        What the search found, and the middle of its window.
    half : float64 (3,)
        Half sides of the window (m, m, rad).
    iterations : int
        Of the refinement, at most.
    step : float
        From a pose that is looked at along a corridor to the next (m); 0 to look at none.

    Returns
    -------
    (Pose, int, int)
        The refined pose, iterations spent, and poses looked at along the corridor.
    """
    pose, spent = polished(pieces, nearest, surface_frame, points, lines, found, guess, half, iterations)
    looked = 0
    if step > 0.0:
        better, elsewhere, looked = slid(cells, frame, points, lines, pose, guess, half, step)
        if better:
            pose, more = polished(
                pieces, nearest, surface_frame, points, lines, elsewhere, guess, half, iterations
            )
            spent += more
    return pose, spent, looked
