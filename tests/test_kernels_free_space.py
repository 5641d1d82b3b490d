"""What beams went through, against a NumPy twin and against scenes whose free space is known."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.free_space import (
    AROUND,
    CELL,
    FARTHEST,
    FREE,
    GAP,
    HIT,
    HIT_AGAIN,
    LEAST_POINTS,
    LEAST_SHARE,
    MARGIN,
    STRIDE,
    WIDEST_GAP,
    by_things,
    in_free_space,
    mark,
    unseen,
)
from hsslam.se2 import compose, pose, transform

HERE = np.zeros(3)
FRAME = np.array([-20.0137, -20.0371, 1.0 / CELL])
"""Off the round numbers that examples are made of: a beam along the border of two rows may mark either."""

coordinates = st.floats(-8.0, 8.0, allow_nan=False)
clouds = st.lists(st.tuples(coordinates, coordinates), max_size=40).map(
    lambda rows: np.array(rows, dtype=np.float64).reshape(-1, 2)
)
places = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-math.pi, math.pi)).map(
    lambda p: pose(*p)
)


def empty() -> NDArray[np.uint8]:
    return np.zeros((400, 400), dtype=np.uint8)


def cells_of(places: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    columns, rows = np.floor((places - FRAME[:2]) * FRAME[2]).astype(np.int64).T
    return rows, columns


def mark_twin(
    cells: NDArray[np.uint8],
    points: NDArray[np.float64],
    laser: NDArray[np.float64],
    place: NDArray[np.float64],
) -> None:
    offset = points - laser[:2]
    ranges, bearings = np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0])
    origin = transform(place, laser[None, :2])[0]
    for i in range(len(points)):
        near = [k for k in (i - 1, i, i + 1) if 0 <= k < len(points)]
        near = [k for k in near if abs(bearings[k] - bearings[i]) <= WIDEST_GAP]
        reach = min(min(ranges[k] for k in near) - MARGIN, FARTHEST)
        along = np.arange(0.0, max(reach, 0.0) / CELL, STRIDE) * CELL
        heading = bearings[i] + place[2]
        beam = origin + along[:, None] * np.array([math.cos(heading), math.sin(heading)])
        cells[cells_of(beam)] |= FREE
    hit = np.zeros(cells.shape, dtype=bool)
    hit[cells_of(transform(place, points))] = True
    cells[hit & ((cells & HIT) > 0)] |= HIT_AGAIN
    cells[hit] |= HIT


def alone_twin(
    cells: NDArray[np.uint8], points: NDArray[np.float64], place: NDArray[np.float64]
) -> NDArray[np.bool_]:
    alone = []
    for x, y in transform(place, points):
        around = np.array([[x, y], [x + AROUND, y], [x - AROUND, y], [x, y + AROUND], [x, y - AROUND]])
        rows, columns = cells_of(around)
        near = cells[rows[0] - 1 : rows[0] + 2, columns[0] - 1 : columns[0] + 2]
        alone.append(bool((cells[rows, columns] & FREE).all()) and not (near & HIT_AGAIN).any())
    out = np.array(alone, dtype=bool)
    apart = np.hypot(*np.diff(points, axis=0).T) > GAP
    for thing in np.split(np.arange(len(points)), np.flatnonzero(apart) + 1):
        out[thing] = len(thing) >= LEAST_POINTS and out[thing].sum() > LEAST_SHARE * len(thing)
    return out


@given(st.lists(st.tuples(clouds, places), min_size=1, max_size=3), places)
@settings(deadline=None, max_examples=60)
def test_marks_are_those_of_the_twin(
    scans: list[tuple[NDArray[np.float64], NDArray[np.float64]]], laser: NDArray[np.float64]
) -> None:
    cells, expected = empty(), empty()
    for points, place in scans:
        mark(cells, FRAME, points, laser, place)
        mark_twin(expected, points, laser, place)
    # A place on the border of two cells may fall on either side.
    assert np.count_nonzero(cells != expected) <= 2


def unseen_twin(
    cells: NDArray[np.uint8], points: NDArray[np.float64], place: NDArray[np.float64]
) -> NDArray[np.bool_]:
    known = np.pad(cells, 100) > 0
    rows, columns = cells_of(transform(place, points))
    around = [known[100 + rows + r, 100 + columns + c] for r in (-1, 0, 1) for c in (-1, 0, 1)]
    return ~np.any(around, axis=0)


@given(clouds, places, clouds, places)
@settings(deadline=None, max_examples=60)
def test_what_was_never_seen_is_that_of_the_twin(
    seen: NDArray[np.float64],
    place: NDArray[np.float64],
    points: NDArray[np.float64],
    elsewhere: NDArray[np.float64],
) -> None:
    cells = empty()
    mark(cells, FRAME, seen, HERE, place)
    # Some of the points are near the raster's border, and beyond.
    points = 2.5 * points
    np.testing.assert_array_equal(
        unseen(cells, FRAME, points, elsewhere), unseen_twin(cells, points, elsewhere)
    )


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=60)
def test_things_in_free_space_are_those_of_the_twin(seed: int) -> None:
    """Rooms of random corners, seen from random places, and another room in them."""
    rng = np.random.default_rng(seed)
    cells = empty()
    for _ in range(3):
        mark(cells, FRAME, fan(rng.uniform(2.0, 6.0, 8)), HERE, pose(*rng.uniform(-0.5, 0.5, 3)))
    points, place = fan(rng.uniform(0.5, 5.0, 30)), pose(*rng.uniform(-0.5, 0.5, 3))
    np.testing.assert_array_equal(
        in_free_space(cells, FRAME, points, place), alone_twin(cells, points, place)
    )


def fan(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns of a laser at the origin whose ranges go from corner to corner, over half a turn."""
    bearings = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 181)
    ranges = np.interp(np.linspace(0.0, 1.0, 181), np.linspace(0.0, 1.0, len(corners)), corners)
    return np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))


