"""The whole of SLAM, as a generator of events: what listens to it is no business of its."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.errors import DataError
from hsslam.memory import give_back
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Poses, between_many, compose, compose_many, inverse
from hsslam.slam.events import (
    Edge,
    Event,
    KeyframeAdded,
    LoopChecked,
    Optimised,
    SlamResult,
    Tracked,
)
from hsslam.slam.graph import PoseGraph
from hsslam.slam.journal import Replay
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.loops import LoopCloser
from hsslam.slam.overlap import match_pairs, moved, overlapping_pairs
from hsslam.slam.own_parts import OwnParts
from hsslam.slam.relocalisation import Relocalisation
from hsslam.slam.rescan import match_scans, worth_a_match
from hsslam.slam.scan_pairs import match_with_keyframes
from hsslam.slam.scan_table import ScanTable
from hsslam.slam.sessions import Sessions
from hsslam.slam.smoothing import smooth
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.tracker import TrackedScan, Tracker
from hsslam.slam.verification import LoopVerifier
from hsslam.trajectory import Trajectory

AT_REST = 0.001
"""Rounds of refinement end when they move keyframes that overlap by less than this on average (m)."""


class Slam:
    """Simultaneous localisation and mapping, scan by scan.

    Parameters
    ----------
    config : Config, optional
        Everything that decides what happens; the defaults where left out.
    replay : Replay, optional
        Matches of an interrupted run of the same config on the same log; they are taken, not computed again.

    Raises
    ------
    ConfigError, MatcherUnavailableError
        If a matcher cannot be made.
    """

    def __init__(self, config: Config | None = None, replay: Replay | None = None) -> None:
        config = config if config is not None else Config()
        self._config = config
        self._replay = replay if replay is not None else Replay()
        self._stopwatch = Stopwatch()
        self._matcher = config.matcher.create()
        loop_matcher = config.loop_matcher.create() if config.loop_matcher is not None else self._matcher
        self._tracker = Tracker(config, self._matcher, self._stopwatch)
        self._closer = LoopCloser(config, loop_matcher, self._stopwatch)
        self._verifier = LoopVerifier(config.loops, self._ambiguity)
        self._relocalisation = Relocalisation(config, loop_matcher, self._stopwatch)
        self._sessions = Sessions()
        self._graph: PoseGraph | None = None
        self._keyframes: list[LaserScan] = []
        self._points: list[Points] = []
        self._loops: list[LoopChecked] = []
        self._scans = ScanTable()
        self._own_parts = OwnParts()
        self._matched = 0
        self._evaluations = 0
        self._guessed = 0
        self._first_guessed: int | None = None
        self._ended = False

    def run(self, scans: Iterable[LaserScan]) -> Iterator[Event]:
        """Process every scan of a log, then finish."""
        for scan in scans:
            yield from self.process(scan)
        yield from self.finish()

    def solve(self, scans: Iterable[LaserScan]) -> SlamResult:
        """Process every scan of a log, finish, and return what came of it; for those who need no events."""
        for _ in self.run(scans):
            pass
        return self.result()

    def process(self, scan: LaserScan) -> list[Event]:
        """Take the next scan, of a log or a live source.

        Returns
        -------
        list of Event
            First a `Tracked` with the scan's pose, then what followed from it.

        Raises
        ------
        DataError
            If the run was finished for the last time.
        """
        self._require_open()
        return list(self._process(scan))

    def _process(self, recorded: LaserScan) -> Iterator[Event]:
        scan = self._own_parts.without(recorded)
        if self._graph is None:
            self._graph = PoseGraph(self._config.graph, scan.odometry)
            self._tracker.start(scan, scan.robot_points)
            first = TrackedScan(np.zeros(3), np.eye(3) * 1e-12, 1.0, True, 0)
            yield self._record(scan, 0, first, scan.robot_points)
            yield self._keep(scan, scan.robot_points)
            self._watch(recorded)
            return
        scan = self._tracker.deskewed(scan)
        tracked = self._tracker.track(scan, scan.robot_points, self._replayed(scan.index))
        lasting = self._tracker.lasting(scan.robot_points)
        newest = len(self._graph) - 1
        yield self._record(scan, newest, tracked, lasting)
        if not self._tracker.wants_keyframe(tracked):
            return
        self._tracker.add_keyframe(scan.robot_points, scan.laser_pose, tracked)
        self._graph.add_keyframe(tracked.relative, tracked.covariance)
        self._scans.becomes_keyframe(newest + 1)
        yield self._keep(scan, lasting)
        self._watch(recorded)
        yield from self._close_loops()

    def _watch(self, keyframe: LaserScan) -> None:
        """Look for parts of the robot in the newest keyframe, and forget what was seen of new ones."""
        if not self._config.tracker.own_parts:
            return
        poses = self._require_graph().poses
        if not self._own_parts.watch(keyframe, poses[-1]):
            return
        # Copies again, as in `_keep`: looking for parts has made every scan remember its points.
        self._keyframes = [replace(self._own_parts.without(scan)) for scan in self._keyframes]
        self._points = [
            self._own_parts.outside(points, scan.laser_pose)
            for points, scan in zip(self._points, self._keyframes, strict=True)
        ]
        start = self._sessions.start(len(poses) - 1)
        lasers = [scan.laser_pose for scan in self._keyframes[start:]]
        self._tracker.relearn(self._points[start:], lasers, poses[start:])
        self._closer.release()

    def finish(self, last: bool = False) -> Iterator[Event]:
        """Optimise everything once more, match keyframes that overlap again from there, then every scan.

        Parameters
        ----------
        last : bool
            That no scan will follow: submaps and points are let go where they have served, which saves memory.
            Else the run may go on, and be finished again.

        Raises
        ------
        DataError
            If there was no scan, or the run was finished for the last time before.
        """
        self._require_open()
        self._ended = last
        graph = self._require_graph()
        for session in self._sessions.split()[1:]:
            yield from self._look_again(graph, session)
        if last:
            del self._tracker  # its submaps are of use to the next scan only
        self._forget_own_parts()
        yield from self._settle(self._verifier.close())
        self._closer.release()
        yield self._optimise("final")
        with self._stopwatch.measure("final"):
            self._forget_passers_by()
        for stage in range(self._config.graph.refine_rounds):
            with self._stopwatch.measure("final"):
                rules = self._config.graph
                poses = graph.poses.copy()
                sessions = self._sessions.numbers
                pairs = overlapping_pairs(poses, rules.overlap_radius, rules.overlap_neighbours, sessions)
                edges = match_pairs(self._config, self._matcher, self._known(), pairs, stage)
                graph.edges = [edge for edge in graph.edges if edge.kind != "overlap"]
                for edge in edges:
                    graph.add_edge(edge)
            yield self._optimise(f"refinement {stage + 1}")
            if moved(pairs, poses, graph.poses) < AT_REST:
                break
        if self._config.graph.rescan_keyframes:
            with self._stopwatch.measure("rescan"):
                self._rescan(graph, last)

    def _forget_own_parts(self) -> None:
        """Leave out, of all scans' points, those of parts of the robot that were found later."""
        if self._own_parts:
            scans = self._scans
            for i, keyframe in enumerate(scans.anchors):
                points, laser = scans.points[i].astype(np.float64), self._keyframes[keyframe].laser_pose
                scans.points[i] = self._own_parts.outside(points, laser).astype(np.float32)

    def _forget_passers_by(self) -> None:
        """Leave out, of all points, those in what turned out to be free: who walks ahead hides it while driving."""
        known, scans = self._known(), self._scans
        scan_poses = compose_many(known.poses[scans.anchors], scans.relatives)
        for members in self._sessions.split():
            space = known.free_space(members)
            for k in members.tolist():
                self._points[k] = space.outside(self._points[k], known.poses[k])
            for i in np.flatnonzero(np.isin(scans.anchors, members)).tolist():
                lasting = space.outside(scans.points[i].astype(np.float64), scan_poses[i])
                scans.points[i] = lasting.astype(np.float32)

    def _rescan(self, graph: PoseGraph, last: bool) -> None:
        """Match every scan against the finished map and its neighbours, and hang it on its keyframe anew."""
        scans, config, matcher = self._scans, self._config, self._matcher
        pairs = match_with_keyframes(config, matcher, self._known(), scans)
        wanted = worth_a_match(scans.anchors, pairs.partners(len(scans)))
        found, covariances, matched = match_scans(config, matcher, self._known(), scans, wanted)
        if last:
            # The smoother is what takes most memory of all.
            scans.points, self._points = [], []
            give_back()
        poses = smooth(found, covariances, matched, pairs, scans.motions, scans.noises)
        scans.relatives[:] = between_many(graph.poses[scans.anchors], poses)

    def result(self) -> SlamResult:
        """Poses of every scan seen so far, and all that led to them.

        Raises
        ------
        DataError
            If there was no scan.
        """
        graph = self._require_graph()
        scans = self._scans
        stamps, indices = scans.stamps.copy(), np.arange(len(scans), dtype=np.int64)
        poses = compose_many(graph.poses[scans.anchors], scans.relatives)
        return SlamResult(
            trajectory=Trajectory(stamps, poses, indices),
            online=Trajectory(stamps, scans.online.copy(), indices),
            odometry=Trajectory(stamps, scans.odometry.copy(), indices),
            keyframes=self._keyframes,
            keyframe_poses=graph.poses.copy(),
            edges=graph.edges,
            loops=self._loops,
            matched=self._matched,
            seconds=dict(self._stopwatch.seconds),
            statistics={
                "evaluations": self._evaluations,
                "guessed": self._guessed,
                "paused_before": [self._keyframes[k].index for k in self._sessions.pauses],
                "sessions": len(self._sessions.split()),
                "first_guessed": self._first_guessed,
                "own_parts_deg": self._own_parts.degrees,
            },
            covariances=graph.marginal_covariances() if self._config.graph.marginals else None,
        )

    @property
    def keyframe_poses(self) -> Poses:
        """(K, 3) where the keyframes are, as far as is known by now; none before the first scan."""
        return self._graph.poses.copy() if self._graph is not None else np.zeros((0, 3))

    def _close_loops(self) -> Iterator[Event]:
        graph = self._require_graph()
        second = len(graph) - 1
        settled = self._verifier.expire(second)
        for candidate in self._closer.candidates(graph, self._sessions):
            found = self._replay.loops.get((candidate.first, second))
            loop = self._closer.match(candidate, self._known(), found)
            self._evaluations += loop.evaluations
            settled += self._verifier.judge(loop, graph.poses)
        yield from self._settle(settled)
        yield from self._relocalise(graph, second)
        if graph.wants_update:
            with self._stopwatch.measure("graph"):
                graph.update()

    def _relocalise(self, graph: PoseGraph, keyframe: int) -> Iterator[Event]:
        """Look for a keyframe in the sessions that it is not in, and tie the one that it is found in to its own."""
        if self._sessions.single or not self._config.loops.enabled:
            return
        loops = self._relocalisation.look(keyframe, self._known(), self._tracker.usual_score)
        if not loops:
            return
        self._evaluations += sum(loop.evaluations for loop in loops)
        newest = loops[-1]
        there = compose(graph.poses[newest.first], newest.relative)
        motion = compose(there, inverse(graph.poses[newest.second]))
        moving = self._sessions.join(newest.first, newest.second)
        graph.move(moving, motion if moving[newest.second] else inverse(motion))
        self._closer.release()
        yield from self._settle(loops)

    def _look_again(self, graph: PoseGraph, session: NDArray[np.int64]) -> Iterator[Event]:
        """Look for a session's keyframes where the robot has been since."""
        for keyframe in session.tolist():
            if self._sessions.numbers[keyframe] != session[0]:
                return
            yield from self._relocalise(graph, keyframe)

    def _settle(self, loops: list[LoopChecked]) -> Iterator[Event]:
        for loop in loops:
            self._loops.append(loop)
            if loop.accepted:
                edge = Edge(loop.first, loop.second, loop.relative, loop.covariance, "loop")
                self._require_graph().add_edge(edge)
            yield loop

    def _ambiguity(self, loop: LoopChecked) -> float:
        return self._closer.ambiguity(loop, self._known())

    def _optimise(self, stage: str) -> Optimised:
        graph = self._require_graph()
        with self._stopwatch.measure("final"):
            before, after, disbelieved = graph.optimise()
        loops = [edge.kind == "loop" for edge in graph.edges]
        return Optimised(
            stage, before, after, int(np.count_nonzero(disbelieved & np.array(loops, dtype=np.bool_)))
        )

    def _known(self) -> Keyframes:
        return Keyframes(self._keyframes, self._points, self._require_graph().poses, self._sessions)

    def _replayed(self, scan: int) -> TrackedScan | None:
        t = self._replay.tracked.get(scan)
        return None if t is None else TrackedScan(t.relative, t.covariance, t.score, t.matched, t.evaluations)

    def _record(self, scan: LaserScan, keyframe: int, tracked: TrackedScan, lasting: Points) -> Tracked:
        pose = compose(self._require_graph().poses[keyframe], tracked.relative)
        self._scans.append(
            scan.stamp,
            scan.odometry,
            pose,
            keyframe,
            tracked.relative,
            self._tracker.motion,
            self._tracker.noise,
            lasting,
        )
        self._matched += tracked.matched
        if self._tracker.guessed:
            self._first_guessed = scan.index if not self._guessed else self._first_guessed
            self._guessed += 1
        self._evaluations += tracked.evaluations
        return Tracked(
            scan=scan.index,
            stamp=scan.stamp,
            pose=pose,
            keyframe=keyframe,
            relative=tracked.relative,
            covariance=tracked.covariance,
            score=tracked.score,
            matched=tracked.matched,
            evaluations=tracked.evaluations,
        )

    def _keep(self, scan: LaserScan, lasting: Points) -> KeyframeAdded:
        self._sessions.add(self._tracker.pause)
        self._keyframes.append(replace(scan))  # a copy, without the points that a scan remembers once asked
        self._points.append(lasting)
        newest = len(self._keyframes) - 1
        return KeyframeAdded(newest, scan.index, self._require_graph().poses[newest].copy())

    def _require_open(self) -> None:
        if self._ended:
            raise DataError("the run was finished for the last time: begin another one")

    def _require_graph(self) -> PoseGraph:
        if self._graph is None:
            raise DataError("the log holds no scans, so there is nothing to map")
        return self._graph
