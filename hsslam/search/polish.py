"""The last step of a search: from a found basin to the pose at its bottom."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.refine import refine
from hsslam.kernels.window import inside, kept
from hsslam.matching.interface import Reference, SearchWindow
from hsslam.se2 import Points, Pose

SETTLE = 4.0
"""Iterations after which reach and scale would be zero if they went on to shrink."""

REACHES = (0.15, 0.08)
"""The refinement uses points this near to the surface (m), from the first iteration to the last."""

SCALES = (0.10, 0.02)
"""Scale of the refinement's robust weight (m), from the first iteration to the last."""


WINDOW_SLACK = 0.4
"""A refined pose outside the window by up to this share of its half sides is moved onto its edge.

Where a truth lies near the edge, noise alone carries the refined pose across it."""


@kernel
def polished(
    pieces: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    start: Pose,
    guess: Pose,
    half: NDArray[np.float64],
    iterations: int,
) -> tuple[Pose, int]:
    """As `polish`; the reference's surface comes first, ``half`` (3,) are the half sides of the window."""
    pose, spent, _ = refine(pieces, nearest, frame, points, lines, start, iterations, SETTLE, REACHES, SCALES)
    pose = kept(guess, half, pose, WINDOW_SLACK)
    return (pose if inside(guess, half, pose) else start.copy()), spent


def polish(
    reference: Reference,
    points: Points,
    lines: NDArray[np.float64],
    start: Pose,
    guess: Pose,
    window: SearchWindow,
    iterations: int,
) -> tuple[Pose, int]:
    """Refine a pose by Gauss-Newton, points to lines and `scan_lines` to points: the pose, iterations spent.

    A refinement that leads away from the window is discarded: then the pose is ``start``.
    """
    surface = reference.surface
    return polished(
        surface.pieces,
        surface.nearest,
        surface.frame,
        points,
        lines,
        start,
        guess,
        window.half,
        iterations,
    )
