"""Corridors: a look along the direction that the scan hardly fixes, and what it spares a search."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.kernels.fitness import count_hits
from hsslam.kernels.surface import scan_lines
from hsslam.matching import SearchWindow, create
from hsslam.se2 import Points, Pose, between, transform
from hsslam.search import HitFitness
from hsslam.search.population import PopulationConfig, PopulationReference
from hsslam.search.slide import GAIN, WEAK, slide, weak_direction

WINDOW = SearchWindow(0.15, 0.15, math.radians(10.0))


def corridor(closed: bool = True, length: float = 12.0) -> Points:
    """A corridor along x, 2 m wide, seen from its middle; half of its right end has a wall if it is ``closed``."""
    x = np.arange(-0.5 * length, 0.5 * length, 0.08)
    across = np.arange(-0.95, 0.1, 0.08) if closed else np.empty(0)
    return np.vstack(
        (
            np.column_stack((x, np.full(len(x), -1.0))),
            np.column_stack((np.full(len(across), x[-1] + 0.05), across)),
            np.column_stack((x[::-1], np.full(len(x), 1.0))),
        )
    )


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 1.0))
@settings(deadline=None, max_examples=60)
def test_the_weak_direction_agrees_with_numpy(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    turn = rng.uniform(-math.pi, math.pi)
    normals = rng.normal(0.0, [1.0, share], (100, 2)) @ np.array(
        [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    )
    values, vectors = np.linalg.eigh(normals.T @ normals)
    found = weak_direction(np.column_stack((normals, np.zeros(100))))
    if values[0] > WEAK * values[1]:
        assert math.isnan(found)
    else:
        assert abs(vectors[:, 0] @ [math.cos(found), math.sin(found)]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("off", [0.0, 0.12, -0.2, 0.28])
@pytest.mark.parametrize("turn", [0.0, 0.7, -2.5])
def test_sliding_finds_the_pose_with_most_hits_along_a_corridor(off: float, turn: float) -> None:
    points, truth = corridor(), np.array([0.5, -0.3, turn])
    raster = PopulationReference(transform(truth, points), PopulationConfig(fitness="surface")).raster
    fitness = HitFitness.of(raster, points)
    along = np.array([math.cos(turn), math.sin(turn), 0.0])
    start, window = truth + off * along, SearchWindow(0.31, 0.31, 0.2)
    found, looked = slide(raster, points, scan_lines(points), start, truth, window, 0.05)

    def hits(pose: Pose) -> int:
        return count_hits(raster.cells, raster.frame, fitness.xs, fitness.ys, *pose, 0)

    tried = [start + 0.05 * k * along for k in range(-20, 21)]
    tried = [pose for pose in tried if window.contains(truth, pose, 0.0)]
    best = max(hits(pose) for pose in tried)
    assert looked == len(tried)
    if best - hits(start) > GAIN * len(points):
        assert found is not None
        assert hits(found) == best
        assert np.abs(between(truth, found)[:2]).max() < 0.08
    else:
        assert found is None
        assert abs(off) < 0.05


def test_nothing_is_looked_for_where_every_direction_is_fixed() -> None:
    room = np.vstack((corridor(length=4.0), 3.0 * corridor(length=2.0)[:, ::-1]))
    raster = PopulationReference(room, PopulationConfig()).raster
    assert slide(raster, room, scan_lines(room), np.zeros(3), np.zeros(3), WINDOW, 0.05) == (None, 0)


def test_a_plain_corridor_moves_no_pose() -> None:
    points = corridor(closed=False, length=40.0)[::2]
    raster = PopulationReference(points, PopulationConfig()).raster
    found, looked = slide(raster, points, scan_lines(points), np.zeros(3), np.zeros(3), WINDOW, 0.05)
    assert found is None
    assert looked > 1


def test_an_end_tells_where_along_a_corridor() -> None:
    """Without a look along the corridor, 22 of these trials ended up to 30 cm off."""
    matcher, points = create("hide"), corridor()
    reference, off = matcher.prepare(points), []
    for trial in range(800):
        rng = np.random.default_rng(trial)
        guess = rng.uniform(-1.0, 1.0, 3) * WINDOW.half
        seen = points + rng.normal(0.0, 0.005, points.shape)
        off.append(np.abs(matcher.match(reference, seen, guess, WINDOW, rng).pose[:2]).max())
    assert np.max(off) < 0.05
