"""Front end: every scan is matched against the local submap, odometry predicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.kernels.joints import widths_of
from hsslam.matching.interface import Matcher
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, Poses, between, compose
from hsslam.slam.expectation import Expectation
from hsslam.slam.fusion import fuse, largest_variance, rotated, share_left
from hsslam.slam.locator import UNFIT, Locator, is_piece
from hsslam.slam.motion import Evidence, MotionModel
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.sessions import Pause
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import LocalSubmap

SOONER = 1.0 / 3.0
"""Share of the usual way to the next keyframe after which one is made where the submap explains too little."""

LEAST_RETURNS = 10
"""Returns that a match must explain to be believed: fewer fit in many a place."""

RETURNS_OF_THE_LOST = 30
"""So many where the robot may be anywhere around, not near odometry's prediction alone."""

LEAST_WIDTHS = (5.0, 3.0)
"""Things no wider than this (m), together and each, do not contradict steady odometry: people, trees, bushes."""

ANYWHERE = np.diag([20.0**2, 20.0**2, 1.0])
"""Covariance (m^2, rad^2) of a motion of which nothing is known."""

FORGETTING = 0.1
"""Share of the newest score in what is usual."""


@dataclass(frozen=True, eq=False)
class TrackedScan:
    """A scan seen from the newest keyframe; the fields are those of `hsslam.slam.events.Tracked`."""

    relative: Pose
    covariance: NDArray[np.float64]
    score: float
    matched: bool
    evaluations: int


