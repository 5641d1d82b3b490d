"""Submaps: the points of several keyframes in one frame, merged at once or grown keyframe by keyframe."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hsslam.matching.interface import Matcher, Reference
from hsslam.se2 import Points, Pose, Poses, between, compose, transform
from hsslam.slam.free_space import FreeSpace


def merge(points: Sequence[Points], poses: Poses, origin: Pose) -> Points:
    """Points of all keyframes as seen from a pose.

    Parameters
    ----------
    points : sequence of Points
        One (N_i, 2) array per keyframe, in its own frame, beams in order.
    poses : Poses
        (K, 3), one per keyframe, all in one frame.
    origin : Pose
        The pose whose frame the result is in.

    Returns
    -------
    Points
        (sum of N_i, 2) m, keyframe after keyframe, so that beams stay in order.
    """
    return np.concatenate(
        [transform(between(origin, pose), p) for p, pose in zip(points, poses, strict=True)]
    )


class GrowingSubmap:
    """A submap in the frame of its first keyframe; keyframes are added to it, none is ever taken out.

    Parameters
    ----------
    matcher : Matcher
        Prepares and extends the reference.
    points : Points
        (N, 2) m, of the first keyframe, in the order of the beams, in the robot's frame.
    laser : Pose
        Its laser, there.
    """

    def __init__(self, matcher: Matcher[Any], points: Points, laser: Pose) -> None:
        self._matcher = matcher
        self.reference: Reference = matcher.prepare(points)
        self.newest: Pose = np.zeros(3)
        """The newest keyframe, seen from the first."""
        self.size = 1
        self.free_space = FreeSpace()
        """Where its keyframes saw that there is nothing."""
        self.free_space.add(points, laser, self.newest)

    def add(self, points: Points, laser: Pose, relative: Pose) -> None:
        """Add a keyframe, seen from the newest one; of its (N, 2) points those are left out that are in free space."""
        self.newest = compose(self.newest, relative)
        lasting = self.free_space.outside(points, self.newest)
        self.reference = self._matcher.extend(self.reference, transform(self.newest, lasting))
        self.free_space.add(points, laser, self.newest)
        self.size += 1


class LocalSubmap:
    """What the newest scans are matched against: the older of two growing submaps that overlap by half.

    The younger one takes over when the older is full, so between half of ``size`` and ``size`` keyframes are
    seen at any time (fewer only at the start), and adding a keyframe costs the same however many there are.

    Parameters
    ----------
    matcher : Matcher
        Prepares and extends the references.
    size : int
        Keyframes in a full submap.
    """

    def __init__(self, matcher: Matcher[Any], size: int) -> None:
        self._matcher = matcher
        self._size = size
        self._growing: list[GrowingSubmap] = []

    def add(self, points: Points, laser: Pose, relative: Pose) -> None:
        """Add a keyframe's (N, 2) points and its laser; ``relative``: the keyframe seen from the newest one, if any."""
        for submap in self._growing:
            submap.add(points, laser, relative)
        if not self._growing or self._growing[-1].size > self._size // 2:
            self._growing.append(GrowingSubmap(self._matcher, points, laser))
        if self._growing[0].size > self._size:
            del self._growing[0]

    @property
    def current(self) -> GrowingSubmap:
        """What to match against."""
        return self._growing[0]

    @property
    def newest(self) -> Pose:
        """The newest keyframe in the frame of the current submap."""
        return self.current.newest
