"""Where is the robot? Every place of the other sessions is looked at, and what one scan says the next must confirm."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import numpy as np

from hsslam.config import Config
from hsslam.matching.interface import Matcher
from hsslam.se2 import Pose, Poses, between, compose, inverse
from hsslam.slam.events import LoopChecked
from hsslam.slam.fusion import of_inverse
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.places import APART, Answer, PlaceSearch, distances
from hsslam.slam.stopwatch import Stopwatch
from hsslam.slam.windows import differences

MOST_PLACES = 100
"""Places that one keyframe is tried in, at most; the next goes on with others."""

PROMISING = 3
"""Places, those of the coarse search's best answers, in which a keyframe is matched."""

EAGER = 10
EVERY, SELDOM, PATIENCE = 3, 10, 30
"""So many keyframes of a session look everywhere, then one of `EVERY`, and of one more after every `PATIENCE` of them,
of `SELDOM` at most. All are tried where a guess says that they are."""

COARSELY = 0.55
"""Share of the usual score that the coarse search must find."""

SURE, MOSTLY = 0.9, 0.75
"""What the matches of a guess must come to on average to be believed: share of the usual score as for `LIKELY`, and of
all returns; see `PLENTY`."""

SPEED, TURN_RATE = 1.5, 1.0
"""Of a robot, or of who carries it (m/s, rad/s)."""

DRIFT = 0.2
DRIFT_THETA = math.radians(25.0)
"""What odometry may be off after a pause that it knows of: share of the way, and heading (rad)."""

MISSES = 2
MEMORY = 10
"""Keyframes in a row that may fail to confirm a guess, and that may see nothing that could. One that was refuted is
remembered for as many: where two were as good for a while, others may be."""

SAME_XY = 0.3
SAME_THETA = math.radians(5.0)
"""Two guesses this near to one another (m, rad) are one; a match this far from its guess does not confirm it."""

MOST_GUESSES = 10
"""Guesses that are followed, at most."""


@dataclass(frozen=True)
class Confirmation:
    """What it takes to believe a guess.

    Attributes
    ----------
    keyframes : int
        That must say the same.
    way, turn : float
        How far apart two of them are (m, rad), each at least.
    both : float
        What `WIDE` of way and turn together come to.
    """

    keyframes: int
    way: float
    turn: float
    both: float = 0.0

    def fulfilled(self, guess: Guess, poses: Poses) -> bool:
        """Whether enough keyframes that are far enough apart confirm a guess."""
        way, turn = guess.spread(poses)
        enough = len(guess.matches) >= self.keyframes and way >= self.way and turn >= self.turn
        return enough and way / WIDE[0] + turn / WIDE[1] >= self.both


FORESEEN = Confirmation(5, 1.0, 0.0)
"""The guess is where odometry says, or the robot cannot have been taken farther than `NEARBY`."""

REACHABLE = Confirmation(8, 2.0, math.radians(45.0))
"""The robot may have been taken there in the time, not farther than `FARTHER`."""

NEARBY, FARTHER = 5.0, 15.0
"""Metres."""

WIDE = (5.0, math.radians(90.0))
"""A wide way and a wide turn (m, rad)."""

SOMEWHERE = Confirmation(10, 2.0, math.radians(30.0), 1.5)
"""Ten metres of one corridor may look just like those of another, or like their own the other way round; they do no
more where the robot turns off."""

PLENTY = Confirmation(20, 5.0, math.radians(45.0), 2.0)
"""So many keyframes need not see mostly what is known: the session grazes the other."""


class Guess:
    """Where the robot's session may lie in another one: the matches that say so, the newest last."""

    def __init__(self, first: Answer) -> None:
        self.matches = [first.match]
        self.misses = 0
        self._fits = [first.fit]

    def add(self, answer: Answer) -> None:
        """One more that says so."""
        self.matches.append(answer.match)
        self._fits.append(answer.fit)
        self.misses = 0

    @property
    def fit(self) -> float:
        """Mean of its answers'."""
        return sum(self._fits) / len(self._fits)

    @property
    def score(self) -> float:
        """Mean of its matches'."""
        return sum(match.score for match in self.matches) / len(self.matches)

    def foretells(self, keyframe: int, poses: Poses) -> Pose:
        """Where it says that a keyframe of the robot's session is, among the other session's."""
        last = self.matches[-1]
        there = compose(poses[last.first], last.relative)
        return compose(there, between(poses[last.second], poses[keyframe]))

    def spread(self, poses: Poses) -> tuple[float, float]:
        """How far apart (m, rad) the keyframes that said so are from the first of them, at most."""
        off = differences(poses[[match.second for match in self.matches]], poses[self.matches[0].second])
        return float(np.hypot(off[:, 0], off[:, 1]).max()), float(np.abs(off[:, 2]).max())


