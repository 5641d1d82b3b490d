"""Looking for another answer: a place that repeats has one, a room with an alcove has none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import room_scan_at
from numpy.typing import NDArray

from hsslam.matching import create
from hsslam.matching.interface import SearchWindow
from hsslam.se2 import pose
from hsslam.slam.recovery import best_elsewhere, match_tiles

WIDE = SearchWindow(1.2, 0.4, math.radians(10.0))
TILE = SearchWindow(0.3, 0.2, math.radians(10.0))
APART = SearchWindow(0.5, 0.5, math.radians(15.0))


def niches(count: int, spacing: float) -> NDArray[np.float64]:
    """A wall with teeth at equal distances: it fits itself one tooth on."""
    along = np.arange(-4.0, 4.0 + 1e-9, 0.02)
    wall = np.column_stack((along, np.where((along / spacing) % 1.0 < 0.5, 2.0, 2.4)))
    sides = [
        np.column_stack((np.full(20, k * spacing / 2.0), np.linspace(2.0, 2.4, 20)))
        for k in range(-count, count + 1)
    ]
    return np.concatenate((wall, *sides))


def elsewhere(points: NDArray[np.float64], answer: NDArray[np.float64]) -> float:
    matcher = create("hide")
    rng = np.random.default_rng(1)
    return best_elsewhere(matcher, matcher.prepare(points), points, answer, WIDE, TILE, APART, rng)


def test_a_wall_that_repeats_has_another_answer() -> None:
    assert elsewhere(niches(9, 0.8), np.zeros(3)) > 0.8


def test_a_room_that_does_not_repeat_has_none_as_good() -> None:
    assert elsewhere(room_scan_at(np.zeros(3)).points, np.zeros(3)) < 0.7


def test_the_answer_itself_is_no_other_one() -> None:
    """Even where the search meets it again in every tile."""
    matcher, points = create("hide"), room_scan_at(np.zeros(3)).points
    score = best_elsewhere(
        matcher,
        matcher.prepare(points),
        points,
        np.zeros(3),
        TILE,
        TILE,
        SearchWindow(5.0, 5.0, math.pi),
        np.random.default_rng(1),
    )
    assert score == 0.0


def test_tiles_find_what_one_of_them_cannot() -> None:
    matcher, truth = create("icp"), pose(0.8, -0.3, 0.1)
    reference = matcher.prepare(room_scan_at(np.zeros(3)).points)
    points = room_scan_at(truth, noise=0.005).points
    result = match_tiles(matcher, reference, points, np.zeros(3), WIDE, TILE, np.random.default_rng(1))
    assert result.converged
    assert result.pose == pytest.approx(truth, abs=0.03)


def test_tiles_end_with_the_nearest_answer_that_fits_as_it_should() -> None:
    matcher, points = create("pl_icp"), niches(9, 0.8)
    reference = matcher.prepare(points)

    def found(enough: float) -> tuple[float, int]:
        result = match_tiles(
            matcher, reference, points, pose(0.3, 0.0, 0.0), WIDE, TILE, np.random.default_rng(1), enough
        )
        assert result.converged
        return result.pose[0], result.evaluations

    everywhere, most = found(math.inf)
    nearest, spent = found(0.9)
    assert everywhere == pytest.approx(0.0, abs=0.02)
    assert nearest == pytest.approx(0.0, abs=0.02)
    assert spent < 0.5 * most
    assert found(1.1) == (everywhere, most)
