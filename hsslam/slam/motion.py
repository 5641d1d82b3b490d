"""Where the next scan is expected: odometry's motion, or the last motion once more where odometry is silent."""

from __future__ import annotations

import math
from dataclasses import dataclass

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

UNLIKE = 0.1
"""A motion that a match tells is unlike odometry's at this distance (m + rad): part of it mended an error."""

UNSTEADY = 0.3
"""Share of the change of odometry's motion, from one scan to the next, that may be its error (standard deviation)."""

AT_SPEED = 0.15
"""A robot slower than this (m/s) may come to rest from one scan to the next; odometry tells how a faster one brakes."""

LOST = 1.0
"""The robot is lost where it may have gone this far (m) since something last told of its motion."""

FADING = 0.8
"""Share of a motion that is left a scan later where neither odometry nor a match tells of it."""

LEFT_OPEN = 0.5
"""A match that leaves more than this share of a position's variance along a direction tells nothing of the way."""

LEAST_CHANGE = 0.03
"""By so much a motion may change from one scan to the next (m), even of a robot at rest."""

SURE = (0.02, 0.25)
"""A motion is known if its ends are to this (m), or to this share of the motion before."""

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


@dataclass(frozen=True)
class Evidence:
    """What a match tells of the motion to a scan for which odometry says the same as for the last.

    Attributes
    ----------
    matched : bool
        Whether there is a match, and it is believed.
    left : float
        Share of the position's variance that it left where that is largest: 1 in a bare corridor.
    deviation : float
        Of the position, before or after, where it is least known (m): so much of the motion may be a correction.
    """

    matched: bool
    left: float = 0.0
    deviation: float = 0.0


def _adapted(before: Pose, motion: Pose, deviation: float) -> Pose:
    """A motion whose way is known to a deviation (m), between the one before and what it seems: robots go steadily."""
    changes = (UNSTEADY * math.hypot(before[0], before[1])) ** 2 + LEAST_CHANGE**2
    gain = changes / (changes + deviation**2)
    way_x, way_y = before[:2] + gain * (motion[:2] - before[:2])
    return np.array([way_x, way_y, motion[2]])