class Relocalisation:
    """Looks for one keyframe after another in the sessions that they do not belong to.

    Parameters
    ----------
    config : Config
        Its ``loops`` and ``tracker`` sections and its seed.
    matcher : Matcher
        Of loops.
    stopwatch : Stopwatch
        Told how long all of it took.
    """

    def __init__(self, config: Config, matcher: Matcher[Any], stopwatch: Stopwatch) -> None:
        self._config = config
        self._matcher = matcher
        self._stopwatch = stopwatch
        self._guesses: list[Guess] = []
        self._refuted: list[Guess] = []
        self._next = 0

    def look(self, keyframe: int, keyframes: Keyframes, usual: float) -> list[LoopChecked]:
        """Look for a keyframe in the sessions that it does not belong to.

        Parameters
        ----------
        keyframe : int
            One that follows the last that was looked for, or the first of a session.
        keyframes : Keyframes
            All of them.
        usual : float
            What the last scans scored where they were tracked.

        Returns
        -------
        list of LoopChecked
            Once the robot's place is known: loops between keyframes of both sessions that say so, all accepted.
        """
        with self._stopwatch.measure("relocalisation"):
            return self._look(PlaceSearch(self._config, self._matcher, keyframe, keyframes), usual)

    def _look(self, search: PlaceSearch, usual: float) -> list[LoopChecked]:
        foreign = search.foreign
        self._guesses = [
            guess
            for guess in self._guesses
            if foreign[guess.matches[-1].first] and not foreign[guess.matches[-1].second]
        ]
        for guess in self._guesses:
            _confirm(guess, search, usual)
        recent = [g for g in self._guesses if search.keyframe - g.matches[-1].second <= MEMORY]
        self._guesses = [guess for guess in recent if guess.misses <= MISSES]
        self._refuted = [
            g for g in self._refuted if 0 <= search.keyframe - g.matches[-1].second <= MEMORY
        ] + [guess for guess in recent if guess.misses > MISSES]
        own = search.keyframe - search.start
        if own < EAGER or own % min(max(own // PATIENCE, EVERY), SELDOM) == 0:
            for answer in self._everywhere(search, usual):
                self._take(answer, search.poses)
        return self._believed(search, usual)

    def _everywhere(self, search: PlaceSearch, usual: float) -> list[Answer]:
        """Matches of the keyframe in the places that look most like what it sees."""
        places = search.places()
        if len(places) > MOST_PLACES:
            start = self._next % len(places)
            self._next = start + MOST_PLACES
            places = np.roll(places, -start)[:MOST_PLACES]
        looked: list[tuple[float, int, Pose]] = []
        for first in places.tolist():
            worth_it = looked[-1][0] if len(looked) == PROMISING else COARSELY * usual
            pose, share = search.coarsely(first, worth_it)
            if share >= worth_it:
                looked = sorted([*looked, (share, first, pose)], key=itemgetter(0), reverse=True)[:PROMISING]
        found = [search.match(first, pose, usual) for _, first, pose in looked]
        return [answer for answer in found if answer is not None]

    def _take(self, answer: Answer, poses: Poses) -> None:
        """A new guess, unless it says the same as one that there is."""
        match = answer.match
        there = compose(poses[match.first], match.relative)
        for guess in self._guesses:
            if _near(between(guess.foretells(match.second, poses), there)):
                return
        self._guesses.append(Guess(answer))
        self._guesses.sort(key=lambda guess: (-len(guess.matches), -guess.fit))
        del self._guesses[MOST_GUESSES:]

    def _believed(self, search: PlaceSearch, usual: float) -> list[LoopChecked]:
        """The matches of the guess that is right, if that is known by this keyframe, which confirms it."""
        ranked = sorted(self._guesses, key=lambda guess: -len(guess.matches) * guess.fit)
        if not ranked or ranked[0].matches[-1].second != search.keyframe:
            return []
        best, rivals = ranked[0], ranked[1:] + self._refuted
        rivalled = any(2 * len(rival.matches) > len(best.matches) for rival in rivals)
        enough_seen = best.score >= MOSTLY * usual or PLENTY.fulfilled(best, search.poses)
        fits = best.fit >= SURE * usual and enough_seen
        if rivalled or not fits or not _rule(best, search).fulfilled(best, search.poses):
            return []
        self._guesses, self._refuted = [], []
        agreeing = len(best.matches) - 1
        return [_in_order(replace(match, agreeing=agreeing)) for match in best.matches]


def _in_order(match: LoopChecked) -> LoopChecked:
    """A match with the earlier keyframe as its first."""
    if match.first < match.second:
        return match
    return replace(
        match,
        first=match.second,
        second=match.first,
        relative=inverse(match.relative),
        covariance=of_inverse(match.covariance, match.relative),
    )


def _confirm(guess: Guess, search: PlaceSearch, usual: float) -> None:
    """Try the keyframe where a guess says that it is."""
    foretold = guess.foretells(search.keyframe, search.poses)
    away = distances(search.poses[search.others], foretold)
    if away.min() > APART:
        return  # on ground that the other session does not know, there is nothing to confirm it
    first = int(search.others[away.argmin()])
    place = search.poses[first]
    answer = search.match(first, between(place, foretold), usual)
    if answer is not None and _near(between(foretold, compose(place, answer.match.relative))):
        guess.add(answer)
    else:
        guess.misses += 1


def _rule(guess: Guess, search: PlaceSearch) -> Confirmation:
    """What has to confirm a guess: the less, the better it agrees with what is known of the pause before."""
    start, poses, sessions = search.start, search.poses, search.sessions
    pause = sessions.pauses.get(start)
    if pause is None or sessions.numbers[start - 1] != sessions.numbers[guess.matches[-1].first]:
        return SOMEWHERE
    motion = between(poses[start - 1], guess.foretells(start, poses))
    moved, off = math.hypot(motion[0], motion[1]), between(pause.motion, motion)
    reach = SPEED * pause.seconds + SAME_XY
    way = math.hypot(pause.motion[0], pause.motion[1])
    foreseen = math.hypot(off[0], off[1]) <= SAME_XY + DRIFT * way and abs(off[2]) <= DRIFT_THETA
    reachable = moved <= reach and abs(motion[2]) <= TURN_RATE * pause.seconds + SAME_THETA
    if foreseen or (reachable and reach <= NEARBY):
        return FORESEEN
    return REACHABLE if reachable and reach <= FARTHER else SOMEWHERE


def _near(off: Pose) -> bool:
    return math.hypot(off[0], off[1]) <= SAME_XY and abs(off[2]) <= SAME_THETA
