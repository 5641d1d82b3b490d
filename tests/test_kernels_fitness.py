"""Rasters, hits and assessment against their NumPy twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.assess import assess, degenerate_direction, explained
from hsslam.kernels.fitness import count_hits, count_sided, interpolate_points, scratch
from hsslam.kernels.raster import Raster, stamp_squares
from hsslam.kernels.surface import Surface, scan_lines
from hsslam.search import HitFitness

coordinates = st.floats(-4.0, 4.0, allow_nan=False)
clouds = st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=200).map(
    lambda rows: np.array(rows, dtype=np.float64)
)
walks = clouds.map(lambda steps: np.cumsum(0.04 * steps, axis=0))
poses = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0), st.floats(-4.0, 4.0)).map(np.array)


def hits_twin(raster: Raster, points: NDArray[np.float64], pose: NDArray[np.float64]) -> int:
    """Hits by NumPy, in the kernel's single precision."""
    scaled = (points * raster.frame[2]).astype(np.float32)
    c, s = np.float32(np.cos(pose[2])), np.float32(np.sin(pose[2]))
    offset = ((pose[:2] - raster.frame[:2]) * raster.frame[2]).astype(np.float32)
    u = c * scaled[:, 0] - s * scaled[:, 1] + offset[0]
    v = s * scaled[:, 0] + c * scaled[:, 1] + offset[1]
    rows, columns = raster.cells.shape
    u, v = np.clip(u, 0, columns - 1).astype(int), np.clip(v, 0, rows - 1).astype(int)
    return int(raster.cells[v, u].astype(int).sum())


def build(smooth: bool, reference: NDArray[np.float64]) -> Raster:
    if smooth:
        return Raster.smooth(Surface.build(reference).segments, 0.05, 0.025)
    return Raster.of_points(reference, 0.05, 0.025)


def hits(raster: Raster, points: NDArray[np.float64], pose: NDArray[np.float64], at_least: int = 0) -> int:
    fitness = HitFitness.of(raster, points)
    return count_hits(
        fitness.cells, fitness.frame, fitness.xs, fitness.ys, pose[0], pose[1], pose[2], at_least
    )


@pytest.mark.parametrize("smooth", [False, True])
@given(clouds, clouds, poses)
@settings(deadline=None, max_examples=30)
def test_hits_agree_with_numpy(
    smooth: bool, reference: NDArray[np.float64], points: NDArray[np.float64], pose: NDArray[np.float64]
) -> None:
    raster = build(smooth, reference)
    # Fused multiply-add may round a point on a cell's edge to the other side.
    assert abs(hits(raster, points, pose) - hits_twin(raster, points, pose)) <= raster.frame[3]


@pytest.mark.parametrize("smooth", [False, True])
@given(clouds, clouds, poses, st.integers(0, 200))
@settings(deadline=None, max_examples=30)
def test_early_rejection_never_changes_a_count_that_matters(
    smooth: bool,
    reference: NDArray[np.float64],
    points: NDArray[np.float64],
    pose: NDArray[np.float64],
    at_least: int,
) -> None:
    raster = build(smooth, reference)
    at_least *= int(raster.frame[3])
    whole, rejected = hits(raster, points, pose), hits(raster, points, pose, at_least)
    assert rejected == whole if whole >= at_least else rejected in (whole, -1)


@given(clouds)
@settings(deadline=None, max_examples=30)
def test_a_point_hits_its_own_square_and_the_border_is_zero(points: NDArray[np.float64]) -> None:
    raster = Raster.of_points(points, 0.05, 0.025)
    assert hits(raster, points, np.zeros(3)) == len(points)
    assert not raster.cells[[0, -1]].any()
    assert not raster.cells[:, [0, -1]].any()


def test_squares_have_the_size_asked_for() -> None:
    raster = Raster.of_points(np.zeros((1, 2)), 0.1, 0.01)
    assert int(raster.cells.sum()) in (20 * 20, 20 * 21, 21 * 21)


