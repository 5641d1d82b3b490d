"""What the checks share: one easy match, and requirements that say what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from hsslam.matching.conformance.room import room_pair
from hsslam.matching.interface import Matcher, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose, wrap

WINDOW = SearchWindow(0.2, 0.2, np.radians(10.0))

POSITION_TOLERANCE = 0.05
"""Median distance from the truth in the room (m), at most."""

HEADING_TOLERANCE = np.radians(2.0)
"""Median rotation from the truth in the room (rad), at most."""

FAR_OFF = np.array([2.0, 2.0, 1.5])
"""Added to the truth: a guess from which nothing can be found."""


def generator(seed: int = 0) -> np.random.Generator:
    """Make a generator, the same for the same seed."""
    return np.random.default_rng(seed)


def easy_guess() -> Pose:
    """Return a guess a few centimetres and degrees off the truth of the room of seed 0."""
    offset: Pose = np.array([0.06, -0.05, 0.05])
    return room_pair().truth + offset


def match_room(matcher: Matcher[Any], points: Points | None = None, guess: Pose | None = None) -> MatchResult:
    """Match the room's scan from a guess a few centimetres off."""
    room = room_pair()
    return matcher.match(
        matcher.prepare(room.reference),
        room.scan if points is None else points,
        easy_guess() if guess is None else guess,
        WINDOW,
        generator(),
    )


def apart(a: Pose, b: Pose) -> tuple[float, float]:
    """Distance (m) and rotation (rad, at least 0) between two poses."""
    return float(np.hypot(a[0] - b[0], a[1] - b[1])), abs(float(wrap(a[2] - b[2])))


def require(condition: bool, message: str) -> None:
    """Raise AssertionError with ``message`` unless the condition holds (``assert`` may be optimised away)."""
    if not condition:
        raise AssertionError(message)


def require_close(distances: list[float], rotations: list[float], what: str) -> None:
    """Require median distances (m) and rotations (rad) within the tolerances."""
    distance, rotation = float(np.median(distances)), float(np.median(rotations))
    require(
        distance < POSITION_TOLERANCE and rotation < HEADING_TOLERANCE,
        f"median answer is {distance:.3f} m and {np.degrees(rotation):.2f} degrees {what}; "
        f"at most {POSITION_TOLERANCE} m and {np.degrees(HEADING_TOLERANCE):.1f} degrees are expected",
    )


def require_equal(found: MatchResult, expected: MatchResult, message: str) -> None:
    """Require two results that are equal to the last bit."""
    same = (
        np.array_equal(found.pose, expected.pose)
        and np.array_equal(found.covariance, expected.covariance)
        and found.score == expected.score
        and found.converged == expected.converged
        and found.evaluations == expected.evaluations
    )
    require(same, f"{message}: pose {found.pose} instead of {expected.pose}")