class MotionModel:
    """Predicts motion from scan to scan.

    A log without odometry, and an outage in the middle of one, look alike: the same odometry pose again and
    again while the scans tell of motion. The last motion, scaled to the time that passed, then stands in
    (constant velocity), until odometry changes again. Along a corridor scans tell of turns only: there the robot is
    taken to go on as when something last told how far it went, from where that was. Odometry that changes again may
    tell of the last motion alone, or of all that it did not tell before: see `_step`.

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
        self._meanwhile: Pose = np.zeros(3)
        self._held = 0
        self._placed = True
        self._owed: Pose = np.zeros(3)

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

    @property
    def held(self) -> bool:
        """Whether odometry said the same of the last scan as of the one before."""
        return self._held > 0

    def still(self, scan: LaserScan) -> bool:
        """Whether odometry says the same of a scan as of the last."""
        same: bool = scan.odometry.tolist() == self._odometry.tolist()
        return same

    def leaps(self, scan: LaserScan) -> bool:
        """Whether odometry's motion to a scan is unlike the one before: wheels slip, messages come late.

        Late odometry does not leap if it goes on from where matches told that the robot is, or, where they told
        nothing of its way, as fast as it went.
        """
        step = self._step(scan)
        if not self.late(scan):
            return way(self._last_step, step) > LEAP
        if self._untold or not self._placed:
            return way(self._told, between(self._odometry, scan.odometry) / (self._held + 1)) > LEAP
        return way(self._last_motion, step) > LEAP

    def paused(self, scan: LaserScan) -> bool:
        """Whether the recording paused before a scan, or its stamp was late."""
        return self._clock.paused(scan.stamp)

    def pause(self, scan: LaserScan) -> float:
        """How long the recording paused before a scan, or nothing told of motion (s): infinite if stamps go back."""
        return max(self._clock.pause(scan.stamp), scan.stamp - self._told_at if self._untold else 0.0)

    def surely_paused(self, scan: LaserScan) -> bool:
        """Whether the recording paused before a scan, and no stamp was late for long."""
        return self._clock.paused(scan.stamp) and self._clock.steady(scan.stamp)

    def _holds(self, scan: LaserScan) -> bool:
        """Whether odometry says the same as for the last scan, or said so then, although the robot moved."""
        return _length(self._last_motion) > MOVING and (self.still(scan) or not self._last_step.any())

    def start(self, scan: LaserScan) -> None:
        """Begin with the first scan."""
        self._odometry = scan.odometry
        self._clock.observe(scan.stamp)

    def predict(self, scan: LaserScan) -> tuple[Pose, NDArray[np.float64]]:
        """Motion since the last scan, in its frame, and the motion's covariance (3, 3)."""
        if not self.silent:
            moved = self._step(scan)
            xy, theta = self._variances(moved)
            unsteady_xy, unsteady_theta = self._unsteady(moved)
            noise = _diagonal(xy + unsteady_xy, theta + unsteady_theta)
            return moved, noise + self._may_go_on() if self.still(scan) else noise
        moved = self._last_motion * self._stretch(scan.stamp) + self._owed
        if not self.still(scan):
            step = self._step(scan)
            if self.late(scan) or way(moved, step) < LEAP:
                moved = step
        xy, theta = self._variances(moved)
        xy += self._owed[0] ** 2 + self._owed[1] ** 2
        return moved, _diagonal(xy + 0.05**2, theta + math.radians(3.0) ** 2)

    def late(self, scan: LaserScan) -> bool:
        """Whether odometry changes that said the same for a while, and tells all of the motion now.

        It may have missed that instead, and tell of the last one: what is more like the motion before is believed. What
        a robot at rest does is start, and where it stood is known better by now.
        """
        if not (self._held and self._told.any()) or self.still(scan):
            return False
        step = between(self._odometry, scan.odometry)
        return way(self._told, step / (self._held + 1)) < way(self._told, step)

    def _step(self, scan: LaserScan) -> Pose:
        """Odometry's motion to a scan, without what scans told of it already where it is late."""
        step = between(self._odometry, scan.odometry)
        return between(self._meanwhile, step) if self.late(scan) else step

    def velocity(self, scan: LaserScan) -> Pose:
        """Velocity (m/s, m/s, rad/s) from the last scan to this, in the robot's frame; 0 where stamps do not tell.

        A sweep takes no longer than the time to the next scan. Where odometry leaps, or comes with some scans only,
        the last motion goes on.
        """
        seconds = self._clock.since_last(scan.stamp)
        if seconds == 0.0:
            return np.zeros(3)
        seconds = max(seconds, abs(scan.geometry.time_increment) * len(scan.ranges))
        goes_on = self._last_seconds > 0.0 and (self.leaps(scan) or self._holds(scan))
        moved = self._last_motion * self._stretch(scan.stamp) if goes_on else self.predict(scan)[0]
        # The step of a motion at constant velocity: the logarithm of SE(2).
        half = 0.5 * moved[2]
        scale = half / math.tan(half) if abs(half) > 1e-9 else 1.0
        step = np.array([scale * moved[0] + half * moved[1], scale * moved[1] - half * moved[0], moved[2]])
        return step / seconds

    def observe(self, scan: LaserScan, motion: Pose, evidence: Evidence) -> None:
        """Take note of the motion from the last scan to this, and what tells of it.

        A sweep whose beams were moved by too much velocity is matched too far back, by half of that: only its middle
        is where it seems to be. Velocities told from stamp to stamp would swing ever wider, from scan to scan.
        """
        middle, still = scan.middle, self.still(scan)
        late, held = self.late(scan), self._held
        self._meanwhile = compose(self._meanwhile, motion) if still else np.zeros(3)
        self._held = held + 1 if still else 0
        motion = between(self._middle, compose(motion, middle))
        self._middle = middle
        seconds = self._clock.since_last(scan.stamp)
        was_silent = self.silent
        if not still:
            self._silent = 0
        elif _length(motion) > MOVING:
            self._silent += 1
        known = not still or (
            evidence.matched and evidence.deviation < max(SURE[0], SURE[1] * math.hypot(*self._told[:2]))
        )
        placed = known or (evidence.matched and evidence.left <= LEFT_OPEN)
        guessed = was_silent and not evidence.matched
        self._owed = np.zeros(3)
        if self.silent and evidence.matched and not known:
            before = self._last_motion if was_silent else self._told
            if not (placed or was_silent):
                self._owed = (self._untold + 1) * np.array([before[0], before[1], 0.0])
            doubt = 1.0 if placed and self._placed else 2.0
            motion = _adapted(before, motion, doubt * evidence.deviation)
        elif still and guessed:
            motion = FADING * motion
        if late:
            usual = between(self._odometry, scan.odometry) / (held + 1)
            motion = motion if way(motion, usual) < UNLIKE else usual
        if known or guessed or (self.silent and placed):
            x, y, _ = motion.tolist()
            at_speed = math.hypot(x, y) > AT_SPEED * seconds > 0.0
            self._told = motion if at_speed else np.zeros(3)
        self._placed = placed
        if placed or guessed:
            self._told_at, self._untold = scan.stamp, 0
        elif not was_silent:
            self._untold += 1
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

        The robot may stand, as odometry says, or go on as it went at speed when something last told: all the way. So it
        may where a match told how far it went while odometry was still.
        """
        before = self._untold
        if not (before or self._silent):
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
