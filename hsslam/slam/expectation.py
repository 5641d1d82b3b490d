"""What is known of a scan's pose before it is matched, and what of it a match denies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.matching.interface import SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Pose
from hsslam.slam.fusion import GATE, squared_mahalanobis
from hsslam.slam.motion import way
from hsslam.slam.windows import difference, foreseen_window

USUAL = 0.05
"""A scan fits as usual if its score is no further than this below those of the last scans."""

UNLIKE = 0.1
"""Odometry's motion is unlike the last one where it leads this far (m + rad) from where that leads."""

RECOVERY_GAIN = 0.12
"""Odometry is overruled only by an answer whose score is this much higher: people who walk along see no motion."""

LEAP_GAIN = 0.06
"""By this much, where odometry leaps and the answer goes on as the robot went."""

IMPOSSIBLE = 1.0
"""By none at all, where odometry leaps further than this (m + rad) from where the robot was going."""

TURNED_LOSS = 0.1
"""By so much less, where the other answer denies odometry as much: a corridor looks alike both ways."""

STEADY = 2.0
"""This many times as much where odometry goes on as the robot went, and the answer does not: robots do not leap."""


@dataclass(frozen=True, eq=False)
class Expectation:
    """What is known of a scan's pose before it is matched.

    Attributes
    ----------
    pose : Pose
        Where odometry says that it is, in the submap.
    covariance : float64 (3, 3)
        Of that pose (m^2, rad^2).
    repeated : Pose
        Where it is if the robot moved as it did before.
    told : bool
        Whether odometry tells of motion: an outage looks like a robot at rest, and cannot be contradicted.
    leaps : bool
        Whether odometry's motion is unlike the one before.
    score : float
        What the last scans scored.
    paused : bool
        Whether the recording paused: the robot may have been moved meanwhile, and odometry not know of it.
    """

    pose: Pose
    covariance: NDArray[np.float64]
    repeated: Pose
    told: bool
    leaps: bool
    score: float
    paused: bool = False

    def window(self, least: SearchWindow, most: SearchWindow) -> SearchWindow:
        """As far as the truth may be from the expected pose, between two other windows."""
        variances = self.covariance
        return foreseen_window(max(variances[0, 0], variances[1, 1]), variances[2, 2], least, most)

    @property
    def goes_on(self) -> bool:
        """Whether odometry goes on as the robot went: no message of it is late."""
        return way(self.pose, self.repeated) <= UNLIKE

    def contradicts(self, found: MatchResult) -> bool:
        """Whether a match and what is expected cannot both be right."""
        off = difference(found.pose, self.pose)
        return found.converged and squared_mahalanobis(off, self.covariance + found.covariance) > GATE

    def belies(self, found: MatchResult) -> bool:
        """Whether an answer fits less than usual, and the robot did not go on: a message of odometry may be late."""
        return found.score < self.score - USUAL and not self.goes_on

    def least_gain(self, found: Pose) -> float:
        """By how much an answer must score higher to overrule odometry: it matters which goes on as the robot went."""
        if not self.told:
            return RECOVERY_GAIN
        if way(self.pose, self.repeated) < way(found, self.repeated):
            return STEADY * RECOVERY_GAIN
        return LEAP_GAIN if self.leaps else RECOVERY_GAIN

    def steady_gain(self, found: Pose) -> float:
        """By how much an answer where the robot was going must score higher than another one."""
        leap = way(self.pose, self.repeated)
        if leap < IMPOSSIBLE:
            return LEAP_GAIN
        return -TURNED_LOSS if self.leaps and way(self.pose, found) > 0.5 * leap else 0.0