WALL = fan(np.array([5.0, 5.0]))


def with_person(distance: float = 2.0) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """A wall 5 m away all around and somebody before it, and which returns are of the person."""
    points = WALL.copy()
    person = np.zeros(len(points), dtype=bool)
    person[84:97] = True
    points[person] *= distance / 5.0
    return points, person


def test_who_steps_into_what_was_free_is_found_and_the_wall_is_not() -> None:
    cells = empty()
    mark(cells, FRAME, WALL, HERE, HERE)
    points, person = with_person()
    np.testing.assert_array_equal(in_free_space(cells, FRAME, points, HERE), person)
    assert not in_free_space(cells, FRAME, WALL, HERE).any()


def test_free_space_turns_with_the_robot_and_its_laser() -> None:
    cells, laser, place = empty(), pose(0.3, -0.2, 0.4), pose(1.0, -2.0, 0.8)
    mark(cells, FRAME, transform(laser, WALL), laser, place)
    points, person = with_person()
    np.testing.assert_array_equal(in_free_space(cells, FRAME, transform(laser, points), place), person)
    seen_by_itself = compose(place, laser)
    np.testing.assert_array_equal(in_free_space(cells, FRAME, points, seen_by_itself), person)


def test_what_was_seen_twice_stays() -> None:
    """Somebody who stood there is furniture, as glass is that beams pass from other places only."""
    cells = empty()
    points, person = with_person()
    mark(cells, FRAME, WALL, HERE, HERE)
    mark(cells, FRAME, points, HERE, HERE)
    np.testing.assert_array_equal(in_free_space(cells, FRAME, points, HERE), person)
    mark(cells, FRAME, points, HERE, HERE)
    assert not in_free_space(cells, FRAME, points, HERE).any()


def test_where_nobody_looked_nothing_is_free() -> None:
    cells = empty()
    mark(cells, FRAME, with_person(1.0)[0], HERE, HERE)
    behind, person = with_person(2.0)
    assert not in_free_space(cells, FRAME, behind, HERE)[person].any()


def test_a_wall_of_which_a_few_returns_are_in_free_space_stays_whole() -> None:
    chosen = np.zeros(181, dtype=bool)
    chosen[:40] = True
    by_things(WALL, chosen)
    assert not chosen.any()
    chosen[:50] = True
    by_things(WALL, chosen)
    assert chosen.all()


def test_without_returns_nothing_is_seen() -> None:
    cells, nothing = empty(), np.empty((0, 2))
    mark(cells, FRAME, nothing, HERE, HERE)
    assert not cells.any()
    assert len(in_free_space(cells, FRAME, nothing, HERE)) == 0
