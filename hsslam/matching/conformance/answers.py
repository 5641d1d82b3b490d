"""Checks of what a matcher answers: score, covariance, accuracy, frame, window, repetition."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from hsslam.matching.conformance.probe import (
    FAR_OFF,
    HEADING_TOLERANCE,
    POSITION_TOLERANCE,
    WINDOW,
    apart,
    easy_guess,
    generator,
    match_room,
    require,
    require_close,
    require_equal,
)
from hsslam.matching.conformance.room import guesses, room_pair
from hsslam.matching.interface import Matcher, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import compose, transform, wrap

TRIALS = 9

FRAME = np.array([3.0, -4.0, 2.5])
"""Where the frame-invariance check moves the reference."""


def check_score(matcher: Matcher[Any]) -> None:
    """Require that the score is a share of points: high at the truth, in [0, 1] anywhere."""
    room = room_pair()
    good = match_room(matcher)
    lost = match_room(matcher, guess=room.truth + FAR_OFF)
    for result in (good, lost):
        require(0.0 <= result.score <= 1.0, f"score {result.score} is outside [0, 1]")
    require(good.score > 0.8, f"score {good.score:.2f} on an easy room; expected over 0.8")
    require(good.score > lost.score, "a match far from the truth scores as high as one near it")


def check_covariance(matcher: Matcher[Any]) -> None:
    """Covariances are symmetric, positive definite, in metres and radians."""
    room = room_pair()
    line = np.column_stack((np.linspace(-2.0, 2.0, 60), np.full(60, 1.0)))
    wall = matcher.match(matcher.prepare(line), line, np.zeros(3), WINDOW, generator())
    lost = match_room(matcher, guess=room.truth + FAR_OFF)
    good = match_room(matcher)
    for what, result in (("an easy room", good), ("a single wall", wall), ("a hopeless guess", lost)):
        covariance = result.covariance
        refused = result.diagnostics.get("covariance_rejected")
        require(refused is None, f"covariance of {what} is {refused}")
        require(
            np.allclose(covariance, covariance.T, rtol=1e-9, atol=0.0),
            f"covariance of {what} is not symmetric",
        )
        lowest = float(np.linalg.eigvalsh(covariance)[0])
        require(lowest > 0.0, f"covariance of {what} is not positive definite: least eigenvalue {lowest:g}")
    deviation = np.sqrt(np.diag(good.covariance))
    require(
        bool((deviation <= WINDOW.half).all()),
        f"standard deviations {deviation} (m, m, rad) exceed the window in an easy room: other units?",
    )


def check_accuracy(matcher: Matcher[Any]) -> None:
    """Most guesses in an easy room lead to its truth."""
    distances, rotations, rejected = [], [], []
    for trial in range(TRIALS):
        room = room_pair(trial)
        guess = guesses(room.truth, WINDOW.half, 1, trial)[0]
        result = matcher.match(matcher.prepare(room.reference), room.scan, guess, WINDOW, generator(trial))
        distance, rotation = apart(result.pose, room.truth)
        distances.append(distance)
        rotations.append(rotation)
        rejected += [result.diagnostics["rejected"]] if "rejected" in result.diagnostics else []
    # A rejected answer is the guess: how far that is from the truth says nothing of the matcher.
    require(
        2 * len(rejected) < TRIALS,
        f"{len(rejected)} of {TRIALS} answers were rejected: {', '.join(set(rejected))}",
    )
    require_close(distances, rotations, "from the truth")


def check_theta_range(matcher: Matcher[Any]) -> None:
    """Headings are in [-pi, pi), whatever the guess."""
    room = room_pair()
    for turns in (-2, 0, 2):
        for theta in (np.pi - room.truth[2], -np.pi - room.truth[2]):
            frame = np.array([0.0, 0.0, theta])
            reference = matcher.prepare(transform(frame, room.reference))
            guess = compose(frame, room.truth) + np.array([0.0, 0.0, 2.0 * np.pi * turns])
            pose = matcher.match(reference, room.scan, guess, WINDOW, generator()).pose
            require(-np.pi <= pose[2] < np.pi, f"theta {pose[2]} is outside [-pi, pi)")
            if turns == 0:
                continue
            distance, rotation = apart(pose, compose(frame, room.truth))
            require(
                distance < 2 * POSITION_TOLERANCE and rotation < 2 * HEADING_TOLERANCE,
                f"a guess given {turns} turns further round misses: {distance:.3f} m, {rotation:.3f} rad",
            )


def check_frame_invariance(matcher: Matcher[Any]) -> None:
    """Require that moving reference and guess together moves the answer along."""
    distances, rotations = [], []
    for trial in range(TRIALS):
        room = room_pair(trial)
        guess = guesses(room.truth, 0.5 * WINDOW.half, 1, trial)[0]
        here = matcher.match(matcher.prepare(room.reference), room.scan, guess, WINDOW, generator(trial))
        moved = matcher.prepare(transform(FRAME, room.reference))
        there = matcher.match(moved, room.scan, compose(FRAME, guess), WINDOW, generator(trial))
        distance, rotation = apart(there.pose, compose(FRAME, here.pose))
        distances.append(distance)
        rotations.append(rotation)
    require_close(distances, rotations, "from where the answer should have moved with its frame")


def check_window(matcher: Matcher[Any]) -> None:
    """No answer is outside the window; a rejected one is the guess, not converged."""
    room = room_pair()
    reference = matcher.prepare(room.reference)
    small = SearchWindow(0.03, 0.02, np.radians(0.5))
    for window, factor in ((small, 4.0), (small, 1.2), (WINDOW, 1.0), (WINDOW, 5.0)):
        for trial, guess in enumerate(guesses(room.truth, factor * window.half / 0.8, 6)):
            result = matcher.match(reference, room.scan, guess, window, generator(trial))
            off = result.pose - guess
            off[2] = wrap(off[2])
            require(
                window.contains(guess, result.pose, tolerance=1e-6),
                f"the answer is {off} (m, m, rad) from the guess; the window allows {window.half}",
            )
            if "rejected" in result.diagnostics:
                require(
                    not result.converged and max(apart(result.pose, guess)) < 1e-9,
                    "a rejected match must give the guess and converged=False",
                )


def check_determinism(matcher: Matcher[Any]) -> None:
    """Equal inputs and equal generators give equal results, to the last bit, whatever came before."""
    first, other = room_pair(0), room_pair(1)
    reference = matcher.prepare(first.reference)
    once = match_room(matcher)
    for attempt in range(3):
        require_equal(match_room(matcher), once, "equal inputs and generators give another result")
        matcher.match(reference, other.scan, other.truth, WINDOW, generator(attempt))
        again = matcher.match(reference, first.scan, easy_guess(), WINDOW, generator())
        require_equal(again, once, "a reference or a matcher used before gives another result")


def check_threads(matcher: Matcher[Any]) -> None:
    """Two threads share one matcher and one reference."""
    room = room_pair()
    starts = guesses(room.truth, WINDOW.half, 12)

    def run(shared: Any, trial: int) -> MatchResult:
        return matcher.match(shared, room.scan, starts[trial], WINDOW, generator(trial))

    serial_reference, shared = matcher.prepare(room.reference), matcher.prepare(room.reference)
    serial = [run(serial_reference, trial) for trial in range(len(starts))]
    with ThreadPoolExecutor(2) as pool:
        threaded = list(pool.map(lambda trial: run(shared, trial), range(len(starts))))
    for one, two in zip(serial, threaded, strict=True):
        require_equal(two, one, "two threads give another result than one")


def check_many(matcher: Matcher[Any]) -> None:
    """`match_many` answers to several scans what `match` answers to one after the other."""
    room, other = room_pair(0), room_pair(1)
    reference = matcher.prepare(room.reference)
    scans = [room.scan, other.scan, room.scan[:2], room.scan[::2], np.vstack((room.scan, [[np.nan, 0.0]]))]
    starts = guesses(room.truth, WINDOW.half, len(scans))
    # With a scan of too few points among the others, without it, and with nothing to match.
    for chosen in (list(range(len(scans))), [0, 1, 3, 4], []):
        rng, again = generator(), generator()
        found = matcher.match_many(reference, [scans[i] for i in chosen], starts[chosen], WINDOW, rng)
        require(
            len(found.poses)
            == len(found.covariances)
            == len(found.scores)
            == len(found.converged)
            == len(chosen),
            f"match_many answers to {len(chosen)} scans with {len(found.poses)} poses",
        )
        for k, i in enumerate(chosen):
            single = matcher.match(reference, scans[i], starts[i], WINDOW, again)
            same = (
                np.array_equal(found.poses[k], single.pose)
                and np.array_equal(found.covariances[k], single.covariance)
                and found.scores[k] == single.score
                and found.converged[k] == single.converged
            )
            require(same, f"match_many: pose {found.poses[k]}, where match finds {single.pose}")


def check_extend(matcher: Matcher[Any]) -> None:
    """A reference that grew scan by scan serves as well as one of all its points."""
    rooms = [room_pair(seed) for seed in range(3)]
    # Each of three scans adds a part of the room that the others leave out.
    parts = [transform(room.truth, room.scan)[80 * i : 80 * i + 90] for i, room in enumerate(rooms)]
    distances, rotations, last = [], [], room_pair(3)
    starts = guesses(last.truth, WINDOW.half, TRIALS)
    for seed, guess in enumerate(starts):
        answers = []
        for _ in range(2):
            grown = matcher.prepare(parts[0])
            for part in parts[1:]:
                grown = matcher.extend(grown, part)
            answers.append(matcher.match(grown, last.scan, guess, WINDOW, generator(seed)))
        require_equal(answers[0], answers[1], "extend: the same scans added to the same reference")
        distance, rotation = apart(answers[0].pose, last.truth)
        distances.append(distance)
        rotations.append(rotation)
    count = sum(map(len, parts))
    require(len(grown.points) == count, f"extend: {len(grown.points)} points of {count} are in the reference")
    require_close(distances, rotations, "off the truth in a reference that grew from three scans")
