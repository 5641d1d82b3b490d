"""References that grow scan by scan are the ones that `prepare` makes of all the points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hsslam.datasets.simulator import SimulatedDataset
from hsslam.kernels.surface import Surface, nearest_segment
from hsslam.matching import MatcherUnavailableError, SearchWindow, create, registry
from hsslam.se2 import between, compose, transform

WINDOW = SearchWindow(0.2, 0.2, 0.15)


@pytest.fixture(scope="module")
def office() -> SimulatedDataset:
    return SimulatedDataset("office", seed=3, scans=60)


@given(st.integers(0, 2**32 - 1), st.integers(1, 4))
@example(226, 4)
@settings(max_examples=15, deadline=None)
def test_a_grown_surface_knows_the_nearest_segment_everywhere(seed: int, additions: int) -> None:
    rng = np.random.default_rng(seed)
    walls = [
        np.cumsum(rng.normal(0.0, 0.15, (40, 2)), axis=0) + rng.uniform(-9, 9, 2) for _ in range(additions)
    ]
    grown = Surface.build(walls[0])
    for wall in walls[1:]:
        grown = grown.extended(wall)
    for x, y in np.vstack(walls)[::3] + rng.normal(0.0, 0.1, (len(np.vstack(walls)[::3]), 2)):
        u, v = np.floor((np.array([x, y]) - grown.frame[:2]) * grown.frame[2])
        centre = grown.frame[:2] + (np.array([u, v]) + 0.5) / grown.frame[2]
        a, b = grown.segments[:, :2], grown.segments[:, 2:]
        along = np.sum((centre - a) * (b - a), axis=1) / np.maximum(np.sum((b - a) ** 2, axis=1), 1e-300)
        foot = a + np.clip(along, 0.0, 1.0)[:, None] * (b - a)
        distance = np.hypot(*(centre - foot).T)
        found = nearest_segment(grown.nearest, grown.frame, x, y)
        if found < 0:
            assert distance.min() > 0.15 - 1e-6
        else:
            # A cell keeps the square in steps of 3.4e-7 m^2.
            assert distance[found] ** 2 == pytest.approx(distance.min() ** 2, abs=4e-7)


def test_growing_beyond_the_largest_raster_makes_cells_coarser() -> None:
    near = np.column_stack((np.arange(0.0, 5.0, 0.1), np.zeros(50)))
    grown = Surface.build(near).extended(near + [300.0, 0.0])
    assert max(grown.nearest.shape) <= 2003
    assert nearest_segment(grown.nearest, grown.frame, 302.0, 0.0) >= 0
    assert nearest_segment(grown.nearest, grown.frame, 2.0, 0.0) >= 0


@pytest.mark.parametrize("name", [name for name in registry.names() if registry.origin(name) == "hsslam"])
@pytest.mark.parametrize("fitness", ["surface", "sides", "paper", "likelihood"])
def test_every_matcher_matches_a_grown_reference_as_a_whole_one(
    name: str, fitness: str, office: SimulatedDataset
) -> None:
    config = registry.load(name).Config
    if "fitness" not in config.model_fields and fitness != "surface":
        pytest.skip(f"{name} has one fitness only")
    if name == "exhaustive" and fitness == "sides":
        pytest.skip("exhaustive proves nothing of sides")
    try:
        matcher = create(name, {"fitness": fitness} if "fitness" in config.model_fields else {})
    except MatcherUnavailableError as error:
        pytest.skip(str(error))
    truth = office.truth()
    assert truth is not None
    scans = list(office.scans())
    parts = [transform(between(truth.poses[0], truth.poses[i]), scans[i].robot_points) for i in (0, 6, 12)]
    grown = matcher.prepare(parts[0])
    for part in parts[1:]:
        grown = matcher.extend(grown, part)
    whole = matcher.prepare(np.vstack(parts))
    true = between(truth.poses[0], truth.poses[9])
    guess = compose(true, np.array([0.05, -0.06, 0.03]))
    answers = [
        matcher.match(reference, scans[9].robot_points, guess, WINDOW, np.random.default_rng(1))
        for reference in (grown, whole)
    ]
    assert len(grown.points) == len(whole.points)
    for answer in answers:
        assert answer.converged
        assert answer.score > 0.85
    assert answers[0].pose == pytest.approx(answers[1].pose, abs=0.06 if fitness == "paper" else 0.03)
