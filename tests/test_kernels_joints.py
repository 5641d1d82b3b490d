"""Which neighbouring returns are of one surface, against a NumPy twin and as a laser sees walls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.joints import (
    ARM,
    ENOUGH,
    NARROWEST,
    NEAR,
    PLENTY,
    SPACINGS,
    STRAIGHT,
    joints_of,
    usual_squared_spacing,
    widths_of,
)
from hsslam.kernels.surface import FIT_ROUGHNESS, FIT_SPAN, lines_of
from hsslam.se2 import Points

coordinates = st.floats(-5.0, 5.0, allow_nan=False)
clouds = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=25).map(
    lambda rows: np.array(rows, dtype=np.float64)
)


def leads_on(before: Points, at: Points, to: Points) -> bool:
    arm, gap = at - before, to - at
    along, across = float(arm @ gap), float(arm[0] * gap[1] - arm[1] * gap[0])
    return arm @ arm >= ARM**2 * (gap @ gap) and along > 0.0 and abs(across) <= STRAIGHT * along


def twin(points: Points) -> NDArray[np.bool_]:
    """By NumPy, return by return."""
    n = len(points)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    usual = np.median(lengths[:: 1 + n // PLENTY] ** 2) ** 0.5 if n >= ENOUGH else 0.0
    joined = np.zeros(n, dtype=np.bool_)
    for i, length in enumerate(lengths):
        led = (i > 0 and leads_on(points[i - 1], points[i], points[i + 1])) or (
            i + 2 < n and leads_on(points[i + 2], points[i + 1], points[i])
        )
        joined[i] = length <= NEAR or (length <= SPACINGS * usual and led)
    return joined


def seen(degrees: float, wall: float = 1.0, length: float = 6.0) -> Points:
    """A wall to the left of a robot that looks along it, by a laser with a beam every so many degrees."""
    angles = np.radians(np.arange(-90.0 + degrees, 90.0 + 1e-9, degrees))
    angles = angles[np.sin(angles) > 0.0]
    x = wall / np.tan(angles)
    return np.column_stack((x, np.full(len(x), wall)))[(x < length) & (x > -1.0)]


@given(clouds)
@settings(deadline=None, max_examples=100)
def test_joints_agree_with_numpy(points: Points) -> None:
    assert joints_of(points).tolist() == twin(points).tolist()


@given(clouds, st.integers(0, 2**25 - 1))
@settings(deadline=None, max_examples=60)
def test_widths_agree_with_numpy(points: Points, bits: int) -> None:
    chosen = np.array([bits >> i & 1 for i in range(len(points))], dtype=np.bool_)
    joined = twin(points)
    things: list[float] = []
    for i in np.flatnonzero(chosen):
        if i > 0 and chosen[i - 1] and joined[i - 1]:
            things[-1] += float(np.linalg.norm(points[i] - points[i - 1]))
        else:
            things.append(NARROWEST)
    together, widest = widths_of(points, chosen)
    assert together == pytest.approx(sum(things), abs=1e-9)
    assert widest == pytest.approx(max(things, default=0.0), abs=1e-9)


@pytest.mark.parametrize("degrees", [0.25, 0.5])
def test_a_wall_is_as_wide_as_it_is_seen_and_a_lone_return_a_little(degrees: float) -> None:
    points = seen(degrees)
    lone = np.concatenate((points, [[0.0, -5.0]]))
    together, widest = widths_of(lone, np.ones(len(lone), dtype=np.bool_))
    assert widest == pytest.approx(np.ptp(points[:, 0]) + NARROWEST)
    assert together == pytest.approx(widest + NARROWEST)


@given(clouds, st.floats(-3.0, 3.0))
@settings(deadline=None, max_examples=40)
def test_the_usual_spacing_does_not_depend_on_where_the_scan_was_taken(points: Points, turn: float) -> None:
    c, s = math.cos(turn), math.sin(turn)
    moved = points @ np.array([[c, s], [-s, c]]) + [3.0, -2.0]
    assert usual_squared_spacing(moved) == pytest.approx(usual_squared_spacing(points), abs=1e-9)


def test_few_returns_are_joined_where_they_are_near_to_one_another() -> None:
    points = np.array([[0.0, 0.0], [0.3, 0.0], [0.8, 0.0]])
    assert joints_of(points).tolist() == [True, False, False]


@pytest.mark.parametrize("degrees", [1.0, 2.0, 3.0, 6.0])
def test_a_wall_seen_aslant_has_lines_however_few_the_beams(degrees: float) -> None:
    points = seen(degrees)
    lines = lines_of(points, FIT_SPAN, FIT_ROUGHNESS)
    assert np.abs(lines[points[:, 0] < 2.5, 1]) == pytest.approx(1.0)


def test_an_edge_before_a_wall_is_not_joined_to_it() -> None:
    behind = np.column_stack((np.arange(0.0, 3.0, 0.2), np.full(15, 3.0)))
    before = np.column_stack((np.arange(3.0, 5.0, 0.2), np.full(10, 2.2)))
    joined = joints_of(np.vstack((behind, before)))
    assert not joined[14]
    assert joined[:14].all()
    assert joined[15:-1].all()
