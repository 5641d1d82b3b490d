"""A wide window for any matcher: tiles of its usual size, the best answer of all."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.matching.interface import Matcher, Reference, SearchWindow
from hsslam.matching.results import MatchResult
from hsslam.se2 import Points, Pose, wrap

OVERLAP = 0.75
"""Distance of neighbouring tiles as a share of their size: a truth at a tile's edge is well inside the next."""


def match_tiles(
    matcher: Matcher[Any],
    reference: Reference,
    points: Points,
    centre: Pose,
    wide: SearchWindow,
    tile: SearchWindow,
    rng: np.random.Generator,
    enough: float = math.inf,
) -> MatchResult:
    """Match from the middle of every tile of a wide window and take the answer of highest score.

    A local method cannot reach far and a population cannot fill a large window; both can look at every part of
    it in turn.

    Parameters
    ----------
    matcher, reference, points, rng
        As for `hsslam.matching.Matcher.match`.
    centre : Pose
        Of the wide window.
    wide, tile : SearchWindow
        The whole, and the part searched at a time: those nearest to the middle first.
    enough : float
        A converged answer of this score ends the search.

    Returns
    -------
    MatchResult
        The best converged answer (else the best); ``evaluations`` is the sum over all tiles.
    """
    best: MatchResult | None = None
    evaluations = 0
    steps = (steps_along(w, t) for w, t in zip(wide.half, tile.half, strict=True))
    offsets = np.array(list(product(*steps)))
    for offset in offsets[np.argsort(np.square(offsets / tile.half).sum(axis=1), kind="stable")]:
        result = matcher.match(reference, points, centre + offset, tile, rng)
        evaluations += result.evaluations
        if best is None or (result.converged, result.score) > (best.converged, best.score):
            best = result
            if best.converged and best.score >= enough:
                break
    assert best is not None
    return replace(best, evaluations=evaluations)


def steps_along(wide: float, tile: float) -> NDArray[np.float64]:
    """Middles of the tiles along one axis, symmetric about 0, so that they cover ``wide`` either way."""
    count = 2 * int(np.ceil(max(wide - tile, 0.0) / (2.0 * tile * OVERLAP))) + 1
    reach = max(wide - tile, 0.0)
    return np.linspace(-reach, reach, count)


def best_elsewhere(
    matcher: Matcher[Any],
    reference: Reference,
    points: Points,
    answer: Pose,
    wide: SearchWindow,
    tile: SearchWindow,
    apart: SearchWindow,
    rng: np.random.Generator,
) -> float:
    """Score of the best match that is not the answer in question.

    Parameters
    ----------
    matcher, reference, points, rng
        As for `hsslam.matching.Matcher.match`.
    answer : Pose
        In the reference's frame.
    wide, tile : SearchWindow
        What is searched around the answer, and the part searched at a time.
    apart : SearchWindow
        A match outside of it is another answer; its ``half_x`` is the distance in any direction.
    """
    best = 0.0
    steps = (steps_along(w, t) for w, t in zip(wide.half, tile.half, strict=True))
    for offset in product(*steps):
        # A tile whose every place is near the answer can tell nothing else.
        if (
            np.hypot(offset[0], offset[1]) + tile.half_x < apart.half_x
            and abs(offset[2]) + tile.half_theta < apart.half_theta
        ):
            continue
        result = matcher.match(reference, points, answer + np.array(offset), tile, rng)
        away = result.pose - answer
        far = np.hypot(away[0], away[1]) >= apart.half_x or abs(wrap(away[2])) >= apart.half_theta
        if result.converged and far:
            best = max(best, result.score)
    return best
