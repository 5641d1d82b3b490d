"""Loop closure: earlier keyframes near by, matched over a window as wide as the graph is unsure, verified."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher, Reference, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose, Poses, between, compose, inverse, wrap
from hsslam.slam.events import LoopChecked
from hsslam.slam.far import NEAR, FarSearch
from hsslam.slam.fusion import largest_variance, rotated, squared_mahalanobis
from hsslam.slam.graph import PoseGraph
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.recovery import best_elsewhere
from hsslam.slam.sessions import Sessions
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.windows import foreseen_window, match_within, search_window

REFERENCES_KEPT = 10
"""Prepared submaps kept for the next candidates; a robot that comes back passes several of them in a row."""

NEAREST = 200
"""Keyframes looked at, at most: with every round through a building there are more near by, and they tell no more."""

LEAST = SearchWindow(0.15, 0.15, math.radians(5.0))
"""No window is smaller than this: it costs a search little, and covariances may be too small."""

BEYOND_GAIN = 0.05
"""What is found beyond the far window, in one twice as wide, must score this much more than what is in it."""

ELSEWHERE = SearchWindow(0.5, 0.5, math.radians(15.0))
"""An answer outside of this around the one in question is another one."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """An earlier keyframe to match the newest one against, and how well their relative pose is known."""

    first: int
    variance_xy: float
    variance_theta: float


@dataclass(frozen=True, eq=False)
class _Place:
    """A prepared submap: reference in the frame of ``origin``, a pose of the graph when it was made."""

    reference: Reference
    origin: Pose
    first: int
    poses: Poses

    def of(self, keyframe: int) -> Pose:
        """A keyframe of the submap in the reference's frame."""
        return between(self.origin, self.poses[keyframe - self.first])

    @cached_property
    def far(self) -> FarSearch:
        """For windows wider than a matcher is asked to search."""
        return FarSearch(self.reference.points)


