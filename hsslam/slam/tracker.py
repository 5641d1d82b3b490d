"""Front end: every scan is matched against the local submap, odometry predicts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher, MatchResult, Reference, SearchWindow
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, between, compose, wrap
from hsslam.slam.fusion import GATE, fuse, rotated, squared_mahalanobis
from hsslam.slam.motion import MotionModel, way
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import LocalSubmap
from hsslam.slam.windows import AGREEING, foreseen_window, known_within, match_within, search_window

EDGE = 0.9
"""An answer this far from the middle of the window, as a share of its half side, may be the edge of a better one."""

SOONER = 1.0 / 3.0
"""Share of the usual way to the next keyframe after which one is made where the submap explains too little."""

EDGE_GAIN = 0.02
"""An answer beyond the window is believed only if its score is this much higher: among many places one seems better."""

USUAL = 0.05
"""A scan fits as usual if its score is no further than this below those of the last scans."""

FORGETTING = 0.1
"""Share of the newest score in what is usual."""

RECOVERY_GAIN = 0.12
"""Odometry is overruled only by an answer whose score is this much higher: people who walk along see no motion."""

LEAP_GAIN = 0.06
"""By this much, where odometry leaps and the answer goes on as the robot went."""

STEADY = 2.0
"""This many times as much where odometry goes on as the robot went, and the answer does not: robots do not leap."""


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
        self._window = search_window(config.tracker.window)
        self._widest = search_window(config.tracker.recovery_window)
        self._submap = LocalSubmap(matcher, config.keyframes.submap_size)
        self._motion = MotionModel(config.graph)
        self._pose: Pose = np.zeros(3)
        self._covariance: NDArray[np.float64] = np.zeros((3, 3))
        self._usual_score = 1.0
        self.motion: Pose = np.zeros(3)
        """Motion predicted from the last scan but one to the last, in the frame of the former."""
        self.noise: NDArray[np.float64] = np.eye(3)
        """Its covariance (3, 3), in the frame of the last scan."""

        self.guessed = False
        """Whether nothing told of the last scan's pose: no match was believed, and odometry had not changed."""

    def start(self, scan: LaserScan, points: Points) -> None:
        """Begin with the first scan, the first keyframe."""
        self._motion.start(scan)
        self._submap.add(points, np.zeros(3))

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
        predicted, prior = compose(self._pose, moved), self._covariance + noise
        tracked = known if known is not None else self._match(scan, points, predicted, prior)
        self.motion, self.noise = moved, rotated(noise, predicted[2])
        newest = self._submap.newest
        pose, posterior = compose(newest, tracked.relative), rotated(tracked.covariance, -newest[2])
        self._usual_score += FORGETTING * (tracked.score - self._usual_score)
        self.guessed = not tracked.matched and self._motion.still(scan)
        self._motion.observe(scan, between(self._pose, pose))
        self._pose, self._covariance = pose, posterior
        return tracked

    def wants_keyframe(self, tracked: TrackedScan) -> bool:
        """Whether the scan is far enough from the newest keyframe to become one, or sees what the submap lacks."""
        x, y, theta = tracked.relative
        rules = self._config.keyframes
        share = 1.0 if tracked.score >= rules.min_score else SOONER
        far = math.hypot(x, y) >= share * rules.distance
        return far or abs(theta) >= share * math.radians(rules.angle_deg)

    def add_keyframe(self, points: Points, tracked: TrackedScan) -> None:
        """Make the last scan the newest keyframe."""
        with self._stopwatch.measure("submap"):
            self._submap.add(points, tracked.relative)
        heading = self._pose[2]
        self._pose = self._submap.newest
        self._covariance = rotated(self._covariance, heading - self._pose[2])

    def _match(
        self, scan: LaserScan, points: Points, predicted: Pose, prior: NDArray[np.float64]
    ) -> TrackedScan:
        rules = self._config.tracker
        reference = self._submap.reference
        rng = generator(self._config.seed, Purpose.TRACK, scan.index)
        # A robot that turns far between two scans may have turned farther than the usual window reaches.
        window = foreseen_window(max(prior[0, 0], prior[1, 1]), prior[2, 2], self._window, self._widest)
        with self._stopwatch.measure("track"):
            result = match_within(self._matcher, reference, points, predicted, window, self._window, rng)
        # An outage looks like odometry that reports no motion: then it tells nothing that could be contradicted.
        told = not (self._motion.silent or self._motion.still(scan))
        leaps = told and self._motion.leaps(scan)
        if self._cut_off(result, predicted, window, told):
            with self._stopwatch.measure("recover"):
                result = self._look_further(reference, points, predicted, result, rng)
        if told and (_contradicts(result, predicted, prior) or result.score < rules.recovery_score):
            with self._stopwatch.measure("recover"):
                result = self._agree(reference, points, predicted, prior, leaps, result, rng)
        if not result.converged or result.score < rules.recovery_score:
            with self._stopwatch.measure("recover"):
                result = self._recover(reference, points, predicted, told, leaps, result, rng)
        matched = result.converged and result.score >= rules.min_score
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

    def _cut_off(self, result: MatchResult, predicted: Pose, window: SearchWindow, told: bool) -> bool:
        """Whether a better answer may lie beyond the edge of the window around the prediction, which odometry told."""
        off = result.pose - predicted
        off[2] = wrap(off[2])
        direction = result.diagnostics.get("degenerate_direction")
        if told and direction is not None and result.score >= self._usual_score - USUAL:
            # All places along it are as good, those at the edge too: a bare wall's are, if the scan fits as ever.
            along = np.array([math.cos(direction), math.sin(direction), 0.0])
            off -= (off @ along) * along
        return _at_edge(off, window)

    def _look_further(
        self,
        reference: Reference,
        points: Points,
        predicted: Pose,
        first: MatchResult,
        rng: np.random.Generator,
    ) -> MatchResult:
        """Search the widest window around the prediction: what a narrow one found at its edge was cut off by it."""
        wide = match_within(self._matcher, reference, points, predicted, self._widest, self._window, rng)
        evaluations = first.evaluations + wide.evaluations
        better = wide.converged and (not first.converged or wide.score > first.score + EDGE_GAIN)
        return self._settled(reference, points, wide if better else first, evaluations, rng)

    def _agree(
        self,
        reference: Reference,
        points: Points,
        predicted: Pose,
        prior: NDArray[np.float64],
        leaps: bool,
        first: MatchResult,
        rng: np.random.Generator,
    ) -> MatchResult:
        """Search only where odometry may be right: what fits about as well there is likelier than what denies it."""
        window = foreseen_window(max(prior[0, 0], prior[1, 1]), prior[2, 2], AGREEING, self._window)
        near = self._matcher.match(reference, points, predicted, window, rng)
        evaluations = first.evaluations + near.evaluations
        if not near.converged or near.score <= first.score - self._least_gain(predicted, first.pose, leaps):
            return replace(first, evaluations=evaluations)
        # What so narrow a window adds to the covariance is odometry's, and odometry is weighed by itself.
        return known_within(
            self._matcher, self._window, reference, points, replace(near, evaluations=evaluations)
        )

    def _least_gain(self, predicted: Pose, found: Pose, leaps: bool) -> float:
        """By how much an answer must score higher to overrule odometry: it matters which goes on as the robot went."""
        repeated = compose(self._pose, self._motion.last_motion)
        if way(predicted, repeated) < way(found, repeated):
            return STEADY * RECOVERY_GAIN
        return LEAP_GAIN if leaps else RECOVERY_GAIN

    def _recover(
        self,
        reference: Reference,
        points: Points,
        predicted: Pose,
        told: bool,
        leaps: bool,
        first: MatchResult,
        rng: np.random.Generator,
    ) -> MatchResult:
        """Doubt odometry: try the last motion once more as the prediction, then a wide window around it."""
        rules = self._config.tracker
        repeated = compose(self._pose, self._motion.last_motion)
        best = self._matcher.match(reference, points, repeated, self._window, rng)
        evaluations = first.evaluations + best.evaluations
        if not best.converged or best.score < rules.recovery_score:
            best = match_within(self._matcher, reference, points, repeated, self._widest, self._window, rng)
            evaluations += best.evaluations
        gain = self._least_gain(predicted, best.pose, leaps) if told else RECOVERY_GAIN
        if best.converged and (not first.converged or best.score > first.score + gain):
            return self._settled(reference, points, best, evaluations, rng)
        return replace(first, evaluations=evaluations)

    def _settled(
        self,
        reference: Reference,
        points: Points,
        found: MatchResult,
        evaluations: int,
        rng: np.random.Generator,
    ) -> MatchResult:
        """Search once more around what was found far off: the wide window, too, may have cut it off."""
        near = self._matcher.match(reference, points, found.pose, self._window, rng)
        evaluations += near.evaluations
        if not near.converged or near.score < found.score - EDGE_GAIN:
            return replace(found, evaluations=evaluations)
        return known_within(
            self._matcher, self._widest, reference, points, replace(near, evaluations=evaluations)
        )


def _at_edge(off: Pose, window: SearchWindow) -> bool:
    return bool((np.abs(off) > EDGE * window.half).any())


def _contradicts(result: MatchResult, predicted: Pose, prior: NDArray[np.float64]) -> bool:
    """Whether a match and the prediction cannot both be right."""
    off = result.pose - predicted
    off[2] = wrap(off[2])
    return result.converged and squared_mahalanobis(off, prior + result.covariance) > GATE
