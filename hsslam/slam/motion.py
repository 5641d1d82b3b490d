"""Where the next scan is expected: odometry's motion, or the last motion once more where odometry is silent."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.config import GraphSection
from hsslam.scan import LaserScan
from hsslam.se2 import Pose, between, compose, wrap
from hsslam.slam.clock import ScanClock

SILENT_AFTER = 2
"""Odometry is silent when it has not changed over this many scans while the matches moved."""

MOVING = 0.02
"""A match that moved by this much (m, or m + rad) moved."""

LEAP = 0.2
"""Odometry leaps when its motion from one scan to the next differs by more than this from the one before (m + rad)."""

UNSTEADY = 0.3
"""Share of the change of odometry's motion, from one scan to the next, that may be its error (standard deviation)."""

AT_SPEED = 0.15
"""A robot slower than this (m/s) may come to rest from one scan to the next; odometry tells how a faster one brakes."""

LOST = 1.0
"""The robot is lost where it may have gone this far (m) since something last told of its motion."""

FADING = 0.8
"""Share of a motion that is left a scan later where neither odometry nor a match tells of it."""

REST_STD_XY = 0.002
REST_STD_THETA = math.radians(0.05)
"""Standard deviations of odometry that reports no motion (m, rad)."""


def way(start: Pose, end: Pose) -> float:
    """Way from a pose to another (m + rad)."""
    x, y, theta = (end - start).tolist()
    return math.hypot(x, y) + abs(wrap(theta))


def _length(motion: Pose) -> float:
    """Length of a motion (m + rad)."""
    x, y, theta = motion.tolist()
    length: float = math.hypot(x, y) + abs(theta)
    return length


def _diagonal(xy: float, theta: float) -> NDArray[np.float64]:
    """Covariance (3, 3) of a position known as well in all directions (m^2), and of a heading (rad^2)."""
    out = np.zeros((3, 3))
    out[0, 0] = out[1, 1] = xy
    out[2, 2] = theta
    return out


