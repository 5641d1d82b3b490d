"""Which neighbouring returns of a scan are of the same surface, and how wide what they are of is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points

NEAR = 0.35
"""Neighbouring returns this near to one another (m) are joined."""

SPACINGS = 5.0
"""How many times as far as neighbours usually are those may be that the surface beside them leads to."""

ENOUGH = 8
"""Returns that tell how far from one another neighbours usually are, at least."""

PLENTY = 60
"""Neighbours that are asked for it, about: a median needs no more."""

STRAIGHT = 0.15
"""Tangent of the angle by which a surface may turn on its way across such a gap."""

NARROWEST = 0.1
"""Width of a thing of which there is a single return (m)."""

ARM = 0.2
"""Length of the piece of surface that leads across, over the gap's, at least."""


@kernel
def joints_of(points: Points) -> NDArray[np.bool_]:
    """Whether each return and the next one are of the same surface, (N,); False for the last.

    Of those that are further apart than `NEAR`, as most are where beams are few or walls far away, only such as the
    piece of surface on one side leads across: without them a wall that is seen aslant would have no lines, the one
    beside the robot alone would count, and what grazing beams err by would turn every pose the same way. Two returns
    beside an edge, one near and one far, are no surface.

    Parameters
    ----------
    points : Points
        (N, 2) m, in the order of the beams; scans may follow one another.
    """
    n = points.shape[0]
    joined = np.zeros(n, dtype=np.bool_)
    farthest = SPACINGS * SPACINGS * usual_squared_spacing(points)
    for i in range(n - 1):
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        squared = dx * dx + dy * dy
        if squared <= NEAR * NEAR:
            joined[i] = True
        elif squared <= farthest:
            joined[i] = (i > 0 and _leads_on(points, i - 1, i, dx, dy)) or (
                i + 2 < n and _leads_on(points, i + 2, i + 1, -dx, -dy)
            )
    return joined


@kernel
def widths_of(points: Points, chosen: NDArray[np.bool_]) -> tuple[float, float]:
    """How wide the things are that chosen ones of a scan's points (N, 2) are of: all together, and the widest (m)."""
    joined = joints_of(points)
    together = here = widest = 0.0
    for i in range(points.shape[0]):
        if not chosen[i]:
            continue
        if i > 0 and chosen[i - 1] and joined[i - 1]:
            dx, dy = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
            step = np.sqrt(dx * dx + dy * dy)
            here += step
        else:
            here = step = NARROWEST
        together += step
        widest = max(widest, here)
    return together, widest


@kernel
def usual_squared_spacing(points: Points) -> float:
    """Median squared distance (m^2) of neighbouring returns, of some that are spread over all; 0 of too few."""
    n = points.shape[0]
    if n < ENOUGH:
        return 0.0
    step = 1 + n // PLENTY
    found = np.empty(n)
    count = 0
    for i in range(0, n - 1, step):
        dx, dy = points[i + 1, 0] - points[i, 0], points[i + 1, 1] - points[i, 1]
        found[count] = dx * dx + dy * dy
        count += 1
    return float(np.median(found[:count]))


@kernel
def _leads_on(points: Points, before: int, at: int, dx: float, dy: float) -> bool:
    """Whether the piece of surface from return ``before`` to ``at`` leads on to what is ``dx``, ``dy`` (m) further."""
    bx, by = points[at, 0] - points[before, 0], points[at, 1] - points[before, 1]
    if bx * bx + by * by < ARM * ARM * (dx * dx + dy * dy):
        return False
    along, across = bx * dx + by * dy, bx * dy - by * dx
    return bool(along > 0.0 and abs(across) <= STRAIGHT * along)