class LoopCloser:
    """Proposes and matches constraints between the newest keyframe and earlier ones.

    Parameters
    ----------
    config : Config
        Its ``loops`` and ``tracker`` sections and its seed.
    matcher : Matcher
        Any; it is asked for matches over windows wide and narrow.
    stopwatch : Stopwatch
        Told how long all of it took.
    """

    def __init__(self, config: Config, matcher: Matcher[Any], stopwatch: Stopwatch) -> None:
        self._config = config
        self._matcher = matcher
        self._stopwatch = stopwatch
        self._widest = search_window(config.loops.window)
        self._farthest = far = search_window(config.loops.far_window)
        self._beyond = SearchWindow(2.0 * far.half_x, 2.0 * far.half_y, far.half_theta)
        self._tile = search_window(config.tracker.window)
        self._places: dict[int, _Place] = {}

    def candidates(self, graph: PoseGraph, sessions: Sessions) -> list[Candidate]:
        """Keyframes of its session worth trying against the newest, nearest first, not two of the same place."""
        rules = self._config.loops
        newest = len(graph) - 1
        if not rules.enabled or newest % rules.every or newest <= rules.min_gap:
            return []
        with self._stopwatch.measure("candidates"):
            farthest = rules.radius + 2.0 * self._farthest.half_x
            near, distances = graph.near.of(graph.poses[newest], newest - rules.min_gap, farthest, NEAREST)
            if not sessions.single:
                own = ~sessions.foreign(newest)[near]
                near, distances = near[own], distances[own]
            # Those within the radius are candidates however well they are known; mostly there are enough of them.
            inside = distances <= rules.radius
            targets = self._apart(near[inside])
            if len(targets) < rules.candidates:
                targets = np.concatenate((targets, near[~inside]))
            variances = graph.uncertainty.seen_from(newest, targets, graph.poses)
        known = dict(zip(targets.tolist(), variances.tolist(), strict=True))
        reach = dict(zip(near.tolist(), distances.tolist(), strict=True))
        reachable = [
            first
            for first, (xy, _) in known.items()
            if reach[first] <= rules.radius + 2.0 * min(math.sqrt(xy), self._farthest.half_x)
        ]
        return [Candidate(first, *known[first]) for first in self._apart(np.array(reachable)).tolist()]

    def _apart(self, near: NDArray[np.int64]) -> NDArray[np.int64]:
        """The first of some keyframes, as many as are to be tried, no two of the same place."""
        rules = self._config.loops
        chosen: list[int] = []
        for i in near:
            if len(chosen) == rules.candidates:
                break
            if all(abs(int(i) - other) > rules.submap_size for other in chosen):
                chosen.append(int(i))
        return np.array(chosen, dtype=np.int64)

    def match(
        self, candidate: Candidate, keyframes: Keyframes, known: LoopChecked | None = None
    ) -> LoopChecked:
        """Match the newest keyframe against the submap around a candidate; the verdict is still open.

        ``known``, what an earlier, interrupted run found, is taken as it is. The submap is made all the same:
        later candidates use it as it was now, in a resumed run as in a whole one.
        """
        first, second, poses = candidate.first, len(keyframes) - 1, keyframes.poses
        with self._stopwatch.measure("loops"):
            place = self._place(first, keyframes)
            guess = between(poses[first], poses[second])
            if known is None:
                known = self._match(candidate, second, keyframes.points[second], place, guess)
        deviation = known.relative - guess
        deviation[2] = wrap(deviation[2])
        foreseen = np.diag([candidate.variance_xy, candidate.variance_xy, candidate.variance_theta])
        surprise = squared_mahalanobis(deviation, foreseen + known.covariance)
        return LoopChecked(
            first=first,
            second=second,
            accepted=False,
            reason=self._refusal(known),
            relative=known.relative,
            covariance=known.covariance,
            score=known.score,
            evaluations=known.evaluations,
            converged=known.converged,
            expected_std=math.sqrt(candidate.variance_xy),
            surprise=surprise,
        )

    def release(self) -> None:
        """Let go of the prepared submaps; those that are wanted again are prepared again."""
        self._places.clear()

    def ambiguity(self, loop: LoopChecked, keyframes: Keyframes) -> float:
        """Score of the best answer elsewhere in the window of the search, over that of the loop's own answer."""
        with self._stopwatch.measure("ambiguity"):
            place = self._place(loop.first, keyframes)
            answer = compose(place.of(loop.first), loop.relative)
            scan = keyframes.points[loop.second]
            rng = generator(self._config.seed, Purpose.AMBIGUITY, loop.first, loop.second)
            window = foreseen_window(loop.expected_std**2, 0.0, self._widest, self._farthest)
            if window == self._widest:
                score = best_elsewhere(
                    self._matcher, place.reference, scan, answer, window, self._tile, ELSEWHERE, rng
                )
            else:
                score = max(
                    self._matcher.match(place.reference, scan, pose, NEAR, rng).score
                    for pose in place.far.elsewhere(scan, answer, window, ELSEWHERE)
                )
        return score / max(loop.score, 1e-9)

    def _match(
        self, candidate: Candidate, second: int, scan: Points, place: _Place, guess: Pose
    ) -> LoopChecked:
        first = candidate.first
        base = place.of(first)
        rng = generator(self._config.seed, Purpose.LOOP, first, second)
        expected = compose(base, guess)
        window = foreseen_window(candidate.variance_xy, candidate.variance_theta, LEAST, self._farthest)

        def matched(expected: Pose, window: SearchWindow) -> MatchResult:
            return match_within(self._matcher, place.reference, scan, expected, window, self._tile, rng)

        if (window.half > self._widest.half).any():
            result = matched(place.far.best(scan, expected, window), NEAR)
            beyond = foreseen_window(candidate.variance_xy, candidate.variance_theta, window, self._beyond)
            if beyond != window:
                # The truth may be further out; but the more of a long corridor is in a window, the more looks alike.
                other = matched(place.far.best(scan, expected, beyond), NEAR)
                better = other.converged and other.score > result.score + BEYOND_GAIN
                spent = result.evaluations + other.evaluations
                result = replace(other if better else result, evaluations=spent)
        else:
            result = matched(expected, window)
        return LoopChecked(
            first=first,
            second=second,
            accepted=False,
            reason="",
            relative=compose(inverse(base), result.pose),
            covariance=rotated(result.covariance, base[2]),
            score=result.score,
            evaluations=result.evaluations,
            converged=result.converged,
        )

    def _place(self, first: int, keyframes: Keyframes) -> _Place:
        size = self._config.loops.submap_size
        step = max(size // 2, 1)
        number = first // step
        place = self._places.pop(number, None)
        # With a small min_gap, a submap made when the log was young may end before a later candidate.
        if place is None or not place.first <= first < place.first + len(place.poses):
            middle = number * step + step // 2
            low = max(middle - size // 2, 0)
            high = min(middle + size // 2 + 1, len(keyframes) - 1)
            low, high = min(low, first), max(high, first + 1)
            low, high = keyframes.sessions.around(first, low, high)
            origin = keyframes.poses[min(max(middle, low), high - 1)].copy()
            reference = self._matcher.prepare(keyframes.submap(np.arange(low, high), origin))
            place = _Place(reference, origin, low, keyframes.poses[low:high].copy())
        self._places[number] = place
        if len(self._places) > REFERENCES_KEPT:
            del self._places[next(iter(self._places))]
        return place

    def _refusal(self, loop: LoopChecked) -> str:
        rules = self._config.loops
        if not loop.converged:
            return "the matcher did not converge inside the window"
        if loop.score < rules.min_score:
            return f"score {loop.score:.2f} below {rules.min_score:.2f}"
        largest = math.sqrt(largest_variance(loop.covariance))
        if largest > rules.max_std:
            return f"standard deviation {largest:.2f} m above {rules.max_std:.2f} m"
        return ""
