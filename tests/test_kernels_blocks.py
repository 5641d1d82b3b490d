"""The refinement's normal equations, summed up in blocks of points, against their NumPy twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.blocks import (
    ASIDE,
    LANES,
    LEAST_AGREEMENT,
    TERMS,
    add_terms,
    blocks_of,
    find_segments,
    take_variances,
)
from hsslam.kernels.surface import FIT_ROUGHNESS, FIT_SPAN, Surface, lines_of, nearest_segment
from hsslam.se2 import Points, Pose, transform

DISTANCE, SCALE, LEAST = 0.12, 0.05, 0.3


def room(count: int, seed: int) -> Points:
    """Returns of ``count`` beams all round in a room of 4 m by 3 m with a thin wall in it, 1 cm of noise."""
    angles = np.linspace(-math.pi, math.pi, count, endpoint=False)
    directions = np.column_stack((np.cos(angles), np.sin(angles)))
    ranges = (np.array([2.0, 1.5]) / np.maximum(np.abs(directions), 1e-9)).min(axis=1)
    ranges[np.abs(angles) < 0.3] = 1.0
    noisy: Points = directions * (ranges + np.random.default_rng(seed).normal(0.0, 0.01, count))[:, None]
    return noisy


def two_rooms() -> Surface:
    """The room, and from beyond its thin wall, in the order of a robot's beams there, the other side 6 cm behind."""
    beyond = np.column_stack((np.full(40, 1.06), np.linspace(0.4, -0.4, 40)))
    return Surface.build(np.concatenate((room(180, 0), beyond)))


def sums(
    surface: Surface,
    points: Points,
    lines: NDArray[np.float64],
    variances: NDArray[np.float64],
    pose: Pose,
    noisy: bool = False,
) -> NDArray[np.float64]:
    """By the kernels, all blocks."""
    half, blocks, known = blocks_of(points, lines)
    take_variances(variances, half, blocks)
    out = np.zeros(TERMS * LANES)
    x0, y0, c, s = pose[0], pose[1], math.cos(pose[2]), math.sin(pose[2])
    for block in range(2 * half):
        find_segments(
            surface.pieces, surface.nearest, surface.frame, x0, y0, c, s, noisy, block, blocks, known
        )
        add_terms(x0, y0, c, s, DISTANCE**2, SCALE**2, LEAST, noisy, len(lines) > 0, block, blocks, out)
    total: NDArray[np.float64] = out.reshape(TERMS, LANES).sum(axis=1)
    return total


