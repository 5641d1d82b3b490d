"""What the keyframes of a submap saw: where a scan's returns tell against a pose, and where nobody had looked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.kernels.sight import agreement, sight_of
from hsslam.matching.interface import Reference
from hsslam.se2 import Points, Pose, compose


class Sight:
    """How far keyframes saw in every direction, in one frame."""

    def __init__(self) -> None:
        self._reaches: list[NDArray[np.float64]] = []
        self._lasers: list[Pose] = []

    def add(self, points: Points, laser: Pose, pose: Pose) -> None:
        """Add a keyframe at ``pose``; its (N, 2) points and its laser are in the robot's frame."""
        self._reaches.append(sight_of(points, laser))
        x, y, _ = compose(pose, laser)
        self._lasers.append(np.array([x, y, pose[2]]))

    def agreement(
        self, reference: Reference, points: Points, laser: Pose, pose: Pose, distance: float
    ) -> float:
        """Share of a scan's returns that lie on the known surface, of those that do or should.

        Parameters
        ----------
        reference : Reference
            The keyframes' points, prepared.
        points : Points
            (N, 2) m, the scan's returns in the robot's frame.
        laser : Pose
            The laser that they come from, there.
        pose : Pose
            Of the robot, in the reference's frame.
        distance : float
            Returns within it of the surface lie on it (m).

        Returns
        -------
        float
            1 where nothing tells against the pose, however little of the scan is known; 0 where nothing tells for it.
        """
        surface = reference.surface
        return agreement(
            surface.pieces,
            surface.nearest,
            surface.frame,
            np.array(self._reaches),
            np.array(self._lasers),
            reference.points,
            points,
            laser,
            pose,
            distance,
        )
