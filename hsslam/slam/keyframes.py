"""What a run has seen: all its keyframes, and maps of some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, Poses, between_many
from hsslam.slam.free_space import FreeSpace
from hsslam.slam.sessions import Sessions, chosen
from hsslam.slam.submap import merge


@dataclass(frozen=True, eq=False)
class Keyframes:
    """All keyframes, as they are known by now.

    Parameters
    ----------
    scans : sequence of LaserScan
        Theirs, in order, without what the laser saw of the robot itself.
    points : sequence of Points
        (N_i, 2) m of each, in its own frame: returns of what stays where it is, in the order of the beams.
    poses : Poses
        (K, 3) where they are.
    sessions : Sessions
        Which of them are known relative to one another.
    """

    scans: Sequence[LaserScan]
    points: Sequence[Points]
    poses: Poses
    sessions: Sessions

    def __len__(self) -> int:
        return len(self.points)

    def submap(self, numbers: NDArray[np.int64], origin: Pose) -> Points:
        """Points of some of them (N, 2) m, as seen from ``origin``, keyframe after keyframe."""
        return merge(chosen(self.points, numbers), self.poses[numbers], origin)

    def free_space(self, numbers: NDArray[np.int64], origin: Pose | None = None) -> FreeSpace:
        """What some of them saw to be empty, in the frame of ``origin``: the map's if left out."""
        lasers = [scan.laser_pose for scan in chosen(self.scans, numbers)]
        poses = self.poses[numbers]
        if origin is not None:
            poses = between_many(np.tile(origin, (len(numbers), 1)), poses)
        return FreeSpace.seen_by(chosen(self.points, numbers), lasers, poses)
