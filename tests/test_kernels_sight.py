"""What a scan saw, against a NumPy twin and against walls whose places are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.sight import DIRECTIONS, MARGIN, WIDEST_GAP, agreement, sight_of
from hsslam.kernels.surface import Surface, nearest_segment, squared_distance
from hsslam.se2 import compose, pose, transform

DISTANCE = 0.1
HERE = np.zeros(3)

coordinates = st.floats(-5.0, 5.0, allow_nan=False)
clouds = st.lists(st.tuples(coordinates, coordinates), max_size=25).map(
    lambda rows: np.array(rows, dtype=np.float64).reshape(-1, 2)
)
places = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-math.pi, math.pi)).map(
    lambda p: pose(*p)
)


def sight_twin(points: NDArray[np.float64], laser: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least range of the beams around every direction, direction by direction."""
    offset = points - laser[:2]
    ranges, bearings = np.hypot(*offset.T), np.arctan2(offset[:, 1], offset[:, 0])
    reach = np.full(DIRECTIONS, np.inf)
    for i in range(1, len(points)):
        turn = math.remainder(bearings[i] - bearings[i - 1], 2.0 * math.pi)
        if abs(turn) > WIDEST_GAP:
            continue
        ends = sorted((bearings[i - 1], bearings[i - 1] + turn))
        first, last = np.floor((np.array(ends) + math.pi) * DIRECTIONS / (2.0 * math.pi)).astype(int)
        around = np.arange(first - 1, last + 2) % DIRECTIONS
        reach[around] = np.minimum(reach[around], min(ranges[i - 1], ranges[i]))
    return np.where(np.isinf(reach), 0.0, reach)


def sees(reach: NDArray[np.float64], offset: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which places (..., 2), seen from the laser along the robot's axes, a scan saw past."""
    direction = (np.arctan2(offset[..., 1], offset[..., 0]) + math.pi) * DIRECTIONS / (2.0 * math.pi)
    limit = reach[direction.astype(int) % DIRECTIONS] - MARGIN
    seen: NDArray[np.bool_] = np.hypot(offset[..., 0], offset[..., 1]) < limit
    return seen


def agreement_twin(
    known: list[NDArray[np.float64]],
    poses: list[NDArray[np.float64]],
    points: NDArray[np.float64],
    laser: NDArray[np.float64],
    at: NDArray[np.float64],
    on: NDArray[np.bool_],
) -> float:
    """The share, given which returns lie ``on`` the surface."""
    world = transform(at, points)
    against = np.zeros(len(points), dtype=bool)
    for scan, place in zip(known, poses, strict=True):
        against |= sees(sight_twin(scan, laser), transform(inverse(place), world) - laser[:2])
    walls = np.concatenate([transform(place, scan) for scan, place in zip(known, poses, strict=True)])
    offset = transform(inverse(at), walls) - laser[:2]
    through = offset[sees(sight_twin(points, laser), offset)]
    directions = {int(k) % DIRECTIONS for k in bin_of(through)}
    against |= np.array([int(k) % DIRECTIONS in directions for k in bin_of(points - laser[:2])], dtype=bool)
    hits, misses = int(on.sum()), int((against & ~on).sum())
    return hits / max(hits + misses, 1)


def inverse(place: NDArray[np.float64]) -> NDArray[np.float64]:
    c, s = math.cos(place[2]), math.sin(place[2])
    return pose(-c * place[0] - s * place[1], s * place[0] - c * place[1], -place[2])


def bin_of(offset: NDArray[np.float64]) -> NDArray[np.int64]:
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    return ((bearing + math.pi) * DIRECTIONS / (2.0 * math.pi)).astype(np.int64)


def agreement_of(
    known: list[NDArray[np.float64]],
    poses: list[NDArray[np.float64]],
    points: NDArray[np.float64],
    laser: NDArray[np.float64],
    at: NDArray[np.float64],
) -> tuple[float, NDArray[np.bool_]]:
    """The kernel's share, and which returns lie on the surface."""
    walls = np.concatenate([transform(place, scan) for scan, place in zip(known, poses, strict=True)])
    surface = Surface.build(walls)
    lasers = np.array([[*compose(place, laser)[:2], place[2]] for place in poses])
    reaches = np.array([sight_of(scan, laser) for scan in known])
    share = agreement(
        surface.pieces,
        surface.nearest,
        surface.frame,
        reaches,
        lasers,
        walls,
        points,
        laser,
        at,
        DISTANCE,
    )
    on = []
    for x, y in transform(at, points):
        k = nearest_segment(surface.nearest, surface.frame, x, y)
        on.append(k >= 0 and squared_distance(surface.pieces, k, x, y) <= DISTANCE**2)
    return share, np.array(on, dtype=bool)


@given(clouds, places)
@settings(deadline=None, max_examples=60)
def test_sight_is_that_of_its_twin(points: NDArray[np.float64], laser: NDArray[np.float64]) -> None:
    np.testing.assert_allclose(sight_of(points, laser), sight_twin(points, laser), atol=1e-12)


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=60)
def test_agreement_is_that_of_its_twin(seed: int) -> None:
    """Rooms of random corners, seen from random places."""
    rng = np.random.default_rng(seed)
    laser = pose(*rng.uniform(-0.3, 0.3, 2), rng.uniform(-3.0, 3.0))
    known = [fan(rng.uniform(0.5, 5.0, 8)) + laser[:2] for _ in range(3)]
    poses = [pose(*rng.uniform(-1.0, 1.0, 3)) for _ in known]
    points, at = fan(rng.uniform(0.5, 5.0, 8)) + laser[:2], pose(*rng.uniform(-1.0, 1.0, 3))
    share, on = agreement_of(known, poses, points, laser, at)
    assert share == pytest.approx(agreement_twin(known, poses, points, laser, at, on), abs=1e-12)


