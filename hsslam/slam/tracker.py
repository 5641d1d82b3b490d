"""Front end: every scan is matched against the local submap, odometry predicts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config, WindowSection
from hsslam.matching.interface import Matcher, MatchResult, Reference, SearchWindow
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, Poses, between, compose
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.recovery import match_tiles
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import merge

RECOVERY_GAIN = 0.1
"""Odometry is overruled only by an answer whose score is this much higher."""


@dataclass(frozen=True, eq=False)
class TrackedScan:
    """A scan seen from the newest keyframe; the fields are those of `hsslam.slam.events.Tracked`."""

    relative: Pose
    covariance: NDArray[np.float64]
    score: float
    matched: bool
    evaluations: int


def search_window(section: WindowSection) -> SearchWindow:
    """The window a config section describes."""
    return SearchWindow(section.half_x, section.half_y, math.radians(section.half_theta_deg))


class Tracker:
    """Knows the newest keyframes and where the last scan was seen from the newest of them.

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
        self._points: list[Points] = []
        self._poses: list[Pose] = []
        self._reference: Reference | None = None
        self._last_relative: Pose = np.zeros(3)
        self._last_odometry: Pose = np.zeros(3)
        self._last_motion: Pose = np.zeros(3)

    def track(self, scan: LaserScan, known: TrackedScan | None = None) -> TrackedScan:
        """Find a scan's pose seen from the newest keyframe.

        Parameters
        ----------
        scan : LaserScan
            The next scan.
        known : TrackedScan, optional
            What an earlier, interrupted run found for it: taken as it is.
        """
        tracked = known if known is not None else self._match(scan)
        self._last_motion = between(self._last_relative, tracked.relative)
        self._last_relative, self._last_odometry = tracked.relative, scan.odometry
        return tracked

    def wants_keyframe(self, tracked: TrackedScan) -> bool:
        """Whether the scan is far enough from the newest keyframe to become one."""
        x, y, theta = tracked.relative
        rules = self._config.keyframes
        return math.hypot(x, y) >= rules.distance or abs(theta) >= math.radians(rules.angle_deg)

    def add_keyframe(self, scan: LaserScan, tracked: TrackedScan | None) -> None:
        """Make a scan the newest keyframe; ``tracked`` is None for the very first."""
        pose = np.zeros(3) if tracked is None else compose(self._poses[-1], tracked.relative)
        self._points.append(scan.robot_points)
        self._poses.append(pose)
        size = self._config.keyframes.submap_size
        del self._points[:-size], self._poses[:-size]
        self._reference = None
        self._last_relative, self._last_odometry = np.zeros(3), scan.odometry

    def _match(self, scan: LaserScan) -> TrackedScan:
        moved = between(self._last_odometry, scan.odometry)
        predicted = compose(self._last_relative, moved)
        if self._reference is None:
            with self._stopwatch.measure("prepare"):
                poses: Poses = np.array(self._poses)
                self._reference = self._matcher.prepare(merge(self._points, poses, len(poses) - 1))
        rules = self._config.tracker
        rng = generator(self._config.seed, Purpose.TRACK, scan.index)
        with self._stopwatch.measure("track"):
            result = self._matcher.match(self._reference, scan.robot_points, predicted, self._window, rng)
        if not result.converged or result.score < rules.recovery_score:
            with self._stopwatch.measure("recover"):
                result = self._recover(self._reference, scan, result, rng)
        if result.converged and result.score >= rules.min_score:
            return TrackedScan(result.pose, result.covariance, result.score, True, result.evaluations)
        return TrackedScan(
            predicted, self._odometry_covariance(predicted), result.score, False, result.evaluations
        )

    def _recover(
        self, reference: Reference, scan: LaserScan, first: MatchResult, rng: np.random.Generator
    ) -> MatchResult:
        """Doubt odometry: try the last motion once more as the prediction, then a wide window around it."""
        rules = self._config.tracker
        repeated = compose(self._last_relative, self._last_motion)
        best = self._matcher.match(reference, scan.robot_points, repeated, self._window, rng)
        evaluations = first.evaluations + best.evaluations
        if not best.converged or best.score < rules.recovery_score:
            wide = search_window(rules.recovery_window)
            best = match_tiles(self._matcher, reference, scan.robot_points, repeated, wide, self._window, rng)
            evaluations += best.evaluations
        better = best.converged and (not first.converged or best.score > first.score + RECOVERY_GAIN)
        return replace(best if better else first, evaluations=evaluations)

    def _odometry_covariance(self, relative: Pose) -> NDArray[np.float64]:
        graph = self._config.graph
        travel = math.hypot(relative[0], relative[1]) + abs(relative[2])
        xy = max(graph.odometry_std_xy * travel, 0.01)
        theta = math.radians(max(graph.odometry_std_theta_deg * travel, 0.2))
        return np.diag([xy * xy, xy * xy, theta * theta])
