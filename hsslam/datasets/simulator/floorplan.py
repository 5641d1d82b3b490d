"""What a simulated world is: the outlines of solid things, and the round a robot makes among them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Points


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """A planar world.

    Parameters
    ----------
    name : str
        What the command line calls it.
    description : str
        One line.
    solids : tuple of Points
        Outlines (K, 2) m of walls and objects, each a closed polygon; they may overlap.
    route : Points
        (W, 2) m, the corners of the closed round that the robot drives, again and again.
    """

    name: str
    description: str
    solids: tuple[Points, ...]
    route: Points

    @cached_property
    def segments(self) -> NDArray[np.float64]:
        """Edges of all outlines, (S, 4): x1, y1, x2, y2 in metres."""
        return np.vstack([np.hstack((solid, np.roll(solid, -1, axis=0))) for solid in self.solids])

    @property
    def size(self) -> tuple[float, float]:
        """Extent along x and y (m)."""
        points = np.vstack(self.solids)
        extent = points.max(axis=0) - points.min(axis=0)
        return float(extent[0]), float(extent[1])

    def inside_solid(self, points: Points) -> NDArray[np.bool_]:
        """Which of the points (N, 2) are within some outline (even-odd rule per outline), (N,)."""
        x, y = points[:, :1], points[:, 1:]
        within = np.zeros(len(points), dtype=np.bool_)
        for solid in self.solids:
            x1, y1 = solid[:, 0], solid[:, 1]
            x2, y2 = np.roll(x1, -1), np.roll(y1, -1)
            straddles = (y1 > y) != (y2 > y)
            rise = np.where(y2 == y1, 1.0, y2 - y1)
            crosses = straddles & (x < x1 + (y - y1) * (x2 - x1) / rise)
            within |= crosses.sum(axis=1) % 2 == 1
        return within

    def clearance(self, points: Points) -> NDArray[np.float64]:
        """Distance (m) from each of the points (N, 2) to the nearest edge, (N,)."""
        start, edge = self.segments[:, :2], self.segments[:, 2:] - self.segments[:, :2]
        squared = np.maximum((edge**2).sum(axis=1), 1e-12)
        nearest = np.empty(len(points))
        for first in range(0, len(points), 1024):
            to_point = points[first : first + 1024, None, :] - start
            share = np.clip((to_point * edge).sum(axis=2) / squared, 0.0, 1.0)
            offset = to_point - share[..., None] * edge
            nearest[first : first + 1024] = np.sqrt((offset**2).sum(axis=2).min(axis=1))
        return nearest
