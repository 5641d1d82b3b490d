"""One sweep of a planar laser scanner, as it was recorded."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Points, Pose, transform


@dataclass(frozen=True)
class ScanGeometry:
    """Where the beams of a scan point and which ranges count as returns.

    Parameters
    ----------
    angle_min : float
        Angle of the first beam in the sensor's frame (rad; 0 is straight ahead, counter-clockwise positive).
    angle_increment : float
        Angle from a beam to the next (rad).
    range_min : float
        Ranges below it are no returns (m).
    range_max : float
        Ranges at or over it are no returns (m).
    """

    angle_min: float
    angle_increment: float
    range_min: float = 0.0
    range_max: float = np.inf

    def angles(self, beams: int) -> NDArray[np.float64]:
        """Angles (rad) of the first ``beams`` beams, (beams,)."""
        return self.angle_min + self.angle_increment * np.arange(beams, dtype=np.float64)


def _origin() -> Pose:
    return np.zeros(3)


@dataclass(frozen=True, eq=False)
class LaserScan:
    """A scan: ranges as recorded, and what is needed to turn them into points.

    Nothing is dropped from ``ranges``: a reading that is no return (NaN, infinite, zero or negative, below
    ``range_min``, at or over ``range_max``) is left out only when points are made.

    Parameters
    ----------
    stamp : float
        When it was taken (s), as recorded. Stamps may repeat or step back; the order of scans is their index.
    ranges : float64 (B,)
        Measured ranges (m), any number of beams.
    geometry : ScanGeometry
        Beam angles and range limits.
    odometry : Pose
        Pose of the robot in the odometry frame when the scan was taken.
    laser_pose : Pose
        Pose of the laser in the robot's frame.
    index : int
        Number of the scan in its log, from 0.
    """

    stamp: float
    ranges: NDArray[np.float64]
    geometry: ScanGeometry
    odometry: Pose = field(default_factory=_origin)
    laser_pose: Pose = field(default_factory=_origin)
    index: int = 0

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """Which readings are returns, (B,)."""
        r, g = self.ranges, self.geometry
        return np.isfinite(r) & (r > 0.0) & (r >= g.range_min) & (r < g.range_max)

    @cached_property
    def points(self) -> Points:
        """Returns in the laser's frame in beam order, (N, 2) m."""
        valid = self.valid
        r = self.ranges[valid]
        angles = self.geometry.angles(len(self.ranges))[valid]
        return np.column_stack((r * np.cos(angles), r * np.sin(angles)))

    @cached_property
    def robot_points(self) -> Points:
        """Returns in the robot's frame in beam order, (N, 2) m."""
        return transform(self.laser_pose, self.points) if self.laser_pose.any() else self.points
