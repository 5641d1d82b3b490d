"""Where in what was seen before a keyframe may be from: poses around a place, a match there, and what denies it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher, SearchWindow
from hsslam.se2 import Points, Pose, Poses
from hsslam.slam.events import LoopChecked
from hsslam.slam.far import NEAR, FarSearch
from hsslam.slam.fusion import largest_variance
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.tracker import ANYWHERE
from hsslam.slam.windows import match_within, search_window

APART = 2.5
"""Distance of the places that are looked at (m)."""

AROUND = 3.0
ALIKE = np.array([1.0, 1.0, math.radians(45.0)])
MOST_KEYFRAMES = 20
"""What is known of a place: keyframes within `AROUND` (m) of its middle, one of those that are `ALIKE` (m, m, rad), the
nearest, so many at most."""

EVERYWHERE = SearchWindow(APART, APART, math.pi)
"""Around each of them."""

EXPLAINED = 0.5
"""Share of a keyframe's returns that a match must explain."""

LIKELY = 0.8
"""Share of the usual score that it must explain of the returns that lie where the place is known."""

CONFLICTING = 0.08
"""Share of its returns that may lie where the place is empty: those of people; a false match has mostly more."""


@dataclass(frozen=True, eq=False)
class Answer:
    """A match, and the share of the returns that it explains of those that lie where the place is known."""

    match: LoopChecked
    fit: float


class PlaceSearch:
    """A keyframe, looked for in places of other sessions than its own.

    Parameters
    ----------
    config : Config
        Its ``loops`` and ``tracker`` sections and its seed.
    matcher : Matcher
        Of loops.
    keyframe : int
        The one that is looked for.
    keyframes : Keyframes
        All of them.
    """

    def __init__(
        self,
        config: Config,
        matcher: Matcher[Any],
        keyframe: int,
        keyframes: Keyframes,
    ) -> None:
        self._config = config
        self._matcher = matcher
        self._keyframes = keyframes
        self.keyframe = keyframe
        self.sessions = keyframes.sessions
        self.poses = keyframes.poses
        self.foreign = self.sessions.foreign(keyframe)
        self.others = np.flatnonzero(self.foreign)
        self.start = self.sessions.start(keyframe)

    def coarsely(self, first: int, least: float) -> tuple[Pose, float]:
        """Where around another keyframe it fits best, seen from there, and how well: 0 if not as well as ``least``."""
        scan = self._keyframes.points[self.keyframe]
        return FarSearch(self._submap(first)).look(scan, np.zeros(3), EVERYWHERE, least)

    def match(self, first: int, guess: Pose, usual: float) -> Answer | None:
        """The keyframe near where ``guess`` says it is, seen from another; None where it does not belong there."""
        rng = generator(self._config.seed, Purpose.RELOCALISE, first, self.keyframe)
        tile = search_window(self._config.tracker.window)
        scan, reference = self._keyframes.points[self.keyframe], self._matcher.prepare(self._submap(first))
        found = match_within(self._matcher, reference, scan, guess, NEAR, tile, rng)
        open_ended = largest_variance(found.covariance) > self._config.loops.max_std**2
        if open_ended or not found.converged or found.score < EXPLAINED:
            return None
        known, conflicting = self._known(first, found.pose)
        fit = found.score / known
        if fit < LIKELY * usual or conflicting > CONFLICTING:
            return None
        match = LoopChecked(
            first=first,
            second=self.keyframe,
            accepted=True,
            reason="",
            relative=found.pose,
            covariance=found.covariance,
            score=found.score,
            evaluations=found.evaluations,
            converged=found.converged,
            expected_std=math.sqrt(ANYWHERE[0, 0]),
        )
        return Answer(match, min(fit, 1.0))

    def _known(self, first: int, pose: Pose) -> tuple[float, float]:
        """Shares of the keyframe's returns that lie where a place is known, and where it is known to be empty."""
        space = self._keyframes.free_space(self._around(first), self.poses[first])
        scan = self._keyframes.points[self.keyframe]
        new, conflicting = space.lacks(scan, pose), space.holds(scan, pose)
        return max(1.0 - float(new.mean()), EXPLAINED), float(conflicting.mean())

    def places(self) -> NDArray[np.int64]:
        """Keyframes of other sessions, none within `APART` of another, and all others are of one."""
        left, chosen = self.others, []
        while len(left):
            chosen.append(left[0])
            left = left[distances(self.poses[left], self.poses[left[0]]) > APART]
        return np.array(chosen, dtype=np.int64)

    def _submap(self, first: int) -> Points:
        """Points of what is known around a keyframe, in its frame."""
        return self._keyframes.submap(self._around(first), self.poses[first])

    def _around(self, first: int) -> NDArray[np.int64]:
        """Keyframes that saw a place, none like another."""
        own = np.flatnonzero(self.sessions.numbers == self.sessions.numbers[first])
        away = distances(self.poses[own], self.poses[first])
        near = own[np.argsort(away, kind="stable")[: np.count_nonzero(away <= AROUND)]]
        _, kinds = np.unique(np.round(self.poses[near] / ALIKE), axis=0, return_index=True)
        return near[np.sort(kinds)[:MOST_KEYFRAMES]]


def distances(poses: Poses, pose: Pose) -> NDArray[np.float64]:
    """Distances (N,) of poses (N, 3) from another (m)."""
    away: NDArray[np.float64] = np.hypot(poses[:, 0] - pose[0], poses[:, 1] - pose[1])
    return away