def test_surface_counts_between_the_points_and_paper_does_not() -> None:
    reference = np.column_stack((np.arange(0.0, 1.5, 0.3), np.zeros(5)))
    between = reference[:-1] + [0.15, 0.0]
    assert hits(Raster.of_points(reference, 0.05, 0.025), between, np.zeros(3)) == 0
    assert hits(Raster.build(Surface.build(reference).segments, 0.05, 0.025), between, np.zeros(3)) == 4


@given(clouds)
@settings(deadline=None, max_examples=20)
def test_smooth_field_is_a_gaussian_of_the_distance(points: NDArray[np.float64]) -> None:
    segments = np.hstack((points, points))
    raster = Raster.smooth(segments, 0.05, 0.025)
    rows, columns = np.nonzero(raster.cells)
    places = raster.frame[:2] + (np.column_stack((columns, rows)) + 0.5) / raster.frame[2]
    distance = np.linalg.norm(places[:, None] - points[None], axis=-1).min(axis=1)
    expected = 255.0 * np.exp(-0.5 * (distance / 0.05) ** 2)
    assert np.abs(raster.cells[rows, columns] - expected).max() <= 0.51
    assert distance.max() <= 2.5 * 0.05 + 1e-9


def corner(spacing: float = 0.03) -> NDArray[np.float64]:
    along = np.arange(0.1, 2.0, spacing)
    return np.vstack((np.column_stack((along[::-1], 0 * along)), np.column_stack((0 * along, along))))


WINDOW = np.array([0.2, 0.2, 0.2])


def test_score_is_the_share_of_points_near_the_surface() -> None:
    points = corner()
    surface = Surface.build(points)
    far = points[:30] + [5.0, 5.0]
    score, _, _ = assess(surface, np.vstack((points, far)), np.zeros(3), WINDOW, 0.1)
    assert score == pytest.approx(len(points) / (len(points) + 30))


