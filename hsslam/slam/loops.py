"""Loop closure: earlier keyframes near by, matched over a wide window, verified."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher, MatchResult, Reference
from hsslam.se2 import Points, Poses, between
from hsslam.slam.events import LoopChecked
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import merge
from hsslam.slam.tracker import search_window

REFERENCES_KEPT = 64
"""Prepared submaps kept for the next candidates; a robot that comes back passes several of them in a row."""


class LoopCloser:
    """Proposes and verifies constraints between the newest keyframe and earlier ones.

    Parameters
    ----------
    config : Config
        Its ``loops`` section and its seed.
    matcher : Matcher
        Any; it is asked for matches over a wide window.
    stopwatch : Stopwatch
        Told how long all of it took.
    """

    def __init__(self, config: Config, matcher: Matcher[Any], stopwatch: Stopwatch) -> None:
        self._config = config
        self._matcher = matcher
        self._stopwatch = stopwatch
        self._window = search_window(config.loops.window)
        self._references: dict[int, Reference] = {}

    def candidates(self, poses: Poses) -> list[int]:
        """Keyframes worth trying against the newest one, nearest first, not two of the same place."""
        rules = self._config.loops
        newest = len(poses) - 1
        if not rules.enabled or newest % rules.every or newest <= rules.min_gap:
            return []
        offsets = poses[: newest - rules.min_gap, :2] - poses[newest, :2]
        distances = np.hypot(offsets[:, 0], offsets[:, 1])
        chosen: list[int] = []
        for i in np.argsort(distances, kind="stable"):
            if distances[i] > rules.radius or len(chosen) == rules.candidates:
                break
            if all(abs(int(i) - j) > 2 * rules.submap_half for j in chosen):
                chosen.append(int(i))
        return chosen

    def check(
        self, first: int, points: list[Points], poses: Poses, known: LoopChecked | None = None
    ) -> LoopChecked:
        """Match the newest keyframe against the submap around keyframe ``first`` and verify the answer.

        ``known``, what an earlier, interrupted run found, is taken as it is. The submap is made all the same:
        later candidates use it as it was now, in a resumed run as in a whole one.
        """
        second = len(poses) - 1
        with self._stopwatch.measure("loops"):
            reference = self._reference(first, points, poses)
            if known is not None:
                return known
            guess = between(poses[first], poses[second])
            rng = generator(self._config.seed, Purpose.LOOP, first, second)
            result = self._matcher.match(reference, points[second], guess, self._window, rng)
        reason = self._refusal(result)
        return LoopChecked(
            first=first,
            second=second,
            accepted=not reason,
            reason=reason,
            relative=result.pose,
            covariance=result.covariance,
            score=result.score,
            evaluations=result.evaluations,
        )

    def _reference(self, first: int, points: list[Points], poses: Poses) -> Reference:
        reference = self._references.pop(first, None)
        if reference is None:
            half = self._config.loops.submap_half
            low, high = max(first - half, 0), min(first + half + 1, len(poses) - 1)
            reference = self._matcher.prepare(merge(points[low:high], poses[low:high], first - low))
        self._references[first] = reference
        if len(self._references) > REFERENCES_KEPT:
            del self._references[next(iter(self._references))]
        return reference

    def _refusal(self, result: MatchResult) -> str:
        rules = self._config.loops
        if not result.converged:
            return str(result.diagnostics.get("rejected", "the matcher did not converge"))
        if result.score < rules.min_score:
            return f"score {result.score:.2f} below {rules.min_score:.2f}"
        largest = math.sqrt(_largest_variance(result.covariance))
        if largest > rules.max_std:
            return f"standard deviation {largest:.2f} m above {rules.max_std:.2f} m"
        return ""


def _largest_variance(covariance: NDArray[np.float64]) -> float:
    return float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