class MotionModel:
    """Predicts motion from scan to scan.

    A log without odometry, and an outage in the middle of one, look alike: the same odometry pose again and
    again while the scans tell of motion. The last motion, scaled to the time that passed, then stands in
    (constant velocity), until odometry changes again.

    Parameters
    ----------
    config : GraphSection
        How good odometry is.
    """

    def __init__(self, config: GraphSection) -> None:
        self._config = config
        self._odometry: Pose = np.zeros(3)
        self._last_step: Pose = np.zeros(3)
        self._last_motion: Pose = np.zeros(3)
        self._last_seconds = 0.0
        self._middle: Pose = np.zeros(3)
        self._clock = ScanClock()
        self._silent = 0
        self._told: Pose = np.zeros(3)
        self._told_at = 0.0
        self._untold = 0

    @property
    def last_motion(self) -> Pose:
        """What the scans said between the middles of the last two sweeps."""
        return self._last_motion

    @property
    def silent(self) -> bool:
        """Whether odometry has stopped telling of motion."""
        return self._silent >= SILENT_AFTER

    @property
    def lost(self) -> bool:
        """Whether the robot may have gone far while neither odometry nor a match told of its motion."""
        return self._untold * math.hypot(self._told[0], self._told[1]) > LOST

    def still(self, scan: LaserScan) -> bool:
        """Whether odometry says the same of a scan as of the last."""
        same: bool = scan.odometry.tolist() == self._odometry.tolist()
        return same

    def leaps(self, scan: LaserScan) -> bool:
        """Whether odometry's motion to a scan is unlike the one before: wheels slip, messages come late."""
        return way(self._last_step, between(self._odometry, scan.odometry)) > LEAP

    def paused(self, scan: LaserScan) -> bool:
        """Whether the recording paused before a scan, or its stamp was late."""
        return self._clock.paused(scan.stamp)

    def pause(self, scan: LaserScan) -> float:
        """How long the recording paused before a scan, or nothing told of motion (s): infinite if stamps go back."""
        return max(self._clock.pause(scan.stamp), scan.stamp - self._told_at if self._untold else 0.0)

    def surely_paused(self, scan: LaserScan) -> bool:
        """Whether the recording paused before a scan, and no stamp was late for long."""
        return self._clock.paused(scan.stamp) and self._clock.steady(scan.stamp)

    def _held(self, scan: LaserScan) -> bool:
        """Whether odometry says the same as for the last scan, or said so then, although the robot moved."""
        return _length(self._last_motion) > MOVING and (self.still(scan) or not self._last_step.any())

    def start(self, scan: LaserScan) -> None:
        """Begin with the first scan."""
        self._odometry = scan.odometry
        self._clock.observe(scan.stamp)

    def predict(self, scan: LaserScan) -> tuple[Pose, NDArray[np.float64]]:
        """Motion since the last scan, in its frame, and the motion's covariance (3, 3)."""
        if not self.silent:
            moved = between(self._odometry, scan.odometry)
            xy, theta = self._variances(moved)
            unsteady_xy, unsteady_theta = self._unsteady(moved)
            noise = _diagonal(xy + unsteady_xy, theta + unsteady_theta)
            return moved, noise + self._may_go_on() if self.still(scan) else noise
        moved = self._last_motion * self._stretch(scan.stamp)
        xy, theta = self._variances(moved)
        return moved, _diagonal(xy + 0.05**2, theta + math.radians(3.0) ** 2)

    def velocity(self, scan: LaserScan) -> Pose:
        """Velocity (m/s, m/s, rad/s) from the last scan to this, in the robot's frame; 0 where stamps do not tell.

        A sweep takes no longer than the time to the next scan. Where odometry leaps, or comes with some scans only,
        the last motion goes on.
        """
        seconds = self._clock.since_last(scan.stamp)
        if seconds == 0.0:
            return np.zeros(3)
        seconds = max(seconds, abs(scan.geometry.time_increment) * len(scan.ranges))
        goes_on = self._last_seconds > 0.0 and (self.leaps(scan) or self._held(scan))
        moved = self._last_motion * self._stretch(scan.stamp) if goes_on else self.predict(scan)[0]
        # The step of a motion at constant velocity: the logarithm of SE(2).
        half = 0.5 * moved[2]
        scale = half / math.tan(half) if abs(half) > 1e-9 else 1.0
        step = np.array([scale * moved[0] + half * moved[1], scale * moved[1] - half * moved[0], moved[2]])
        return step / seconds

    def observe(self, scan: LaserScan, motion: Pose, matched: bool) -> None:
        """Take note of the motion from the last scan to this, and whether a match told it.

        A sweep whose beams were moved by too much velocity is matched too far back, by half of that: only its middle
        is where it seems to be. Velocities told from stamp to stamp would swing ever wider, from scan to scan.
        """
        middle = scan.middle
        motion = between(self._middle, compose(motion, middle))
        self._middle = middle
        still, seconds = self.still(scan), self._clock.since_last(scan.stamp)
        if self.silent and still and not matched:
            motion = FADING * motion
        if still and not (matched or self.silent):
            self._untold += 1
        else:
            x, y, _ = motion.tolist()
            at_speed = math.hypot(x, y) > AT_SPEED * seconds > 0.0
            self._told = motion if at_speed else np.zeros(3)
            self._told_at, self._untold = scan.stamp, 0
        if not still:
            self._silent = 0
        elif _length(motion) > MOVING:
            self._silent += 1
        self._last_step = between(self._odometry, scan.odometry)
        self._last_motion, self._last_seconds = motion, seconds
        self._odometry = scan.odometry
        self._clock.observe(scan.stamp)

    def covariance(self, moved: Pose) -> NDArray[np.float64]:
        """Covariance (3, 3) of an odometry motion."""
        return _diagonal(*self._variances(moved))

    def _variances(self, moved: Pose) -> tuple[float, float]:
        """Variances of an odometry motion's position (m^2) and heading (rad^2)."""
        travel = _length(moved)
        xy = (self._config.odometry_std_xy * travel) ** 2 + REST_STD_XY**2
        theta = (math.radians(self._config.odometry_std_theta_deg) * travel) ** 2 + REST_STD_THETA**2
        return xy, theta

    def _unsteady(self, moved: Pose) -> tuple[float, float]:
        """What a motion unlike the last adds to these variances: messages come late, and wheels slip."""
        x, y, theta = (moved - self._last_step).tolist()
        return (UNSTEADY * math.hypot(x, y)) ** 2, (UNSTEADY * wrap(theta)) ** 2

    def _may_go_on(self) -> NDArray[np.float64]:
        """What it adds to a motion's covariance (3, 3) that nothing tells of it, nor of those before.

        The robot may stand, as odometry says, or go on as it went at speed when something last told: all the way.
        """
        before = self._untold
        if not before:
            return np.zeros((3, 3))
        growth = (before + 1) ** 2 - (before**2 if before > 1 else 0)
        xy, theta = self._told[0] ** 2 + self._told[1] ** 2, self._told[2] ** 2
        return growth * np.diag([xy, xy, theta])

    def _stretch(self, stamp: float) -> float:
        """Time since the last scan over the time before it; 1 where stamps are no help."""
        seconds = self._clock.since_last(stamp)
        if self._last_seconds == 0.0 or seconds == 0.0 or not self._clock.steady(stamp):
            return 1.0
        return min(max(seconds / self._last_seconds, 0.25), 4.0)