def test_covariance_is_larger_along_a_plain_wall() -> None:
    wall = np.column_stack((np.arange(-2.0, 2.0, 0.05), np.full(80, 1.5)))
    _, covariance, _ = assess(Surface.build(wall), wall, np.zeros(3), WINDOW, 0.1)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.2 / np.sqrt(3.0), rel=0.05)
    assert np.sqrt(covariance[1, 1]) < 0.01
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_covariance_inverts_the_information() -> None:
    points = corner()
    _, covariance, _ = assess(Surface.build(points), points, np.zeros(3), WINDOW, 0.1)
    assert covariance == pytest.approx(covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


def test_a_plain_wall_leaves_its_own_direction_open_and_a_corner_none() -> None:
    angle = 0.4
    along = np.arange(-2.0, 2.0, 0.05)
    wall = np.column_stack((along * np.cos(angle), along * np.sin(angle))) + [-0.5, 1.5]
    _, covariance, _ = assess(Surface.build(wall), wall, np.zeros(3), WINDOW, 0.1)
    assert degenerate_direction(covariance, WINDOW) == pytest.approx(angle, abs=0.02)
    points = corner()
    _, covariance, _ = assess(Surface.build(points), points, np.zeros(3), WINDOW, 0.1)
    assert np.isnan(degenerate_direction(covariance, WINDOW))


def largest_offset(
    centres: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Larger of the offsets along x and y of each centre from the place of a segment where it is smallest."""
    (x, y), (dx, dy) = (centres - a).T, b - a
    # Both offsets are straight in the share of the segment: look where either is zero, and where they are the same.
    pairs = [(x, dx), (y, dy), (x - y, dx - dy), (x + y, dx + dy)]
    shares = [np.clip(offset / step, 0.0, 1.0) for offset, step in pairs if abs(step) > 1e-12]
    return np.asarray(
        np.min(
            [np.maximum(abs(x - t * dx), abs(y - t * dy)) for t in [0.0 * x, 0.0 * x + 1.0, *shares]], axis=0
        )
    )


@given(clouds, st.floats(0.02, 0.2))
@settings(deadline=None, max_examples=30)
def test_squares_along_segments_are_those_around_their_places(
    points: NDArray[np.float64], half_side: float
) -> None:
    segments = Surface.build(points).segments
    raster = Raster.build(segments, half_side, 0.025)
    rows, columns = np.indices(raster.cells.shape).reshape(2, -1)
    centres = raster.frame[:2] + (np.column_stack((columns, rows)) + 0.5) / raster.frame[2]
    gap = np.full(len(centres), np.inf)
    for a, b in zip(segments[:, :2], segments[:, 2:], strict=True):
        gap = np.minimum(gap, largest_offset(centres, a, b))
    clear = np.abs(gap - half_side) > 0.002
    assert (raster.cells.ravel()[clear] == (gap < half_side)[clear]).all()


def test_noise_does_not_close_a_plain_wall() -> None:
    """Lines fitted to noisy returns are tilted, and so seem to fix the direction along the wall."""
    rng = np.random.default_rng(0)
    along = np.arange(-2.0, 2.0, 0.01)
    wall = np.column_stack((along, 1.5 + rng.normal(0.0, 0.015, len(along))))
    scan = np.column_stack((along, 1.5 + rng.normal(0.0, 0.015, len(along))))
    _, covariance, direction = assess(Surface.build(wall), scan, np.zeros(3), WINDOW, 0.1)
    assert np.sqrt(covariance[0, 0]) > 0.05
    assert abs(direction) < 0.05


def test_covariance_holds_the_way_to_the_bottom() -> None:
    points = corner()
    surface = Surface.build(points)
    off = np.array([0.03, -0.02, 0.0])
    _, at_truth, _ = assess(surface, points, np.zeros(3), WINDOW, 0.1)
    _, beside, _ = assess(surface, points, off, WINDOW, 0.1)
    assert off @ np.linalg.solve(at_truth, off) > 20.0
    assert off @ np.linalg.solve(beside, off) < 3.0


@given(clouds, poses)
@settings(deadline=None, max_examples=30)
def test_interpolated_worth_agrees_with_numpy(points: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
    raster = build(True, points)
    near = pose * [0.005, 0.005, 0.003]
    fitness = HitFitness.of(raster, points)
    found = interpolate_points(
        raster.cells.ravel(),
        raster.cells.shape,
        raster.frame,
        *fitness.scaled[:2],
        fitness.count,
        *near,
        0,
        scratch(),
    )
    c, s = np.cos(near[2]), np.sin(near[2])
    placed = points @ np.array([[c, s], [-s, c]]) + near[:2]
    u, v = ((placed - raster.frame[:2]) * raster.frame[2] - 0.5).T
    columns, rows = np.floor(u).astype(int), np.floor(v).astype(int)
    p, q, cells = u - columns, v - rows, raster.cells.astype(float)
    low = cells[rows, columns] * (1 - p) + cells[rows, columns + 1] * p
    high = cells[rows + 1, columns] * (1 - p) + cells[rows + 1, columns + 1] * p
    assert found == pytest.approx((low * (1 - q) + high * q).sum(), rel=0.03, abs=3.0)


def sided_twin(
    surface: Surface, raster: Raster, points: NDArray[np.float64], pose: NDArray[np.float64]
) -> int:
    """Hits by NumPy, one plain raster for each direction that a point may face."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    placed = points @ np.array([[c, s], [-s, c]]) + pose[:2]
    u, v = ((placed - raster.frame[:2]) * raster.frame[2]).T
    height, width = raster.cells.shape
    u, v = np.clip(u, 0, width - 1).astype(int), np.clip(v, 0, height - 1).astype(int)
    normals, lines = surface.pieces[:, 5:7], scan_lines(points)
    eighths = np.round(np.arctan2(normals[:, 1], normals[:, 0]) / (np.pi / 4))
    own = np.floor((np.arctan2(lines[:, 1], lines[:, 0]) + pose[2]) / (np.pi / 4) + 0.5) % 8
    hits = 0
    for facing in range(8):
        apart = np.abs((eighths - facing + 4) % 8 - 4)
        these = (apart <= 2) | ~normals.any(axis=1)
        segments, cells = surface.segments[these], np.zeros_like(raster.cells)
        stamp_squares(segments, np.ones(len(segments), np.uint8), raster.frame, cells, raster.half_side)
        looking = lines[:, :2].any(axis=1) & (own == facing)
        hits += int(cells[v[looking], u[looking]].sum())
    lone = ~lines[:, :2].any(axis=1)
    return hits + int((raster.cells[v[lone], u[lone]] > 0).sum())


@given(walks, walks, poses)
@settings(deadline=None, max_examples=30)
def test_sided_hits_agree_with_numpy(
    reference: NDArray[np.float64], points: NDArray[np.float64], pose: NDArray[np.float64]
) -> None:
    pose = pose * [0.1, 0.1, 1.0]
    surface = Surface.build(reference)
    raster = Raster.of_sides(surface, 0.2, 0.05)
    fitness = HitFitness.of(raster, points)
    cells, xyf = raster.cells, fitness.scaled
    found = count_sided(
        cells.ravel(), cells.shape, raster.frame, *xyf, fitness.count, *pose.tolist(), 0, scratch()
    )
    assert abs(found - sided_twin(surface, raster, points, pose)) <= 1


@pytest.mark.parametrize("turn", [0.0, 0.3, 2.0, -3.0])
def test_the_other_side_of_a_wall_is_no_hit(turn: float) -> None:
    wall = np.column_stack((np.linspace(-2.0, 2.0, 101), np.full(101, 1.0)))
    raster = Raster.of_sides(Surface.build(wall), 0.05, 0.025)
    c, s = np.cos(turn), np.sin(turn)
    turned = wall @ np.array([[c, -s], [s, c]])

    def worth(points: NDArray[np.float64]) -> int:
        fitness = HitFitness.of(raster, points)
        flat, scaled = raster.cells.ravel(), fitness.scaled
        return count_sided(
            flat, raster.cells.shape, raster.frame, *scaled, fitness.count, 0.0, 0.0, turn, 0, scratch()
        )

    assert worth(turned) == 101
    assert worth(turned[::-1].copy()) == 0
    surface, pose = Surface.build(wall), np.array([0.0, 0.0, turn])
    assert assess(surface, turned, pose, WINDOW, 0.1)[0] == 1.0
    assert assess(surface, turned[::-1].copy(), pose, WINDOW, 0.1)[0] == 0.0


def test_interpolation_tells_poses_apart_within_a_cell() -> None:
    points = corner()
    raster = Raster.smooth(Surface.build(points).segments, 0.05, 0.025)
    fitness = HitFitness.of(raster, points)
    worth = [
        interpolate_points(
            raster.cells.ravel(),
            raster.cells.shape,
            raster.frame,
            *fitness.scaled[:2],
            fitness.count,
            x,
            x,
            0.0,
            0,
            scratch(),
        )
        for x in (0.0, 0.003, 0.006, 0.009, 0.012)
    ]
    assert (np.diff(worth) < 0).all()


def test_clutter_does_not_open_a_direction_that_returns_fix() -> None:
    """What one scan sees and the other does not says nothing of how noisy the lines are."""
    rng = np.random.default_rng(1)

    def scan() -> NDArray[np.float64]:
        wall = np.column_stack((np.arange(-2.0, 2.0, 0.02), np.full(200, 1.5)))
        end = np.column_stack((np.full(12, 2.0), 1.5 - 0.02 * np.arange(1, 13)))
        return np.vstack((wall, end)) + rng.normal(0.0, 0.005, (212, 2))

    reference, seen = scan(), scan()
    seen[0:200:4, 1] -= 0.08
    score, covariance, direction = assess(Surface.build(reference), seen, np.zeros(3), WINDOW, 0.1)
    assert score > 0.9
    assert np.isnan(direction)
    assert np.sqrt(covariance[0, 0]) < 0.03


@given(walks, clouds, poses)
@settings(deadline=None, max_examples=40)
def test_the_points_that_are_explained_are_those_that_the_score_counts(
    reference: NDArray[np.float64], points: NDArray[np.float64], pose: NDArray[np.float64]
) -> None:
    surface, lines = Surface.build(reference), scan_lines(points)
    told = explained(surface.pieces, surface.nearest, surface.frame, points, lines, pose, 0.1)
    score, _, _ = assess(surface, points, pose, np.array([0.2, 0.2, 0.1]), 0.1, lines)
    assert told.sum() == pytest.approx(score * len(points))
