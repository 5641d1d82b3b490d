"""Random generators of a run: one per match, so that a resumed run draws what the whole run would have drawn."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a match is for; part of its seed."""

    TRACK = 0
    LOOP = 1
    OVERLAP = 2


def generator(seed: int, purpose: Purpose, *numbers: int) -> np.random.Generator:
    """Generator of the match that ``purpose`` and ``numbers`` (scan or keyframe numbers) name."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence([seed, purpose, *numbers])))