def fan(corners: NDArray[np.float64], middle: float = 0.0, half: float = 1.57) -> NDArray[np.float64]:
    """Returns of a laser at the origin whose ranges go from corner to corner."""
    bearings = np.linspace(middle - half, middle + half, 121)
    ranges = np.interp(np.linspace(0.0, 1.0, 121), np.linspace(0.0, 1.0, len(corners)), corners)
    return np.column_stack((ranges * np.cos(bearings), ranges * np.sin(bearings)))


def test_a_scan_sees_up_to_its_returns_and_nothing_elsewhere() -> None:
    reach = sight_of(fan(np.array([2.0, 2.0])), HERE)
    ahead = np.abs(np.arange(DIRECTIONS) + 0.5 - DIRECTIONS / 2) < DIRECTIONS / 4
    np.testing.assert_allclose(reach[ahead], 2.0)
    assert not reach[: DIRECTIONS // 4 - 1].any()
    assert not reach[3 * DIRECTIONS // 4 + 2 :].any()


def test_between_beams_far_apart_nothing_was_seen() -> None:
    beams = np.array([[2.0, -0.5], [2.0, 0.5]])
    assert not sight_of(beams, HERE).any()


def test_returns_where_nobody_looked_tell_nothing() -> None:
    """A wall ahead is known; now the laser sees that and a wall behind."""
    known = fan(np.array([2.0, 2.0]))
    behind = fan(np.array([1.0, 1.0]), math.pi, 1.3)
    share, on = agreement_of([known], [HERE], np.concatenate((known, behind)), HERE, HERE)
    assert share == 1.0
    assert on.mean() == pytest.approx(0.5, abs=0.02)


def test_returns_where_a_scan_looked_through_tell_against_a_pose() -> None:
    known, nearer = fan(np.array([2.0, 2.0])), fan(np.array([1.0, 1.0]))
    assert agreement_of([known], [HERE], nearer, HERE, HERE)[0] == 0.0


def test_beams_through_a_known_wall_tell_against_a_pose() -> None:
    known, further = fan(np.array([2.0, 2.0])), fan(np.array([3.0, 3.0]))
    assert agreement_of([known], [HERE], further, HERE, HERE)[0] == 0.0


def test_a_scan_without_returns_neither_sees_nor_agrees() -> None:
    nothing = np.zeros((0, 2))
    assert not sight_of(nothing, HERE).any()
    assert agreement_of([fan(np.array([2.0, 2.0]))], [HERE], nothing, HERE, HERE)[0] == 0.0
