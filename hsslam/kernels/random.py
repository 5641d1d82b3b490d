"""Random numbers inside kernels, where drawing one from a NumPy generator costs as much as moving ten points.

SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014): a counter and a mixing
function; passes BigCrush, and a search draws a few thousand numbers from it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


def seed_of(rng: np.random.Generator) -> int:
    """Draw a seed for `seeded` from a generator, in [0, 2^63)."""
    return int(rng.bit_generator.random_raw()) >> 1


def seeds_of(rng: np.random.Generator, count: int) -> NDArray[np.int64]:
    """Draw seeds (count,), the same as `seed_of` draws one after the other."""
    return (rng.bit_generator.random_raw(count) >> np.uint64(1)).astype(np.int64)


@kernel
def seeded(seed: int) -> NDArray[np.uint64]:
    """State of a stream of random numbers, uint64 (1,)."""
    state = np.empty(1, dtype=np.uint64)
    state[0] = np.uint64(seed)
    return state


@kernel
def next_word(state: NDArray[np.uint64]) -> np.uint64:
    """Next 64 random bits."""
    state[0] += _STEP
    word = state[0]
    word = (word ^ (word >> _30)) * _FIRST
    word = (word ^ (word >> _27)) * _SECOND
    mixed: np.uint64 = word ^ (word >> _31)
    return mixed


@kernel
def uniform(state: NDArray[np.uint64]) -> float:
    """Next number, uniform in [0, 1)."""
    return float(next_word(state) >> _11) * 2.0**-53


@kernel
def below(state: NDArray[np.uint64], count: int) -> int:
    """Next whole number, uniform in [0, count)."""
    return int(uniform(state) * count)
