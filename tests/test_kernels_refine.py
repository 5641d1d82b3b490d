"""The refinement and what it tells of the returns' noise, against their NumPy twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.histogram import BINS, median_of
from hsslam.kernels.lines import MEDIAN
from hsslam.kernels.refine import NO_LINES, refine, solve3
from hsslam.kernels.surface import FIT_ROUGHNESS, FIT_SPAN, Surface, lines_of, nearest_segment
from hsslam.kernels.variances import ENOUGH, EVENNESS, FASTEST, GRAZING, LEAST_GRAZING, variances_of
from hsslam.se2 import Points, Pose, transform


def corner(spacing: float = 0.03) -> Points:
    """Two walls of 2 m, seen from between them."""
    along = np.arange(0.1, 2.0, spacing)
    return np.vstack((np.column_stack((along[::-1], 0 * along)), np.column_stack((0 * along, along))))


def hall(share: float, seed: int, size: float = 6.0) -> Points:
    """Returns of a beam per degree from off the middle of a square room; they err by 1 cm and a share of the range."""
    angles = np.deg2rad(np.arange(-170.0, 170.0))
    away = size * np.array([0.2, 0.35])
    directions = np.column_stack((np.cos(angles), np.sin(angles)))
    reach = np.where(directions > 0.0, size - away, away) / np.maximum(np.abs(directions), 1e-9)
    ranges = reach.min(axis=1)
    noise = np.random.default_rng(seed).normal(0.0, 1.0, len(ranges))
    return directions * (ranges + noise * np.maximum(0.01, share * ranges))[:, None]


def distances(surface: Surface, places: Points) -> NDArray[np.float64]:
    """Signed distances (m) of places from the lines of their nearest segments."""
    lines = surface.pieces[[nearest_segment(surface.nearest, surface.frame, *place) for place in places], 5:8]
    across: NDArray[np.float64] = (lines[:, :2] * places).sum(axis=1) - lines[:, 2]
    return across


def variances_twin(
    surface: Surface, points: Points, pose: Pose, reach: float
) -> tuple[NDArray[np.float64], float]:
    """Relative variances of the ranges and the least squared cosine, by NumPy's medians."""
    across = np.abs(distances(surface, transform(pose, points)))
    ranges = np.hypot(*points.T)
    beyond = ranges > ranges.mean()
    told = across < reach
    near, far = np.median(across[told & ~beyond]) / MEDIAN, np.median(across[told & beyond]) / MEDIAN
    start, end = ranges[told & ~beyond].mean(), ranges[told & beyond].mean()
    growth = np.clip(2.0 * np.log(far / near) / np.log(end / start), 0.0, FASTEST)
    least = np.clip((2.0 * EVENNESS / (near + far)) ** 2, LEAST_GRAZING, 1.0)
    return np.maximum(ranges / start, 1.0) ** growth, float(least)


@pytest.mark.parametrize("share", [0.0, 0.005, 0.01, 0.02])
def test_variances_agree_with_numpy(share: float) -> None:
    surface, points, pose = Surface.build(hall(share, 1)), hall(share, 2), np.array([0.005, 0.0, 0.001])
    found = np.empty(len(points))
    least = variances_of(surface.pieces, surface.nearest, surface.frame, points, pose, 0.08, found)
    expected, expected_least = variances_twin(surface, points, pose, 0.08)
    # A histogram tells a median to a bin of 1.6 mm.
    assert np.log(found) == pytest.approx(np.log(expected), abs=0.35)
    assert least == pytest.approx(expected_least, rel=0.3)


def test_noise_that_grows_with_range_is_told() -> None:
    grown, even = [], []
    for share, into in ((0.02, grown), (0.0, even)):
        for seed in range(20):
            surface, points = Surface.build(hall(share, 2 * seed)), hall(share, 2 * seed + 1)
            out = np.empty(len(points))
            variances_of(surface.pieces, surface.nearest, surface.frame, points, np.zeros(3), 0.08, out)
            into.append(out.max())
    assert np.median(grown) > 2.0
    assert np.median(even) < 1.3


def test_seen_from_elsewhere_ranges_tell_nothing_of_the_references_noise() -> None:
    surface, out = Surface.build(hall(0.02, 0)), np.empty(340)
    for x, grows in ((0.5, True), (2.0, False)):
        points = hall(0.02, 1) - [x, 0.0]
        variances_of(
            surface.pieces, surface.nearest, surface.frame, points, np.array([x, 0.0, 0.0]), 0.08, out
        )
        assert (out.max() > 1.0) == grows


