"""Surface kernels against their NumPy twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.joints import joints_of
from hsslam.kernels.surface import (
    FIT_ROUGHNESS,
    FIT_SPAN,
    REACH,
    Surface,
    lines_of,
    nearest_segment,
    squared_distance,
)


def distances(segments: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of every place from every segment, (P, S): the NumPy twin."""
    a, along = segments[None, :, :2], (segments[:, 2:] - segments[:, :2])[None]
    offset = places[:, None, :] - a
    squared = np.maximum((along**2).sum(-1), 1e-300)
    share = np.clip((offset * along).sum(-1) / squared, 0.0, 1.0)
    out: NDArray[np.float64] = np.linalg.norm(offset - share[..., None] * along, axis=-1)
    return out


def wall(length: float = 2.0, spacing: float = 0.05, noise: float = 0.0) -> NDArray[np.float64]:
    x = np.arange(0.0, length, spacing)
    return np.column_stack(
        (x, np.random.default_rng(0).normal(0.0, noise, len(x)) if noise else np.zeros(len(x)))
    )


coordinates = st.floats(-5.0, 5.0, allow_nan=False)
clouds = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=25).map(
    lambda rows: np.array(rows, dtype=np.float64)
)


@given(clouds)
@settings(deadline=None, max_examples=40)
def test_every_point_lies_on_some_segment(points: NDArray[np.float64]) -> None:
    surface = Surface.build(points)
    assert distances(surface.segments, points).min(axis=1).max() < 1e-9


@given(clouds)
@settings(deadline=None, max_examples=40)
def test_a_segment_for_each_joint_and_for_each_lone_return(points: NDArray[np.float64]) -> None:
    surface = Surface.build(points)
    joined = joints_of(points)
    lonely = ~joined & ~np.concatenate(([False], joined[:-1]))
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    expected = np.where(joined, np.append(lengths, 0.0), 0.0)[joined | lonely]
    found = np.linalg.norm(surface.segments[:, 2:] - surface.segments[:, :2], axis=1)
    assert found == pytest.approx(expected)


@given(clouds, st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=10))
@settings(deadline=None, max_examples=40)
def test_nearest_segment_is_the_nearest_within_a_cell(
    points: NDArray[np.float64], places: list[tuple[float, float]]
) -> None:
    surface = Surface.build(points)
    exact = distances(surface.segments, np.array(places))
    diagonal = np.sqrt(2.0) / surface.frame[2]
    for place, row in zip(places, exact, strict=True):
        found = nearest_segment(surface.nearest, surface.frame, *place)
        if found >= 0:
            assert row[found] <= row.min() + diagonal + 1e-9
            assert squared_distance(surface.pieces, found, *place) == pytest.approx(row[found] ** 2, abs=1e-9)
        else:
            assert row.min() > REACH - diagonal


def test_lines_average_noise_along_a_wall() -> None:
    surface = Surface.build(wall(spacing=0.02, noise=0.01))
    segments_tilt = np.abs(
        np.arctan2(
            surface.segments[:, 3] - surface.segments[:, 1], surface.segments[:, 2] - surface.segments[:, 0]
        )
    )
    lines_tilt = np.abs(np.arctan(surface.pieces[:, 5] / surface.pieces[:, 6]))
    assert np.median(lines_tilt) < 0.4 * np.median(segments_tilt)


def test_a_point_has_the_line_of_the_segment_that_begins_there_or_ends_where_none_begins() -> None:
    points = np.vstack((wall(spacing=0.02, noise=0.01), [[10.0, 10.0]], wall(spacing=0.05) + [0.0, 20.0]))
    surface = Surface.build(points)
    lines = lines_of(points, FIT_SPAN, FIT_ROUGHNESS)
    for point, line in zip(points, lines, strict=True):
        begins = np.flatnonzero((surface.segments[:, :2] == point).all(axis=1))
        ends = np.flatnonzero((surface.segments[:, 2:] == point).all(axis=1))
        own = (begins if len(begins) else ends)[0]
        assert line == pytest.approx(surface.pieces[own, 5:8])


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03, 0.05])
def test_all_normals_of_a_wall_are_on_the_same_side_whatever_its_noise(noise: float) -> None:
    there = wall(spacing=0.02, noise=noise)
    for points, side in ((there, 1.0), (there[::-1].copy(), -1.0)):
        lines = lines_of(points, FIT_SPAN, FIT_ROUGHNESS)
        known = np.abs(lines[:, :2]).max(axis=1) > 0.0
        assert known.mean() > 0.9
        assert (side * lines[known, 1] > 0.0).all()


def test_normals_are_unit_and_zero_for_a_lone_return() -> None:
    surface = Surface.build(np.vstack((wall(), [[10.0, 10.0]])))
    lengths = np.linalg.norm(surface.pieces[:, 5:7], axis=1)
    assert lengths[:-1] == pytest.approx(1.0)
    assert lengths[-1] == 0.0


def test_a_far_stray_return_does_not_blow_the_raster_up() -> None:
    surface = Surface.build(np.vstack((wall(), [[1000.0, 1000.0]])))
    assert max(surface.nearest.shape) <= 2002


def test_an_empty_reference_has_no_surface() -> None:
    surface = Surface.build(np.empty((0, 2)))
    assert len(surface.segments) == 0
    assert nearest_segment(surface.nearest, surface.frame, 0.0, 0.0) == -1
