"""One sweep of a planar laser scanner, as it was recorded."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points, Pose, pose, transform


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
    time_increment : float
        Time from a beam to the next (s); 0 where all are taken at once, or nothing is known of it.
    """

    angle_min: float
    angle_increment: float
    range_min: float = 0.0
    range_max: float = np.inf
    time_increment: float = 0.0

    def angles(self, beams: int) -> NDArray[np.float64]:
        """Angles (rad) of the first ``beams`` beams, (beams,)."""
        return self.angle_min + self.angle_increment * np.arange(beams, dtype=np.float64)


@lru_cache(maxsize=16)
def _directions(geometry: ScanGeometry, beams: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosines and sines of the beams' angles, which a log's scans have in common."""
    angles = geometry.angles(beams)
    return np.cos(angles), np.sin(angles)


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
        When its first beam was taken (s), as recorded. Stamps may repeat or step back; the order of scans is their
        index.
    ranges : float64 (B,)
        Measured ranges (m), any number of beams.
    geometry : ScanGeometry
        Beam angles and range limits.
    odometry : Pose
        Pose of the robot in the odometry frame at the stamp.
    laser_pose : Pose
        Pose of the laser in the robot's frame.
    index : int
        Number of the scan in its log, from 0.
    velocity : Pose
        Velocity of the robot while the beams went round (m/s, m/s, rad/s), in its own frame: `robot_points` are
        moved by it to where the robot of the stamp sees them. Zero: they are left as recorded.
    """

    stamp: float
    ranges: NDArray[np.float64]
    geometry: ScanGeometry
    odometry: Pose = field(default_factory=_origin)
    laser_pose: Pose = field(default_factory=_origin)
    index: int = 0
    velocity: Pose = field(default_factory=_origin)

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """Which readings are returns, (B,)."""
        r, g = self.ranges, self.geometry
        return np.isfinite(r) & (r > 0.0) & (r >= g.range_min) & (r < g.range_max)

    @cached_property
    def points(self) -> Points:
        """Returns in the laser's frame in beam order, (N, 2) m."""
        ranges = np.ascontiguousarray(self.ranges, dtype=np.float64)
        cosines, sines = _directions(self.geometry, len(ranges))
        return _returns(ranges, cosines, sines, self.geometry.range_min, self.geometry.range_max)

    @cached_property
    def robot_points(self) -> Points:
        """Returns in the frame of the robot at the stamp, counter-clockwise, (N, 2) m.

        That is the order of the beams, or its reverse where they run clockwise: it tells a wall's two sides apart.
        """
        points = transform(self.laser_pose, self.points) if self.laser_pose.any() else self.points
        if self.geometry.time_increment != 0.0 and self.velocity.any():
            seconds = self.geometry.time_increment * np.flatnonzero(self.valid)
            points = _moved(points, seconds[:, None] * self.velocity)
        return points if self.geometry.angle_increment > 0.0 else points[::-1].copy()

    @property
    def middle(self) -> Pose:
        """The robot in the middle of the sweep, seen from the robot at the stamp, as `velocity` has it."""
        if self.geometry.time_increment == 0.0 or not self.velocity.any():
            return np.zeros(3)
        twist = 0.5 * self.geometry.time_increment * len(self.ranges) * self.velocity
        x, y = _moved(np.zeros((1, 2)), twist[None])[0]
        return pose(x, y, twist[2])


@kernel
def _returns(
    ranges: NDArray[np.float64],
    cosines: NDArray[np.float64],
    sines: NDArray[np.float64],
    range_min: float,
    range_max: float,
) -> Points:
    """Points of the readings that are `LaserScan.valid`, along beams of these cosines and sines (B,)."""
    points = np.empty((ranges.shape[0], 2))
    count = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if math.isfinite(r) and r > 0.0 and range_min <= r < range_max:
            points[count, 0], points[count, 1] = r * cosines[i], r * sines[i]
            count += 1
    return points[:count].copy()


def _moved(points: Points, twists: NDArray[np.float64]) -> Points:
    """Points, each seen after a motion by its twist (N, 3), as seen before it: the exponential map of SE(2)."""
    x, y, turn = twists.T
    # sin(turn) / turn and (1 - cos(turn)) / turn, which have limits at 0.
    along, across = np.sinc(turn / np.pi), np.sin(0.5 * turn) * np.sinc(0.5 * turn / np.pi)
    c, s = np.cos(turn), np.sin(turn)
    px, py = points.T
    return np.column_stack(
        (c * px - s * py + along * x - across * y, s * px + c * py + across * x + along * y)
    )
