"""The last step of a search: from a found basin to the pose at its bottom."""

from __future__ import annotations

from hsslam.kernels.refine import refine
from hsslam.matching.interface import Reference
from hsslam.se2 import Points, Pose

FIRST_REACH = 0.15
LAST_REACH = 0.08
"""The refinement uses points this near to the surface (m), from the first iteration to the last."""

CAUCHY_SCALE = 0.03
"""Scale of the refinement's robust weight (m)."""


def polish(reference: Reference, points: Points, start: Pose, iterations: int) -> tuple[Pose, int]:
    """Refine a pose by point-to-line Gauss-Newton, as population matchers do: the pose, iterations spent."""
    surface = reference.surface
    pose, spent, _ = refine(
        surface.pieces,
        surface.nearest,
        surface.frame,
        points,
        start,
        iterations,
        FIRST_REACH,
        LAST_REACH,
        CAUCHY_SCALE,
    )
    return pose, spent
