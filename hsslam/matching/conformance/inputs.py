"""Checks of what a matcher does with its inputs: any layout, too few points, senseless ones, wrong shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hsslam.matching.conformance.probe import (
    HEADING_TOLERANCE,
    POSITION_TOLERANCE,
    WINDOW,
    apart,
    easy_guess,
    generator,
    match_room,
    require,
    require_equal,
)
from hsslam.matching.conformance.room import room_pair
from hsslam.matching.interface import Matcher


def check_inputs_untouched(matcher: Matcher[Any]) -> None:
    """Neither `prepare` nor `match` writes into what it is given."""
    room, guess = room_pair(), easy_guess()
    given = (room.reference.copy(), room.scan.copy(), guess.copy())
    matcher.match(matcher.prepare(given[0]), given[1], given[2], WINDOW, generator())
    for name, now, before in zip(
        ("reference", "scan", "guess"), given, (room.reference, room.scan, guess), strict=True
    ):
        require(np.array_equal(now, before), f"the {name} was changed")


def check_array_layouts(matcher: Matcher[Any]) -> None:
    """Strided, Fortran-ordered and float32 points are as good as contiguous float64."""
    room = room_pair()
    expected = match_room(matcher)
    wide = np.repeat(np.column_stack((room.scan, room.scan)), 2, axis=0)[::2, :2]
    for what, points in (("strided", wide), ("Fortran-ordered", np.asfortranarray(room.scan))):
        require_equal(match_room(matcher, points=points), expected, f"{what} points give another result")
    single = matcher.match(
        matcher.prepare(room.reference.astype(np.float32)),
        room.scan.astype(np.float32),
        easy_guess(),
        WINDOW,
        generator(),
    )
    distance, rotation = apart(single.pose, expected.pose)
    require(
        distance < POSITION_TOLERANCE and rotation < HEADING_TOLERANCE,
        f"float32 points lead elsewhere: {distance:.3f} m, {rotation:.3f} rad",
    )


def check_not_finite_rows(matcher: Matcher[Any]) -> None:
    """Points that are NaN or infinite count for nothing, in the scan and in the reference."""
    room, expected = room_pair(), match_room(matcher)
    for value in (np.nan, np.inf):
        scan = np.insert(room.scan, [0, 17, 90, len(room.scan)], value, axis=0)
        reference = np.insert(room.reference, [0, 40, len(room.reference)], value, axis=0)
        found = matcher.match(matcher.prepare(reference), scan, easy_guess(), WINDOW, generator())
        require_equal(found, expected, f"points that are {value} change the result")


def check_too_few_points(matcher: Matcher[Any]) -> None:
    """With nothing to go by, the answer is the guess, not converged."""
    room, guess = room_pair(), easy_guess()
    for what, few in (
        ("no points", np.empty((0, 2))),
        ("one point", np.ones((1, 2))),
        ("two points", room.scan[:2]),
        ("only NaN points", np.full((50, 2), np.nan)),
    ):
        for reference, scan in ((few, room.scan), (room.reference, few), (few, few)):
            result = matcher.match(matcher.prepare(reference), scan, guess, WINDOW, generator())
            require(not result.converged, f"{what}: converged must be False")
            require(np.allclose(result.pose, guess), f"{what}: the answer must be the guess")
            require(
                bool(np.isfinite(result.covariance).all()) and 0.0 <= result.score <= 1.0,
                f"{what}: covariance and score must be finite",
            )


def check_degenerate_points(matcher: Matcher[Any]) -> None:
    """Points that fix no pose, all in one place or on one line, give a finite answer in the window."""
    room, line = room_pair(), np.column_stack((np.arange(40.0) * 0.05, np.zeros(40)))
    for what, points in (
        ("coincident", np.ones((20, 2))),
        ("collinear", line),
        ("far-away", room.scan + 500.0),
        ("three", room.scan[[0, 80, 160]]),
    ):
        for reference, scan in ((points, room.scan), (room.reference, points), (points, points)):
            result = matcher.match(matcher.prepare(reference), scan, np.zeros(3), WINDOW, generator())
            require(
                WINDOW.contains(np.zeros(3), result.pose, tolerance=1e-6),
                f"{what} points: the answer {result.pose} is outside the window",
            )
            require(
                bool(np.isfinite(result.covariance).all()), f"{what} points: the covariance is not finite"
            )


def check_wrong_shapes(matcher: Matcher[Any]) -> None:
    """Arrays of a wrong shape, and guesses that are no pose, raise ValueError."""
    room = room_pair()
    reference = matcher.prepare(room.reference)
    solid, flat = np.zeros((30, 3)), np.zeros(30)
    attempts: list[tuple[str, Callable[[], Any]]] = [
        ("a (30, 3) reference", lambda: matcher.prepare(solid)),
        ("a (30,) reference", lambda: matcher.prepare(flat)),
        ("a (30, 3) scan", lambda: matcher.match(reference, solid, np.zeros(3), WINDOW, generator())),
        ("a (30,) scan", lambda: matcher.match(reference, flat, np.zeros(3), WINDOW, generator())),
        ("a guess of two", lambda: matcher.match(reference, room.scan, np.zeros(2), WINDOW, generator())),
        ("a NaN guess", lambda: matcher.match(reference, room.scan, np.full(3, np.nan), WINDOW, generator())),
    ]
    for what, attempt in attempts:
        try:
            attempt()
        except ValueError:
            continue
        raise AssertionError(f"{what} must raise ValueError")
