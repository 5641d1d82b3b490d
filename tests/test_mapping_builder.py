"""The grid that follows its poses is the same to the bit as one built anew."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import room_scan_at
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.errors import DataError
from hsslam.mapping import cells
from hsslam.mapping.occupancy import GridBuilder, OccupancyGrid, build_grid
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.slam.events import KeyframeAdded
from hsslam.slam.pipeline import Slam

LASERS = (
    ScanGeometry(-math.pi / 2, math.pi / 20, range_min=0.1, range_max=8.0),
    ScanGeometry(-2.0, 0.1, range_min=0.0, range_max=30.0),
)


def random_scan(rng: np.random.Generator) -> LaserScan:
    """Returns, readings that mean nothing, and far ones that mean free space."""
    ranges = rng.choice([0.0, np.nan, 8.0, 90.0, *rng.uniform(0.05, 12.0, 12)], rng.integers(0, 22))
    laser_pose = rng.uniform(-0.3, 0.3, 3) * rng.integers(0, 2)
    return LaserScan(0.0, ranges, LASERS[rng.integers(0, 2)], laser_pose=laser_pose)


def random_poses(rng: np.random.Generator, count: int, extent: float) -> NDArray[np.float64]:
    return np.column_stack((rng.uniform(-extent, extent, (count, 2)), rng.uniform(-4.0, 4.0, count)))


def assert_same(found: OccupancyGrid, expected: OccupancyGrid) -> None:
    assert found.shape == expected.shape
    assert found.resolution == expected.resolution
    assert found.origin.tobytes() == expected.origin.tobytes()
    assert found.log_odds.tobytes() == expected.log_odds.tobytes()


@settings(deadline=None, max_examples=60)
@given(
    st.integers(0, 100_000),
    st.sampled_from([0.05, 0.1, 0.37]),
    st.sampled_from([0.0, 0.25, 3.0]),
    st.sampled_from([0.0, 2.5]),
    st.sampled_from([2, 128]),
)
def test_it_equals_a_grid_built_anew_whatever_came_and_moved(
    seed: int, resolution: float, tolerance: float, no_return_range: float, slack: int
) -> None:
    rng = np.random.default_rng(seed)
    scans: list[LaserScan] = []
    poses = np.zeros((0, 3))
    builder = GridBuilder(resolution, 6.0, no_return_range=no_return_range, tolerance=tolerance)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cells, "SLACK", slack)
        for _ in range(4):
            new = [random_scan(rng) for _ in range(rng.integers(0, 5))]
            where = random_poses(rng, len(new), rng.choice([1.0, 15.0]))
            builder.add(new, where)
            scans, poses = [*scans, *new], np.concatenate((poses, where))
            assert_same(
                builder.grid(),
                build_grid(scans, builder.poses, resolution, 6.0, no_return_range=no_return_range),
            )
            poses = poses + rng.choice([0.0, 0.01, 1.0], len(poses))[:, np.newaxis] * random_poses(
                rng, len(poses), 1.0
            )
            moved = builder.update(poses)
            assert moved <= len(poses)
            if tolerance == 0.0:
                assert (builder.poses == poses).all()
            assert_same(
                builder.grid(),
                build_grid(scans, builder.poses, resolution, 6.0, no_return_range=no_return_range),
            )


def test_only_what_moved_is_traced_anew() -> None:
    at = np.array([[0.0, 0.0, 0.0], [0.5, 0.2, 1.0], [-0.4, 0.1, 2.0]])
    builder = GridBuilder(0.1, tolerance=0.5)
    builder.add([room_scan_at(pose) for pose in at], at)
    before = builder.grid()
    assert builder.update(at + [0.03, 0.0, 0.0]) == 0
    assert_same(builder.grid(), before)
    assert (
        builder.update(at + [[0.0, 0.0, 0.0], [0.06, 0.0, 0.0], [0.0, 0.0, 0.02]]) == 2
    )  # beams of 4 m and more
    assert (builder.poses[0] == at[0]).all()
    assert builder.poses[1, 0] == pytest.approx(0.56)
    assert builder.update(at) == 2
    assert_same(builder.grid(), before)


def test_headings_are_compared_the_short_way_round() -> None:
    builder = GridBuilder(0.1)
    builder.add([room_scan_at(np.zeros(3))], np.array([[0.0, 0.0, math.pi - 1e-4]]))
    assert builder.update(np.array([[0.0, 0.0, -math.pi + 1e-4]])) == 0


def test_what_cannot_be_mapped_is_refused_and_changes_nothing() -> None:
    scan = room_scan_at(np.zeros(3))
    builder = GridBuilder(0.1)
    builder.add([scan], np.zeros((1, 3)))
    before = builder.grid()
    with pytest.raises(DataError, match="ran away"):
        builder.add([scan], np.array([[1e5, 1e5, 0.0]]))
    with pytest.raises(DataError, match="ran away"):
        GridBuilder(1e-4).add([scan], np.zeros((1, 3)))
    with pytest.raises(ValueError, match="finite"):
        builder.update(np.full((1, 3), np.nan))
    with pytest.raises(ValueError, match="one pose per scan: 1 scans, 2 poses"):
        builder.update(np.zeros((2, 3)))
    assert len(builder) == 1
    assert_same(builder.grid(), before)


def test_a_live_source_has_the_map_of_a_finished_log() -> None:
    slam, builder = Slam(Config()), GridBuilder(tolerance=0.0)
    for scan in SimulatedDataset("office", seed=1, scans=200).scans():
        _, *events = slam.process(scan)
        for event in events:
            if isinstance(event, KeyframeAdded):
                builder.add([scan], event.pose[np.newaxis])
        builder.update(slam.keyframe_poses)
    for _ in slam.finish():
        pass
    builder.update(slam.keyframe_poses)
    result = slam.result()
    assert (slam.keyframe_poses == result.keyframe_poses).all()
    assert_same(builder.grid(), build_grid(result.keyframes, result.keyframe_poses))
