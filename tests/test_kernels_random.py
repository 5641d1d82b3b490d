"""Random numbers of the kernels."""

from __future__ import annotations

import numpy as np
import pytest

from hsslam.kernels.random import below, next_word, seed_of, seeded, seeds_of, uniform


def test_words_are_those_of_splitmix64() -> None:
    state = seeded(1234567)
    words = [int(next_word(state)) for _ in range(3)]
    assert words == [6457827717110365317, 3203168211198807973, 9817491932198370423]


def test_uniform_numbers_fill_the_unit_interval_evenly() -> None:
    state = seeded(seed_of(np.random.default_rng(0)))
    drawn = np.array([uniform(state) for _ in range(20_000)])
    assert drawn.min() >= 0.0 and drawn.max() < 1.0
    assert np.histogram(drawn, bins=20, range=(0.0, 1.0))[0] == pytest.approx(1000, abs=150)
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.03


def test_whole_numbers_reach_every_value_below() -> None:
    state = seeded(5)
    assert {below(state, 7) for _ in range(300)} == set(range(7))


def test_seeds_differ_from_draw_to_draw_and_repeat_with_the_generator() -> None:
    first, again = np.random.default_rng(3), np.random.default_rng(3)
    seeds = [seed_of(first) for _ in range(10)]
    assert seeds == [seed_of(again) for _ in range(10)]
    assert len(set(seeds)) == 10 and min(seeds) >= 0
    assert seeds_of(np.random.default_rng(3), 10).tolist() == seeds
