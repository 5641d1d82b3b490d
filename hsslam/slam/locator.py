"""One scan in the submap: around odometry's prediction first, then wherever there is reason to doubt it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import TrackerSection
from hsslam.kernels.assess import assess, explained
from hsslam.kernels.joints import widths_of
from hsslam.kernels.surface import scan_lines
from hsslam.matching.interface import MINIMUM_POINTS, Matcher, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose
from hsslam.search.slide import weak_direction
from hsslam.slam.expectation import USUAL, Expectation
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.submap import GrowingSubmap
from hsslam.slam.windows import (
    AGREEING,
    at_edge,
    difference,
    known_within,
    match_within,
    search_window,
)

EDGE_GAIN = 0.02
"""An answer beyond the window is believed only if its score is this much higher: among many places one seems better."""

NEW_GROUND = 1.0 / 3.0
"""What a return counts that lies where nothing is known yet, where two answers are compared: less than one that is
explained, or all scans would be thought to lead into the unknown, more than none, or none would."""

MUCH = 0.15
"""Share of a scan's returns that is much to see for the first time."""

SETTLINGS = 4
"""How often an answer is followed to the edge of the window around it, at most."""

UNFIT = 0.15
"""A scan fits badly if its score is this far below those of the last scans."""

DOUBTFUL = 0.1
"""Odometry is doubtful along an open direction where its variance is more than this share of the answer's."""

OPEN_STD = 10.0
"""Standard deviation (m) along a direction of which the returns tell nothing."""

FEW = 6
"""An answer elsewhere explains more than the first by at least as many returns: few of them fit somewhere always."""

FARTHER = 7.0
"""How many times the first answer's standard deviation an answer at a bottom of its own may have."""

LEAST_EXTENT = 1.0
"""Returns within a box of this diagonal (m) do not contradict odometry: a piece of one surface looks like any other."""

WIDEST = 2.0
"""People around the robot are no wider together than this (m)."""

AT_REST = 0.01
"""Standard deviation (m, rad) that any answer may have."""


