"""Parts of the robot in its laser's view: they stay where they are, seen from there, wherever the robot goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hsslam.kernels.own_parts import BINS, of_parts, ranges_of_parts, watch
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, compose, inverse, transform, wrap

REACH = 0.1
"""Returns this near to a part count as its own (m)."""

SLACK = 0.5 * REACH
"""A part that seems to have moved by less than this is where it was (m)."""


class OwnParts:
    """What keyframes see that moves along with the laser."""

    def __init__(self) -> None:
        self._seen: NDArray[np.float64] = np.zeros((BINS, 8))
        self._heading = 0.0
        self._any = False
        self.ranges: NDArray[np.float64] = np.full(BINS, np.nan)
        """How far from the laser a part is in each direction (m), (BINS,); NaN where there is none."""

    def __bool__(self) -> bool:
        return self._any

    @property
    def degrees(self) -> float:
        """How much of the view they hide."""
        return float(np.count_nonzero(~np.isnan(self.ranges))) * 360.0 / BINS

    def watch(self, scan: LaserScan, pose: Pose) -> bool:
        """Look at another keyframe, as recorded, with the robot at ``pose``; whether there are parts not known yet."""
        x, y, heading = compose(pose, scan.laser_pose)
        self._heading += wrap(heading - self._heading)
        watch(self._seen, scan.points, np.array([x, y, self._heading]))
        found = ranges_of_parts(self._seen)
        there = ~np.isnan(found)
        new = there & ~(np.abs(found - self.ranges) < SLACK)
        self.ranges, self._any = np.where(there & ~new, self.ranges, found), bool(there.any())
        return bool(new.any())

    def without(self, scan: LaserScan) -> LaserScan:
        """The scan, its returns from parts of the robot turned into none."""
        if not self:
            return scan
        valid = np.flatnonzero(scan.valid)
        theirs = valid[of_parts(self.ranges, scan.points, REACH)]
        if len(theirs) == 0:
            return scan
        ranges = scan.ranges.astype(np.float64)
        ranges[theirs] = np.inf
        return replace(scan, ranges=ranges)

    def outside(self, points: Points, laser: Pose) -> Points:
        """Of (N, 2) points in the robot's frame, seen by a laser at ``laser``, those that are of no part of it."""
        theirs = of_parts(self.ranges, transform(inverse(laser), points), REACH)
        return points[~theirs] if theirs.any() else points