class Tracker:
    """Knows the local submap and where the last scan is in it.

    Parameters
    ----------
    config : Config
        Its ``tracker``, ``keyframes`` and ``graph`` sections and its seed.
    matcher : Matcher
        Matches scans against the submap.
    stopwatch : Stopwatch
        Told how long preparing and matching took.
    """

    def __init__(self, config: Config, matcher: Matcher[Any], stopwatch: Stopwatch) -> None:
        self._config = config
        self._matcher = matcher
        self._stopwatch = stopwatch
        self._submap = LocalSubmap(matcher, config.keyframes.submap_size)
        self._motion = MotionModel(config.graph)
        self._pose: Pose = np.zeros(3)
        self._covariance: NDArray[np.float64] = np.zeros((3, 3))
        self._held_covariance = self._covariance
        self.usual_score = 1.0
        """What the last scans scored."""
        self._matched = False
        self.motion: Pose = np.zeros(3)
        """Motion predicted from the last scan but one to the last, in the frame of the former."""
        self.noise: NDArray[np.float64] = np.eye(3)
        """Its covariance (3, 3), in the frame of the last scan."""

        self.pause: Pause | None = None
        """Before the last scan, if that may be from anywhere: it does not fit where it should."""

        self.guessed = False
        """Whether nothing told of the last scan's pose: no match was believed, and odometry had not changed."""

    def start(self, scan: LaserScan, points: Points) -> None:
        """Begin with the first scan, the first keyframe."""
        self._motion.start(scan)
        self._submap.add(points, scan.laser_pose, np.zeros(3))

    def deskewed(self, scan: LaserScan) -> LaserScan:
        """The next scan, with the velocity at which its beams went round; as it is where that is not to be undone."""
        if not self._config.tracker.deskew or scan.geometry.time_increment == 0.0:
            return scan
        return replace(scan, velocity=self._motion.velocity(scan))

    def track(self, scan: LaserScan, points: Points, known: TrackedScan | None = None) -> TrackedScan:
        """Find a scan's pose seen from the newest keyframe.

        Parameters
        ----------
        scan : LaserScan
            The next scan.
        points : Points
            (N, 2) m, its returns in the robot's frame.
        known : TrackedScan, optional
            What an earlier, interrupted run found for it: taken as it is.
        """
        moved, noise = self._motion.predict(scan)
        noise = rotated(noise, -self._pose[2])
        before = self._held_covariance if self._motion.late(scan) else self._covariance
        predicted, prior = compose(self._pose, moved), before + noise
        tracked = known if known is not None else self._match(scan, points, predicted, prior)
        newest = self._submap.newest
        unfit = not tracked.matched or tracked.score < self.usual_score - UNFIT
        found_again = self._motion.lost and len(points) >= RETURNS_OF_THE_LOST
        self.pause = None
        if unfit and (self._motion.paused(scan) or found_again):
            noise = ANYWHERE
            tracked = replace(tracked, relative=between(newest, predicted), covariance=noise, matched=False)
            self.pause = Pause(tracked.relative, self._motion.pause(scan))
        else:
            self.usual_score += FORGETTING * (tracked.score - self.usual_score)
        self.motion, self.noise = moved, rotated(noise, predicted[2])
        pose, posterior = compose(newest, tracked.relative), rotated(tracked.covariance, -newest[2])
        self.guessed = not tracked.matched and self._motion.still(scan) and self.pause is None
        evidence = Evidence(tracked.matched)
        if tracked.matched and self._motion.still(scan):
            variance = max(largest_variance(self._covariance), largest_variance(posterior))
            evidence = Evidence(True, share_left(prior, posterior), math.sqrt(variance))
        self._motion.observe(scan, between(self._pose, pose), evidence)
        if not self._motion.held:
            self._held_covariance = posterior
        self._pose, self._covariance = pose, posterior
        self._matched = tracked.matched
        return tracked

    def lasting(self, points: Points) -> Points:
        """Of the last scan's (N, 2) points, in the robot's frame, those that are not in the middle of free space."""
        return self._submap.current.free_space.outside(points, self._pose) if self._matched else points

    def wants_keyframe(self, tracked: TrackedScan) -> bool:
        """Whether the scan is far enough from the newest keyframe to become one, or sees what the submap lacks."""
        if self.pause is not None:
            return True
        x, y, theta = tracked.relative.tolist()
        rules = self._config.keyframes
        share = 1.0 if tracked.score >= rules.min_score else SOONER
        far = math.hypot(x, y) >= share * rules.distance
        return far or abs(theta) >= share * math.radians(rules.angle_deg)

    def add_keyframe(self, points: Points, laser: Pose, tracked: TrackedScan) -> None:
        """Make the last scan the newest keyframe; its (N, 2) points and its laser are in the robot's frame.

        A scan that may have been taken anywhere begins a new submap.
        """
        if self.pause is not None:
            self._submap = LocalSubmap(self._matcher, self._config.keyframes.submap_size)
            self._covariance = self._held_covariance = np.zeros((3, 3))
        with self._stopwatch.measure("submap"):
            self._submap.add(points, laser, tracked.relative)
        self._stand_on_newest()

    def relearn(self, points: Sequence[Points], lasers: Sequence[Pose], poses: Poses) -> None:
        """Make the submap anew; the last scan is the newest keyframe.

        Parameters
        ----------
        points : sequence of Points
            (N_i, 2) m of every keyframe in its own frame, one array each.
        lasers : sequence of Pose
            Of every keyframe, in its frame.
        poses : Poses
            (K, 3) where they are, all in one frame.
        """
        size = self._config.keyframes.submap_size
        self._submap = LocalSubmap(self._matcher, size)
        with self._stopwatch.measure("submap"):
            for k in range(max(len(poses) - size, 0), len(poses)):
                self._submap.add(points[k], lasers[k], between(poses[max(k - 1, 0)], poses[k]))
        self._stand_on_newest()

    def _stand_on_newest(self) -> None:
        """Take the newest keyframe's pose for the last scan's, which it is, in the frame of the current submap."""
        heading = self._pose[2]
        self._pose = self._submap.newest
        turned = heading - self._pose[2]
        self._covariance = rotated(self._covariance, turned)
        self._held_covariance = rotated(self._held_covariance, turned)

    def _match(
        self, scan: LaserScan, points: Points, predicted: Pose, prior: NDArray[np.float64]
    ) -> TrackedScan:
        rules = self._config.tracker
        paused = self._motion.surely_paused(scan)
        told = not (paused or self._motion.silent or self._motion.still(scan))
        expected = Expectation(
            pose=predicted,
            covariance=prior,
            repeated=compose(self._pose, self._motion.last_motion),
            told=told,
            leaps=told and self._motion.leaps(scan),
            score=self.usual_score,
            paused=paused,
        )
        rng = generator(self._config.seed, Purpose.TRACK, scan.index)
        result = Locator(rules, self._matcher, self._submap.current, points, rng, self._stopwatch).locate(
            expected
        )
        explained = result.score * len(points)
        least = RETURNS_OF_THE_LOST if self._motion.lost else LEAST_RETURNS
        matched = result.converged and result.score >= rules.min_score and explained >= least
        if matched and expected.contradicts(result):
            matched = not is_piece(points)
            if told and not expected.leaps:
                together, widest = widths_of(points, np.ones(len(points), dtype=np.bool_))
                matched &= together >= LEAST_WIDTHS[0] or widest >= LEAST_WIDTHS[1]
        if not matched:
            pose, covariance = predicted, prior
        elif rules.fuse_odometry:
            pose, covariance = fuse(predicted, prior, result.pose, result.covariance)
        else:
            pose, covariance = result.pose, result.covariance
        newest = self._submap.newest
        return TrackedScan(
            between(newest, pose), rotated(covariance, newest[2]), result.score, matched, result.evaluations
        )
