"""Point-to-line ICP with correspondences from a raster of the nearest surface that reaches far."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.kernels.refine import NO_LINES, refine
from hsslam.kernels.surface import Surface, rasterise_nearest
from hsslam.matching.interface import Reference
from hsslam.se2 import Points, Pose

RESOLUTION = 0.1
"""Side of a cell of the far raster (m); the last stage uses the surface's own, which is finer."""

SWING = 0.005
"""A pose that goes to and fro by less than this (m, rad) at the end has arrived."""


class PointToLineReference(Reference):
    """A reference whose nearest segment is known from afar.

    Parameters
    ----------
    points : Points
        (N, 2) m in beam order.
    reach : float
        How far from the surface (m).
    surface : Surface, optional
        Through the points, where it is known.
    """

    def __init__(self, points: Points, reach: float, surface: Surface | None = None) -> None:
        super().__init__(points, surface)
        self.far: NDArray[np.uint32]
        self.far_frame: NDArray[np.float64]
        self.far, self.far_frame = rasterise_nearest(self.surface.segments, RESOLUTION, reach)


def point_to_line_icp(
    reference: PointToLineReference,
    points: Points,
    guess: Pose,
    iterations: int,
    distances: tuple[float, float, float],
    scales: tuple[float, float],
) -> tuple[Pose, int, bool]:
    """Move a pose from a guess to where points lie on the lines of a reference (Censi, "An ICP variant ...", 2008).

    Two stages: the first reaches far, its correspondences shrinking from ``distances[0]`` to ``distances[1]``;
    the second is precise, from there to ``distances[2]``.

    Parameters
    ----------
    reference : PointToLineReference
        What is matched against.
    points : Points
        (N, 2) m, the scan.
    guess : Pose
        Where to begin.
    iterations : int
        Of each stage, at most.
    distances : (float, float, float)
        Reaches of a correspondence (m); the last two at most the surface's own, 0.15 m.
    scales : (float, float)
        Of the Cauchy weight in each stage (m).

    Returns
    -------
    (Pose, int, bool)
        The pose, iterations spent, and whether the last stage came to rest, or to and fro within `SWING`.
    """
    surface = reference.surface
    coarse, first, _ = refine(
        surface.pieces,
        reference.far,
        reference.far_frame,
        points,
        NO_LINES,
        guess,
        iterations,
        0.5 * (iterations - 1),
        (distances[0], distances[1]),
        (scales[0], scales[0]),
    )
    fine, second, converged = refine(
        surface.pieces,
        surface.nearest,
        surface.frame,
        points,
        NO_LINES,
        coarse,
        iterations,
        0.5 * (iterations - 1),
        (distances[1], distances[2]),
        (scales[1], scales[1]),
    )
    if not converged:
        # Points that change from one line to the next and back keep the pose swinging, mostly by millimetres.
        last, third, _ = refine(
            surface.pieces,
            surface.nearest,
            surface.frame,
            points,
            NO_LINES,
            fine,
            2,
            1.0,
            (distances[2], distances[2]),
            (scales[1], scales[1]),
        )
        second += third
        converged = third > 0 and bool((np.abs(last - fine) < SWING).all())
    return fine, first + second, converged