class Locator:
    """Matches one scan against one submap, as often and as widely as it takes.

    Parameters
    ----------
    rules : TrackerSection
        Windows, and the scores below which a match is doubted.
    matcher : Matcher
        Any.
    submap : GrowingSubmap
        Prepared by the matcher.
    points : Points
        (N, 2) m, the scan's returns in the robot's frame.
    rng : numpy.random.Generator
        The scan's own.
    stopwatch : Stopwatch
        Told how long the first match took, and all others.
    """

    def __init__(
        self,
        rules: TrackerSection,
        matcher: Matcher[Any],
        submap: GrowingSubmap,
        points: Points,
        rng: np.random.Generator,
        stopwatch: Stopwatch,
    ) -> None:
        self._rules = rules
        self._matcher = matcher
        self._reference = submap.reference
        self._free_space = submap.free_space
        self._points = points
        self._rng = rng
        self._stopwatch = stopwatch
        self._window = search_window(rules.window)
        self._widest = search_window(rules.recovery_window)
        self._evaluations = 0
        self._enough = 1.0
        self._told = False

    def locate(self, expected: Expectation) -> MatchResult:
        """The best answer, whose ``evaluations`` are those of all matches that it took."""
        # A robot that turns far between two scans may have turned farther than the usual window reaches.
        window = expected.window(self._window, self._widest)
        self._enough = max(expected.score - USUAL, self._rules.recovery_score)
        self._told = expected.told
        with self._stopwatch.measure("track"):
            found = self._match(expected.pose, window)
            cut_off = _cut_off(found, expected, window, self._open_direction(found))
            cut_off |= expected.paused and found.score < expected.score - USUAL
            if not (cut_off or expected.leaps):
                found = self._without_passers_by(expected, window, found)
        if cut_off:
            with self._stopwatch.measure("recover"):
                found = self._look_further(expected, found)
        if expected.told and (
            expected.contradicts(found) or self._unusual(found) or self._drawn_back(expected)
        ):
            with self._stopwatch.measure("recover"):
                found = self._agree(expected, found)
        if self._doubtful(found):
            with self._stopwatch.measure("recover"):
                found = self._recover(expected, found)
        elif expected.leaps or expected.belies(found):
            with self._stopwatch.measure("recover"):
                found = self._steadier(expected, found)
        if self._open_direction(found) is not None:
            found = self._left_open(expected, found)
        if expected.told and expected.contradicts(found) and self._unfit(found, expected):
            found = _unsure(found, expected)
        if found.evaluations == self._evaluations:
            return found
        return replace(found, evaluations=self._evaluations)

    def _match(self, guess: Pose, window: SearchWindow) -> MatchResult:
        result = match_within(
            self._matcher,
            self._reference,
            self._points,
            guess,
            window,
            self._window,
            self._rng,
            self._enough,
        )
        self._evaluations += result.evaluations
        if not result.converged and "rejected" not in result.diagnostics and result.score >= self._enough:
            # The method did not come to rest, but where it stands the scan fits as ever; how far that may be from
            # the bottom is part of the covariance.
            return replace(result, converged=True)
        return result

    def _known_within(self, window: SearchWindow, result: MatchResult) -> MatchResult:
        return known_within(self._matcher, window, self._reference, self._points, result)

    def _unusual(self, result: MatchResult) -> bool:
        return not result.converged or result.score < self._rules.recovery_score

    def _doubtful(self, result: MatchResult) -> bool:
        """Whether an answer is unusual for what it denies, not for what it sees for the first time."""
        if not self._unusual(result):
            return False
        if not (result.converged and self._told):
            return True
        return result.score < self._rules.recovery_score * (1.0 - self._new(result.pose))

    def _unfit(self, result: MatchResult, expected: Expectation) -> bool:
        """Whether an answer fits badly for what there is to be known: a robot that turns into a room sees much anew."""
        return result.score < (expected.score - UNFIT) * (1.0 - self._new(result.pose))

    def _drawn_back(self, expected: Expectation) -> bool:
        """Whether a scan sees much for the first time along a corridor: what overlaps most seems to fit best."""
        return self._new(expected.pose) > MUCH and not math.isnan(weak_direction(scan_lines(self._points)))

    def _fit(self, result: MatchResult) -> float:
        """An answer's score, in which returns count for something that lie where nothing is known yet.

        Not where odometry does not tell: an answer that leads into the unknown then has nothing to say for itself.
        """
        return result.score + (NEW_GROUND * self._new(result.pose) if self._told else 0.0)

    def _new(self, pose: Pose) -> float:
        """Share of the returns that lie where nothing is known yet, the robot being at ``pose``."""
        return float(np.count_nonzero(self._free_space.lacks(self._points, pose))) / max(len(self._points), 1)

    def _better(self, other: MatchResult, first: MatchResult, gain: float) -> bool:
        """Whether another answer is to replace the first: for a better fit, by ``gain`` if the first converged.

        A method that did not come to rest may stand right where the scan belongs: what fits less well is no better.
        """
        least = max(gain if first.converged else 0.0, FEW / max(len(self._points), 1))
        return other.converged and self._fit(other) > self._fit(first) + least

    def _without_passers_by(
        self, expected: Expectation, window: SearchWindow, first: MatchResult
    ) -> MatchResult:
        """Match again without the returns that are in free space, whether the expectation is right or the match."""
        in_free_space = self._free_space.holds(self._points, expected.pose)
        if not in_free_space.any():
            return first
        in_free_space &= self._free_space.holds(self._points, first.pose)
        count = np.count_nonzero(in_free_space)
        if count == 0 or len(self._points) - count < MINIMUM_POINTS:
            return first
        self._points = self._points[~in_free_space]
        return self._match(expected.pose, window)

    def _look_further(self, expected: Expectation, first: MatchResult) -> MatchResult:
        """Search the widest window around the prediction: what a narrow one found at its edge was cut off by it."""
        wide = self._match(expected.pose, self._widest)
        return self._settled(wide if self._better(wide, first, EDGE_GAIN) else first)

    def _agree(self, expected: Expectation, first: MatchResult) -> MatchResult:
        """Search only where odometry may be right: what fits about as well there is likelier than what denies it."""
        if not expected.leaps and expected.contradicts(first) and self._without_movers(expected, first):
            near = self._match(expected.pose, expected.window(AGREEING, self._window))
            return self._known_within(self._window, near) if near.converged else near
        near = self._match(expected.pose, expected.window(AGREEING, self._window))
        fit, usual = self._fit(near), self._fit(first)
        if not near.converged or fit <= usual - expected.least_gain(first.pose):
            return first
        bare = expected.goes_on and self._open_direction(near) is not None
        if not (bare or _at_rest(near, first)):
            # What it is drawn to lies beyond the window: the first answer, or else another one.
            return first if fit <= usual else self._settled(near)
        # What so narrow a window adds to the covariance is odometry's, and odometry is weighed by itself.
        return self._known_within(self._window, near)

    def _without_movers(self, expected: Expectation, first: MatchResult) -> bool:
        """Leave out the returns that alone speak for an answer that denies odometry, if they may be of people.

        Not if no more than a piece of one surface were left.
        """
        here, there = (self._explained(pose) for pose in (expected.pose, first.pose))
        movers = there & ~here
        if not movers.any() or widths_of(self._points, movers)[0] > WIDEST or is_piece(self._points[~movers]):
            return False
        self._points = self._points[~movers]
        return True

    def _explained(self, pose: Pose) -> NDArray[np.bool_]:
        """Which returns count for the score, the robot being at ``pose``."""
        surface = self._reference.surface
        distance = self._matcher.config.score_distance
        return explained(
            surface.pieces,
            surface.nearest,
            surface.frame,
            self._points,
            scan_lines(self._points),
            pose,
            distance,
        )

    def _steadier(self, expected: Expectation, first: MatchResult) -> MatchResult:
        """Where odometry leaps or is late, try the last motion once more: that may reach further than any window."""
        gain = expected.steady_gain(first.pose)
        if first.score >= 1.0 and gain >= 0.0:
            return first
        best = self._match(expected.repeated, self._window)
        better = best.converged and self._fit(best) > self._fit(first) + gain
        return best if better else first

    def _recover(self, expected: Expectation, first: MatchResult) -> MatchResult:
        """Doubt odometry: try the last motion once more as the prediction, then a wide window around it."""
        best = self._match(expected.repeated, self._window)
        if self._doubtful(best):
            best = self._match(expected.repeated, self._widest)
        if self._better(best, first, expected.least_gain(best.pose)):
            return self._settled(best)
        return first

    def _open_direction(self, found: MatchResult) -> float | None:
        """The direction (rad) that an answer leaves open, if any.

        The scan's own lines have to leave one open, too: away from the bottom of its distances, where a method that
        counts hits stops, that of a room may seem to.
        """
        direction: float | None = found.diagnostics.get("degenerate_direction")
        if direction is None or math.isnan(weak_direction(scan_lines(self._points))):
            return None
        return direction

    def _left_open(self, expected: Expectation, found: MatchResult) -> MatchResult:
        """An answer that leaves a direction open, with what is known of it in the widest window.

        How far a window reaches is no news. What is open there, too, is left to what is expected altogether, the more
        so the more doubtful that is: the answer's place along a bare corridor is anywhere in the window, and would
        have a say.
        """
        _, covariance, direction = assess(
            self._reference.surface,
            self._points,
            found.pose,
            self._widest.half,
            self._matcher.config.score_distance,
        )
        if not math.isnan(direction):
            along = np.array([math.cos(direction), math.sin(direction), 0.0])
            if along @ expected.covariance @ along > DOUBTFUL * (along @ covariance @ along):
                covariance += OPEN_STD**2 * np.outer(along, along)
        return replace(found, covariance=covariance)

    def _settled(self, found: MatchResult) -> MatchResult:
        """Search on around what was found far off: the wide window, too, may have cut it off."""
        for _ in range(SETTLINGS):
            near = self._match(found.pose, self._window)
            if not near.converged or self._fit(near) < self._fit(found) - EDGE_GAIN:
                return found
            moved = difference(near.pose, found.pose)
            found = self._known_within(self._widest, near)
            if not at_edge(moved, self._window):
                break
        return found