def test_too_few_points_tell_of_no_variances() -> None:
    surface, points = Surface.build(corner()), corner()[:: 126 // ENOUGH]
    out = np.zeros(len(points))
    found = variances_of(surface.pieces, surface.nearest, surface.frame, points, np.zeros(3), 0.08, out)
    assert found == GRAZING
    assert (out == 1.0).all()


def test_points_at_the_laser_itself_do_no_harm() -> None:
    across, noise = np.linspace(-0.5, 0.5, 2 * ENOUGH), np.random.default_rng(0).normal(0.0, 0.02, 2 * ENOUGH)
    wall = np.column_stack((np.full(2 * ENOUGH, 3.0), across))
    surface = Surface.build(np.vstack((wall, [[0.0, 0.02], [0.0, -0.02]])))
    points = np.vstack((wall + noise[:, None] * [1.0, 0.0], np.zeros((2 * ENOUGH, 2))))
    out = np.empty(len(points))
    variances_of(surface.pieces, surface.nearest, surface.frame, points, np.zeros(3), 0.08, out)
    assert np.isfinite(out).all()


@given(st.lists(st.floats(0.0, 0.999), min_size=1, max_size=300))
@settings(deadline=None, max_examples=60)
def test_a_histogram_tells_the_median_to_a_bin(values: list[float]) -> None:
    counts = np.histogram(values, bins=BINS, range=(0.0, 1.0))[0]
    low, high = np.sort(values)[[(len(values) - 1) // 2, len(values) // 2]]
    assert low - 1.01 / BINS <= median_of(counts, len(values)) / BINS <= high + 1.01 / BINS
    assert median_of(np.zeros(BINS, dtype=np.int64), 0) == 0.0


@given(st.floats(-0.06, 0.06), st.floats(-0.06, 0.06), st.floats(-0.05, 0.05), st.booleans())
@settings(deadline=None, max_examples=40)
def test_refinement_returns_to_the_truth(x: float, y: float, theta: float, both_ways: bool) -> None:
    reference = corner()
    truth = np.array([0.3, 0.2, 0.1])
    inverse_points = transform(
        np.array([*(-np.array([[0.995004, 0.099833], [-0.099833, 0.995004]]) @ truth[:2]), -0.1]), reference
    )
    s = Surface.build(reference)
    lines = lines_of(inverse_points, FIT_SPAN, FIT_ROUGHNESS) if both_ways else NO_LINES
    start = truth + [x, y, theta]
    found, _, converged = refine(
        s.pieces, s.nearest, s.frame, inverse_points, lines, start, 30, 15.0, (0.15, 0.08), (0.03, 0.03)
    )
    assert converged
    assert found == pytest.approx(truth, abs=2e-3)


def step_twin(
    surface: Surface, points: Points, pose: Pose, variances: NDArray[np.float64], least: float
) -> float:
    """Length (m) of one more step by NumPy, of scale 3 cm, squared cosines of beams and normals ``least`` at least."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    beams = points @ np.array([[c, s], [-s, c]])
    places = beams + pose[:2]
    lines = surface.pieces[[nearest_segment(surface.nearest, surface.frame, *place) for place in places], 5:8]
    residuals = distances(surface, places)
    cosines = (lines[:, :2] * beams).sum(axis=1) / np.hypot(*beams.T)
    weights = 1.0 / (variances * np.maximum(cosines**2, least) + (residuals / 0.03) ** 2)
    rows = np.column_stack((lines[:, :2], lines[:, 1] * beams[:, 0] - lines[:, 0] * beams[:, 1]))
    step = np.linalg.solve(rows.T @ (weights[:, None] * rows), -rows.T @ (weights * residuals))
    return float(np.hypot(*step[:2]))


def test_refinement_ends_where_the_weighted_distances_balance() -> None:
    surface, points, start = Surface.build(hall(0.015, 1)), hall(0.015, 2), np.array([0.01, 0.0, 0.0])
    found, _, converged = refine(
        surface.pieces,
        surface.nearest,
        surface.frame,
        points,
        NO_LINES,
        start,
        30,
        4.0,
        (0.15, 0.15),
        (0.03, 0.03),
    )
    assert converged
    variances = np.empty(len(points))
    # The reach is at its end from the first iteration on, so the noise is told where the refinement begins.
    least = variances_of(surface.pieces, surface.nearest, surface.frame, points, start, 0.15, variances)
    assert step_twin(surface, points, found, variances, least) < 1e-4
    assert step_twin(surface, points, found, np.ones(len(points)), least) > 5e-4
    assert step_twin(surface, points, found, variances, 1.0) > 5e-4


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9),
    st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3),
)
@settings(deadline=None, max_examples=40)
def test_solve3_solves(entries: list[float], right: list[float]) -> None:
    root = np.array(entries).reshape(3, 3)
    hessian = root @ root.T + 0.1 * np.eye(3)
    out = np.empty(3)
    solve3(hessian, np.array(right), out)
    assert hessian @ out == pytest.approx(np.array(right), abs=1e-9)
