"""Which keyframes are known relative to one another."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hsslam.slam.sessions import Pause, Sessions, chosen


def sessions(*lengths: int) -> Sessions:
    """So many keyframes each, with pauses in between."""
    made = Sessions()
    for number, length in enumerate(lengths):
        for k in range(length):
            made.add(Pause(np.zeros(3), math.inf) if number and k == 0 else None)
    return made


def test_a_pause_begins_a_session() -> None:
    made = sessions(3, 2, 4)
    assert made.numbers.tolist() == [0, 0, 0, 3, 3, 5, 5, 5, 5]
    assert sorted(made.pauses) == [3, 5]
    assert [made.start(k) for k in range(9)] == [0, 0, 0, 3, 3, 5, 5, 5, 5]
    assert [part.tolist() for part in made.split()] == [[0, 1, 2], [3, 4], [5, 6, 7, 8]]
    assert made.foreign(4).tolist() == [True] * 3 + [False] * 2 + [True] * 4
    assert not made.single
    assert sessions(4).single


def test_the_session_of_keyframe_0_stays() -> None:
    made = sessions(3, 2, 4)
    assert np.flatnonzero(made.join(6, 1)).tolist() == [5, 6, 7, 8]
    assert made.numbers.tolist() == [0, 0, 0, 3, 3, 0, 0, 0, 0]
    assert made.start(8) == 5
    assert np.flatnonzero(made.join(8, 4)).tolist() == [3, 4]
    assert made.single
    assert made.start(8) == 0


def test_of_two_others_the_second_moves() -> None:
    made = sessions(3, 2, 4)
    assert np.flatnonzero(made.join(4, 6)).tolist() == [5, 6, 7, 8]
    assert made.numbers.tolist() == [0, 0, 0, 3, 3, 3, 3, 3, 3]


@given(st.lists(st.integers(1, 6), min_size=1, max_size=6), st.data())
def test_around_is_the_longest_stretch_of_one_session(lengths: list[int], data: st.DataObject) -> None:
    made = sessions(*lengths)
    count = len(made)
    low = data.draw(st.integers(0, count - 1))
    high = data.draw(st.integers(low + 1, count))
    keyframe = data.draw(st.integers(low, high - 1))
    first, stop = made.around(keyframe, low, high)
    assert low <= first <= keyframe < stop <= high
    own = made.numbers[keyframe]
    assert (made.numbers[first:stop] == own).all()
    assert first == low or made.numbers[first - 1] != own
    assert stop == high or made.numbers[stop] != own


def test_chosen_takes_items_by_their_numbers() -> None:
    assert chosen("abcd", np.array([3, 0])) == ["d", "a"]
