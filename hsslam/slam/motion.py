"""Where the next scan is expected: odometry's motion, or the last motion once more where odometry is silent."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.config import GraphSection
from hsslam.jit import kernel
from hsslam.scan import LaserScan
from hsslam.se2 import Pose, between

SILENT_AFTER = 2
"""Odometry is silent when it has not changed over this many scans while the matches moved."""

MOVING = 0.02
"""A match that moved by this much (m, or m + rad) moved."""

LEARNING_RATE = 0.02
"""Share of the newest scan in what is known of odometry's noise: it is a matter of the last fifty scans."""

FIRST_FACTOR = 4.0
FACTORS = (0.05, 50.0)
"""Odometry's variances in terms of the configured ones: at the start, and their bounds."""

REST_STD_XY = 0.002
REST_STD_THETA = math.radians(0.05)
"""Standard deviations of odometry that reports no motion (m, rad)."""


class MotionModel:
    """Predicts motion from scan to scan.

    A log without odometry, and an outage in the middle of one, look alike: the same odometry pose again and
    again while the scans tell of motion. The last motion, scaled to the time that passed, then stands in
    (constant velocity), until odometry changes again.

    How good odometry is, is learned: the configured figures are scaled, separately for position and heading, so
    that the differences between predictions and matches are as large as their covariances say.

    Parameters
    ----------
    config : GraphSection
        How good odometry is thought to be.
    """

    def __init__(self, config: GraphSection) -> None:
        self._config = config
        self._odometry: Pose = np.zeros(3)
        self._stamp = 0.0
        self._last_motion: Pose = np.zeros(3)
        self._last_seconds = 0.0
        self._silent = 0
        self._factors = np.array([FIRST_FACTOR, FIRST_FACTOR])

    @property
    def last_motion(self) -> Pose:
        """What the scans said between the last two."""
        return self._last_motion

    @property
    def silent(self) -> bool:
        """Whether odometry has stopped telling of motion."""
        return self._silent >= SILENT_AFTER

    def start(self, scan: LaserScan) -> None:
        """Begin with the first scan."""
        self._odometry, self._stamp = scan.odometry, scan.stamp

    def predict(self, scan: LaserScan) -> tuple[Pose, NDArray[np.float64]]:
        """Motion since the last scan, in its frame, and the motion's covariance (3, 3)."""
        if not self.silent:
            moved = between(self._odometry, scan.odometry)
            return moved, self.covariance(moved)
        moved = self._last_motion * self._stretch(scan.stamp - self._stamp)
        return moved, self.covariance(moved) + np.diag([0.05**2, 0.05**2, math.radians(3.0) ** 2])

    def observe(self, scan: LaserScan, motion: Pose) -> None:
        """Take note of what the match of a scan said about the motion since the last."""
        still = bool((scan.odometry == self._odometry).all())
        if not still:
            self._silent = 0
        elif math.hypot(motion[0], motion[1]) + abs(motion[2]) > MOVING:
            self._silent += 1
        self._last_motion, self._last_seconds = motion, scan.stamp - self._stamp
        self._odometry, self._stamp = scan.odometry, scan.stamp

    def learn(
        self,
        correction: Pose,
        noise: NDArray[np.float64],
        prior: NDArray[np.float64],
        posterior: NDArray[np.float64],
    ) -> None:
        """Compare a prediction with what became of it.

        Parameters
        ----------
        correction : Pose
            The pose found, less the pose predicted.
        noise : float64 (3, 3)
            Of the motion, as `predict` gave it.
        prior, posterior : float64 (3, 3)
            Covariance of the pose before and after the match; their difference tells the match's own, and how
            far the pose followed it.
        """
        if self.silent:
            return
        self._factors = learned(self._factors, correction, noise, prior, posterior)

    def covariance(self, moved: Pose) -> NDArray[np.float64]:
        """Covariance (3, 3) of an odometry motion."""
        travel = math.hypot(moved[0], moved[1]) + abs(moved[2])
        xy = (self._config.odometry_std_xy * travel) ** 2 + REST_STD_XY**2
        theta = (math.radians(self._config.odometry_std_theta_deg) * travel) ** 2 + REST_STD_THETA**2
        out = np.zeros((3, 3))
        out[0, 0] = out[1, 1] = xy * self._factors[0]
        out[2, 2] = theta * self._factors[1]
        return out

    def _stretch(self, seconds: float) -> float:
        """Time since the last scan over the time before it; 1 where stamps are no help."""
        if self._last_seconds <= 0.0 or seconds <= 0.0:
            return 1.0
        return min(max(seconds / self._last_seconds, 0.25), 4.0)


@kernel
def learned(
    factors: NDArray[np.float64],
    correction: Pose,
    noise: NDArray[np.float64],
    prior: NDArray[np.float64],
    posterior: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Factors (2,) of odometry's variances after one more scan; see `MotionModel.learn`."""
    seen = np.zeros(3)
    for i in range(3):
        p, c, q = prior[i, i], posterior[i, i], noise[i, i]
        gain = min(max(1.0 - c / p, 0.1), 1.0)
        match = 1.0 / max(1.0 / c - 1.0 / p, 1e-9)
        seen[i] = ((correction[i] / gain) ** 2 - (p - q) - match) / q
    out = factors.copy()
    for k, value in enumerate((0.5 * (seen[0] + seen[1]), seen[2])):
        bounded = min(max(value * factors[k], 0.0), FACTORS[1])
        out[k] += LEARNING_RATE * (bounded - factors[k])
        out[k] = min(max(out[k], FACTORS[0]), FACTORS[1])
    return out