def is_piece(points: Points) -> bool:
    """Whether (N, 2) returns are no more than a piece of one surface, see `LEAST_EXTENT`; none are not even that."""
    return len(points) == 0 or float(np.hypot(*np.ptp(points, axis=0))) < LEAST_EXTENT


def _cut_off(
    result: MatchResult, expected: Expectation, window: SearchWindow, direction: float | None
) -> bool:
    """Whether a better answer may lie beyond the edge of the window around the expected pose.

    ``direction`` (rad) is what the answer leaves open, if anything.
    """
    off = difference(result.pose, expected.pose)
    if expected.told and direction is not None and result.score >= expected.score - USUAL:
        # All places along it are as good, those at the edge too: a bare wall's are, if the scan fits as ever.
        along = np.array([math.cos(direction), math.sin(direction), 0.0])
        off -= (off @ along) * along
    return at_edge(off, window)


def _at_rest(near: MatchResult, first: MatchResult) -> bool:
    """Whether an answer in a narrow window stands at a bottom, not where the window ends on the way to another.

    The step that leads to the bottom is part of a covariance: beyond it the first answer is `FARTHER` surer.
    """
    deviations, sure = (np.sqrt(np.diag(result.covariance)) for result in (near, first))
    return bool(np.all(deviations <= np.maximum(FARTHER * sure, AT_REST)))


def _unsure(result: MatchResult, expected: Expectation) -> MatchResult:
    """An answer that fits badly and denies odometry, with what is between the two as its deviation."""
    off = difference(result.pose, expected.pose)
    return replace(result, covariance=result.covariance + np.outer(off, off))
