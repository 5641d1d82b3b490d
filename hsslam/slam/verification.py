"""Which loops to believe: those that the graph foresaw, and those that others confirm."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hsslam.config import LoopSection
from hsslam.se2 import Poses, between, compose
from hsslam.slam.events import LoopChecked
from hsslam.slam.fusion import GATE

COMPARABLE_GAP = 60
"""Keyframes between the ends of two loops, at most, if the graph is to tell whether they agree."""

AGREEMENT_XY = 0.10
AGREEMENT_XY_PER_METRE = 0.02
AGREEMENT_THETA = math.radians(2.0)
"""Two loops agree when going round both of them ends this near to the start (m, m per metre of way, rad)."""


WELL_KNOWN = 0.33
"""A standard deviation (m) up to which the usual number of loops must agree; each doubling takes as many more.

A window as wide as the graph is unsure holds the more places that look like the one sought, the wider it is.
"""

OUTVOTED = 5
"""This many times the loops that must agree outvote an ambiguity.

Along a corridor every shift explains nearly all points, and only the niches tell which is right. Were that chance,
the loops would not all say the same.
"""


class LoopVerifier:
    """Judges matched loops; some at once, others when more is known.

    Parameters
    ----------
    rules : LoopSection
        What a loop must fulfil.
    ambiguity : callable
        Looks for another answer to a loop: the score of the best one over the loop's own.
    """

    def __init__(self, rules: LoopSection, ambiguity: Callable[[LoopChecked], float]) -> None:
        self._rules = rules
        self._ambiguity = ambiguity
        self._pending: list[LoopChecked] = []
        self._believed: list[LoopChecked] = []

    def judge(self, loop: LoopChecked, poses: Poses) -> list[LoopChecked]:
        """Judge a matched loop: all the loops on which this settles the verdict, possibly none.

        Parameters
        ----------
        loop : LoopChecked
            Its ``reason`` says why its match alone condemns it, if it does.
        poses : Poses
            (K, 3) current estimate of all keyframes.
        """
        if loop.reason:
            return [loop]
        rules = self._rules
        if loop.expected_std <= rules.expected_std and loop.surprise <= GATE:
            return [self._believe(loop)]
        companions = [other for other in self._pending if agree(loop, other, poses)]
        believed = [other for other in self._believed if agree(loop, other, poses)]
        loop = replace(loop, agreeing=len(companions) + len(believed))
        if loop.agreeing < self._needed(loop) or loop.agreeing <= self._contradicted(loop, poses):
            self._pending.append(loop)
            return []
        if loop.expected_std > rules.expected_std:  # else the window was too small to hold another answer
            loop = replace(loop, ambiguity=self._ambiguity(loop))
        if loop.ambiguity > rules.max_ambiguity and loop.agreeing < OUTVOTED * rules.agreeing:
            self._pending.append(loop)
            return []
        self._pending = [other for other in self._pending if other not in companions]
        return [
            self._believe(replace(member, agreeing=max(member.agreeing, loop.agreeing)))
            for member in (*companions, loop)
        ]

    def expire(self, newest: int) -> list[LoopChecked]:
        """Refuse the loops that waited too long; ``newest`` is the newest keyframe."""
        oldest = newest - self._rules.patience
        self._believed = [loop for loop in self._believed if loop.second >= oldest]
        over = [loop for loop in self._pending if loop.second < oldest]
        self._pending = [loop for loop in self._pending if loop.second >= oldest]
        return [replace(loop, accepted=False, reason=self._refusal(loop)) for loop in over]

    def close(self) -> list[LoopChecked]:
        """Refuse all that still wait: the log is over."""
        over, self._pending = self._pending, []
        return [replace(loop, accepted=False, reason=self._refusal(loop)) for loop in over]

    def _needed(self, loop: LoopChecked) -> int:
        """How many others must agree with a loop."""
        doublings = math.log2(max(loop.expected_std / WELL_KNOWN, 1.0))
        return round(self._rules.agreeing * (1.0 + doublings))

    def _contradicted(self, loop: LoopChecked, poses: Poses) -> int:
        """How many agree, at most, with a loop that waits and contradicts this one; -1 if none does."""
        return max(
            (
                other.agreeing
                for other in self._pending
                if comparable(loop, other) and not agree(loop, other, poses)
            ),
            default=-1,
        )

    def _believe(self, loop: LoopChecked) -> LoopChecked:
        loop = replace(loop, accepted=True)
        self._believed.append(loop)
        return loop

    def _refusal(self, loop: LoopChecked) -> str:
        rules = self._rules
        if loop.ambiguity > rules.max_ambiguity:
            return f"ambiguous: another pose scores {loop.ambiguity:.2f} of its score"
        if loop.agreeing < self._needed(loop):
            return f"{loop.agreeing} other loops agree with it, not {self._needed(loop)}"
        return f"{loop.agreeing} other loops agree with it, but as many with one that contradicts it"


def comparable(a: LoopChecked, b: LoopChecked) -> bool:
    """Whether two loops are of different keyframes, and so near in time that the graph can tell whether they agree."""
    gap = max(abs(a.second - b.second), abs(a.first - b.first))
    return a.second != b.second and gap <= COMPARABLE_GAP


def agree(a: LoopChecked, b: LoopChecked, poses: Poses) -> bool:
    """Whether two comparable loops say the same of the robot's whereabouts."""
    if not comparable(a, b):
        return False
    there = compose(a.relative, between(poses[a.second], poses[b.second]))
    here = compose(between(poses[a.first], poses[b.first]), b.relative)
    error = between(there, here)
    way = float(
        np.hypot(*(poses[a.second] - poses[b.second])[:2]) + np.hypot(*(poses[a.first] - poses[b.first])[:2])
    )
    near = math.hypot(error[0], error[1]) <= AGREEMENT_XY + AGREEMENT_XY_PER_METRE * way
    return near and abs(error[2]) <= AGREEMENT_THETA
