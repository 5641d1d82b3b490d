"""Which keyframes are known relative to one another: a recording that pauses begins a new session.

Whoever pauses a recording may carry the robot elsewhere meanwhile. What was driven before and after is a graph in two
parts until a place is recognised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Pose
from hsslam.slam.scan_table import Rows

_Item = TypeVar("_Item")


@dataclass(frozen=True, eq=False)
class Pause:
    """What is known of the time between two sessions.

    Attributes
    ----------
    motion : Pose
        The first keyframe after it seen from the last before it, as odometry has it.
    seconds : float
        How long it was; infinite if stamps do not tell.
    """

    motion: Pose
    seconds: float


class Sessions:
    """The session of every keyframe; sessions that were tied together are one."""

    def __init__(self) -> None:
        self._numbers = Rows(dtype=np.int64)
        self.pauses: dict[int, Pause] = {}
        """By the number of the first keyframe after them."""

    def __len__(self) -> int:
        return len(self._numbers)

    def add(self, pause: Pause | None = None) -> None:
        """Add the next keyframe: to the session of the one before it, or after a pause the first of a new one."""
        count = len(self)
        if pause is not None:
            self.pauses[count] = pause
        self._numbers.append(count if pause is not None or count == 0 else self.numbers[-1])

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Of every keyframe, the session that it belongs to, (K,): the number of a keyframe in it."""
        return self._numbers.values

    @property
    def single(self) -> bool:
        """Whether all keyframes belong to one."""
        return not self.pauses or not self.foreign(0).any()

    def foreign(self, keyframe: int) -> NDArray[np.bool_]:
        """Which keyframes are of other sessions than one of them, (K,)."""
        foreign: NDArray[np.bool_] = self.numbers != self.numbers[keyframe]
        return foreign

    def start(self, keyframe: int) -> int:
        """The first of the keyframes in a row, up to one of them, that are of its session."""
        return self.around(keyframe, 0, keyframe + 1)[0]

    def around(self, keyframe: int, low: int, high: int) -> tuple[int, int]:
        """Of keyframes ``low`` to ``high`` (not included) those around one of them in a row of its session."""
        foreign = low + np.flatnonzero(self.numbers[low:high] != self.numbers[keyframe])
        before, after = foreign[foreign < keyframe], foreign[foreign > keyframe]
        return (
            int(before[-1]) + 1 if len(before) else low,
            int(after[0]) if len(after) else high,
        )

    def join(self, one: int, other: int) -> NDArray[np.bool_]:
        """Make one of the sessions of two keyframes: which keyframes have to move, (K,).

        Those are the ones of ``other``'s session, or of ``one``'s where the other has keyframe 0, which holds the map.
        """
        numbers = self.numbers
        stays, moves = numbers[one], numbers[other]
        if moves == numbers[0]:
            stays, moves = moves, stays
        moving: NDArray[np.bool_] = numbers == moves
        numbers[moving] = stays
        return moving

    def split(self) -> list[NDArray[np.int64]]:
        """Numbers of the keyframes of every session, in the order of their first."""
        return [np.flatnonzero(self.numbers == number) for number in dict.fromkeys(self.numbers.tolist())]


def chosen(items: Sequence[_Item], numbers: NDArray[np.int64]) -> list[_Item]:
    """Items by their numbers."""
    return [items[number] for number in numbers.tolist()]
