"""What keyframes saw to be empty: a return in the middle of it is of somebody who walks by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hsslam.kernels.free_space import CELL, FARTHEST, in_free_space, mark, unseen
from hsslam.kernels.growth import make_room
from hsslam.se2 import Points, Pose, Poses, compose

MOST_CELLS = 4000
"""Cells per side, at most: beyond, no space is known to be free."""


class FreeSpace:
    """A raster that grows with the keyframes that are added to it, in the frame of their poses."""

    def __init__(self) -> None:
        self._cells: NDArray[np.uint8] = np.zeros((3, 3), dtype=np.uint8)
        self._frame: NDArray[np.float64] = np.array([-1.5 * CELL, -1.5 * CELL, 1.0 / CELL])

    @classmethod
    def seen_by(cls, points: Sequence[Points], lasers: Sequence[Pose], poses: Poses) -> FreeSpace:
        """What many keyframes saw; the arguments are those of `add`, one of each a keyframe."""
        space = cls()
        for args in zip(points, lasers, poses, strict=True):
            space.add(*args)
        return space

    def add(self, points: Points, laser: Pose, pose: Pose) -> None:
        """Add a keyframe at ``pose``: (N, 2) points in the order of the beams, and the laser, in the robot's frame."""
        x, y, _ = compose(pose, laser).tolist()
        low, high = (x - FARTHEST, y - FARTHEST), (x + FARTHEST, y + FARTHEST)
        room = make_room(self._cells, self._frame, low, high, 0, MOST_CELLS)
        if room is not None:
            self._cells, self._frame = room
            mark(self._cells, self._frame, points, laser, pose)

    def holds(self, points: Points, pose: Pose) -> NDArray[np.bool_]:
        """Which of a scan's (N, 2) points are of things in the middle of it, the robot being at ``pose``, (N,)."""
        return in_free_space(self._cells, self._frame, points, pose)

    def lacks(self, points: Points, pose: Pose) -> NDArray[np.bool_]:
        """Which of a scan's (N, 2) points lie where nothing is known yet, the robot being at ``pose``, (N,)."""
        return unseen(self._cells, self._frame, points, pose)

    def outside(self, points: Points, pose: Pose) -> Points:
        """The other points of the scan: those of what stays where it is."""
        held = self.holds(points, pose)
        return points[~held] if held.any() else points
