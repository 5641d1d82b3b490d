"""Random generators of a run: one per match, so that a resumed run draws what the whole run would have drawn."""

from __future__ import annotations

from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Purpose(IntEnum):
    """What a match is for; part of its seed."""

    TRACK = 0
    LOOP = 1
    OVERLAP = 2
    AMBIGUITY = 3
    SCAN = 4
    PAIR = 5
    RELOCALISE = 6


_WORD = 2**64


class _Key(np.random.SeedSequence):
    """What Philox takes for its key: given no more than that, it would first gather entropy, and that takes longer."""

    def __init__(self, words: NDArray[np.uint64]) -> None:
        self._words = words

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> NDArray[Any]:
        """The key itself."""
        return self._words

    def spawn(self, n_children: int) -> list[Any]:
        """Seeds of generators that a matcher spawns from its own; they follow from the key."""
        return self._family.spawn(n_children)

    @cached_property
    def _family(self) -> np.random.SeedSequence:
        return np.random.SeedSequence(self._words.tolist())


def generator(seed: int, purpose: Purpose, *numbers: int) -> np.random.Generator:
    """Generator of the match that ``purpose`` and up to three ``numbers`` (of scans, keyframes) name.

    Philox keeps a stream of its own for every key, so the numbers themselves are the key: that takes a third of
    the time that mixing them would.
    """
    packed = 0
    for number in numbers:
        packed = (packed << 24) + number
    key = np.array([(8 * seed + purpose) % _WORD, packed % _WORD], dtype=np.uint64)
    return np.random.Generator(np.random.Philox(_Key(key)))