def added(
    normals: NDArray[np.float64], at: Points, residuals: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Upper triangle of the Hessian and gradient of weighted distances across lines at places seen from the pose."""
    rows = np.column_stack((normals, normals[:, 1] * at[:, 0] - normals[:, 0] * at[:, 1]))
    hessian = rows.T @ (weights[:, None] * rows)
    return np.concatenate((hessian[np.triu_indices(3)], rows.T @ (weights * residuals)))


def nearest_of(surface: Surface, places: Points) -> NDArray[np.int64]:
    return np.array([nearest_segment(surface.nearest, surface.frame, *place) for place in places])


def twin(
    surface: Surface,
    points: Points,
    lines: NDArray[np.float64],
    variances: NDArray[np.float64],
    pose: Pose,
    noisy: bool = False,
) -> NDArray[np.float64]:
    """By NumPy: both distances of each point, their weights and derivatives."""
    least = LEAST_AGREEMENT if noisy else -LEAST_AGREEMENT
    places = transform(pose, points)
    own = np.zeros_like(places)
    if len(lines):
        own = transform(np.array([0.0, 0.0, pose[2]]), lines[:, :2])
    numbers = nearest_of(surface, places)
    other_side = (numbers >= 0) & ((own * surface.pieces[numbers, 5:7]).sum(axis=1) < -LEAST_AGREEMENT)
    aside = nearest_of(surface, places + ASIDE * own)
    same_side = (aside >= 0) & ((own * surface.pieces[aside, 5:7]).sum(axis=1) >= LEAST_AGREEMENT)
    numbers = np.where(noisy & other_side & same_side, aside, numbers)
    pieces = surface.pieces[numbers]
    begins, alongs, normals = pieces[:, 0:2], pieces[:, 2:4], pieces[:, 5:7]
    reached = np.clip(((places - begins) * alongs).sum(axis=1), 0.0, pieces[:, 4])
    feet = begins + reached[:, None] * alongs
    counts = (numbers >= 0) & (np.hypot(*(places - feet).T) <= DISTANCE)
    agreement = (own * normals).sum(axis=1)
    counts &= (agreement >= least) | ~own.any(axis=1)
    beams = places - pose[:2]

    residuals = (normals * places).sum(axis=1) - pieces[:, 7]
    squared = (normals * beams).sum(axis=1) ** 2 / (beams**2).sum(axis=1)
    spread = variances * np.maximum(squared, LEAST)
    total = added(normals, beams, residuals, counts / (spread + (residuals / SCALE) ** 2))
    if len(lines):
        back = counts & (agreement >= LEAST_AGREEMENT)
        seen = feet - pose[:2]
        residuals = lines[:, 2] - (own * seen).sum(axis=1)
        total += added(own, seen, residuals, back / (variances + (residuals / SCALE) ** 2))
    return np.append(total, counts.sum())


@given(
    st.integers(1, 200),
    st.floats(-0.1, 0.1),
    st.floats(-0.1, 0.1),
    st.floats(-3.1, 3.1),
    st.booleans(),
    st.booleans(),
)
@settings(deadline=None, max_examples=60)
def test_blocks_sum_up_what_numpy_sums_up(
    count: int, x: float, y: float, theta: float, both: bool, noisy: bool
) -> None:
    surface, points, pose = two_rooms(), room(count, 1), np.array([x, y, theta])
    points = points - [0.3, 0.0]
    lines = lines_of(points, FIT_SPAN, FIT_ROUGHNESS) if both else np.empty((0, 3))
    variances = np.random.default_rng(count).uniform(1.0, 3.0, count)
    expected = twin(surface, points, lines, variances, pose, noisy)
    assert sums(surface, points, lines, variances, pose, noisy) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_returns_beyond_the_middle_of_a_thin_wall_are_of_the_side_that_they_were_seen_from() -> None:
    """Without them that side lies nearer than it is."""
    surface = two_rooms()
    for depth, counts in ((0.0, True), (0.04, True), (0.06, True), (0.13, False)):
        points = np.column_stack((np.full(41, 1.0 + depth), np.linspace(-0.2, 0.2, 41)))
        lines = lines_of(points, FIT_SPAN, FIT_ROUGHNESS)
        found = sums(surface, points, lines, np.ones(41), np.zeros(3), noisy=True)
        assert (found[-1] == 41) == counts
        # Half the sum of squares falls towards the side at 1 m.
        assert (found[6] > 1.0) == (counts and depth > 0.0)


def test_lanes_without_a_point_count_nowhere() -> None:
    # A reference that was seen at the robot itself: where a point of zeros would lie.
    surface = Surface.build(np.column_stack((np.linspace(-0.2, 0.2, 30), np.zeros(30))))
    points = np.full((3, 2), 0.01)
    assert sums(surface, points, np.empty((0, 3)), np.ones(3), np.zeros(3))[-1] == 3


def test_the_first_half_of_the_blocks_stands_for_the_whole_scan() -> None:
    points = np.column_stack((np.arange(150.0), np.zeros(150)))
    half, blocks, _ = blocks_of(points, np.empty((0, 3)))
    xs = blocks.reshape(2 * half, -1, LANES)[:, 0]
    assert half == 3
    assert xs[:half].ravel()[:75].tolist() == list(range(0, 150, 2))
    assert xs[half:].ravel()[:75].tolist() == list(range(1, 150, 2))
