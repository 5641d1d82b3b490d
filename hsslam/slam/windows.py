"""How far to search: windows of the config, and windows that reach as far as a prediction may be off."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import GraphSection, WindowSection
from hsslam.kernels.assess import assess
from hsslam.matching.interface import Matcher, Reference, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose, Poses, wrap
from hsslam.slam.recovery import match_tiles

SIGMAS = 3.0
"""A window reaches this many standard deviations to either side."""

AGREEING = SearchWindow(0.04, 0.04, math.radians(2.0))
"""Window around a prediction in which an answer agrees with it, at least."""

EDGE = 0.9
"""An answer this far from the middle of the window, as a share of its half side, may be the edge of a better one."""


def search_window(section: WindowSection) -> SearchWindow:
    """The window a config section describes."""
    return SearchWindow(section.half_x, section.half_y, math.radians(section.half_theta_deg))


def overlap_window(rules: GraphSection) -> SearchWindow:
    """The window of all matches that start from optimised poses."""
    return SearchWindow(
        rules.overlap_half_xy, rules.overlap_half_xy, math.radians(rules.overlap_half_theta_deg)
    )


def foreseen_window(
    variance_xy: float, variance_theta: float, least: SearchWindow, most: SearchWindow
) -> SearchWindow:
    """The window around a prediction of given variances (m^2, rad^2), between two others along every axis."""
    xy, theta = SIGMAS * math.sqrt(variance_xy), SIGMAS * math.sqrt(variance_theta)
    return SearchWindow(
        _between(xy, least.half_x, most.half_x),
        _between(xy, least.half_y, most.half_y),
        _between(theta, least.half_theta, most.half_theta),
    )


def match_within(
    matcher: Matcher[Any],
    reference: Reference,
    points: Points,
    guess: Pose,
    window: SearchWindow,
    tile: SearchWindow,
    rng: np.random.Generator,
    enough: float = math.inf,
) -> MatchResult:
    """Match over a window, tile by tile where it is larger than a tile and more than the matcher can look through.

    The tiles end with one whose answer has a score of ``enough``.
    """
    fits = (
        window.half_x <= tile.half_x and window.half_y <= tile.half_y and window.half_theta <= tile.half_theta
    )
    if matcher.covers_window or fits:
        return matcher.match(reference, points, guess, window, rng)
    return match_tiles(matcher, reference, points, guess, window, tile, rng, enough)


def known_within(
    matcher: Matcher[Any], window: SearchWindow, reference: Reference, points: Points, result: MatchResult
) -> MatchResult:
    """A match with its covariance in another window, which tells where the points leave a direction open."""
    _, covariance, _ = assess(
        reference.surface, points, result.pose, window.half, matcher.config.score_distance
    )
    return replace(result, covariance=covariance)


def difference(pose: Pose, other: Pose) -> Pose:
    """One pose less another, coordinate by coordinate, the angle wrapped."""
    off: Pose = pose - other
    off[2] = wrap(off[2])
    return off


def at_edge(off: Pose, window: SearchWindow) -> bool:
    """Whether an answer that is ``off`` the middle of a window is at its edge."""
    x, y, theta = off.tolist()
    beyond: bool = (
        abs(x) > EDGE * window.half_x
        or abs(y) > EDGE * window.half_y
        or abs(theta) > EDGE * window.half_theta
    )
    return beyond


def differences(poses: Poses, others: Poses) -> Poses:
    """`difference` row by row: (N, 3) and (N, 3) to (N, 3)."""
    off: Poses = poses - others
    off[:, 2] = (off[:, 2] + math.pi) % math.tau - math.pi
    return off


def at_edges(off: Poses, window: SearchWindow) -> NDArray[np.bool_]:
    """`at_edge` row by row: (N, 3) to (N,)."""
    beyond: NDArray[np.bool_] = np.any(np.abs(off) > EDGE * window.half, axis=1)
    return beyond


def _between(value: float, least: float, most: float) -> float:
    if value <= least:
        return least
    return min(_rounded_up(value), most)


def _rounded_up(value: float) -> float:
    """To the next power of the square root of 2: what a matcher works out for a window is worth keeping."""
    return float(2.0 ** (math.ceil(2.0 * math.log2(value)) / 2.0))
