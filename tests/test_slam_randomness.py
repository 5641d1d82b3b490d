"""Generators of a run: one per match, told by what the match is for."""

from __future__ import annotations

import pickle

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hsslam.slam.randomness import Purpose, generator

numbers = st.integers(0, 2**24 - 1)


@given(st.integers(0, 2**60), st.sampled_from(Purpose), numbers, numbers)
def test_the_stream_is_that_of_philox_under_the_numbers(
    seed: int, purpose: Purpose, first: int, second: int
) -> None:
    key = np.array([8 * seed + purpose, (first << 24) + second], dtype=np.uint64)
    expected = np.random.Generator(np.random.Philox(key=key))
    found = generator(seed, purpose, first, second)
    assert (found.normal(size=20) == expected.normal(size=20)).all()


def test_matches_differ() -> None:
    draws = {generator(0, purpose, k).random() for purpose in Purpose for k in range(50)}
    assert len(draws) == 50 * len(Purpose)


def test_what_a_matcher_spawns_follows_from_the_match_and_differs_from_child_to_child() -> None:
    def children() -> list[float]:
        rng = generator(3, Purpose.TRACK, 7)
        return [child.random() for child in rng.spawn(2) + rng.spawn(2)]

    assert children() == children()
    assert len(set(children())) == 4


def test_a_generator_travels_to_another_process() -> None:
    rng = generator(3, Purpose.TRACK, 7)
    rng.random()
    assert pickle.loads(pickle.dumps(rng)).random() == rng.random()
