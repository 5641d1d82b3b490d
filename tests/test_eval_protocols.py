"""The five protocols: pairs whose truth is the truth, the same each time, refused where there are none."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from hsslam.datasets.dataset import DatasetInfo
from hsslam.datasets.simulator import SimulatedDataset, raycast
from hsslam.errors import ConfigError, DataError
from hsslam.io.relations import Relations
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import between_many, pose, transform
from hsslam.trajectory import Trajectory
from hsslam_eval.protocols import make_pairs
from hsslam_eval.trials import TrialConfig, TrialPair

CORNERS = np.array([[-3.0, -2.0], [4.0, -2.0], [4.0, 3.0], [1.0, 3.0], [1.0, 2.2], [-3.0, 2.2]])
ROOM = np.column_stack((CORNERS, np.roll(CORNERS, -1, axis=0)))
BEAMS = ScanGeometry(-np.pi / 2, np.pi / 180, range_max=30.0)


@dataclass
class Log:
    """A small log: the room seen from poses along the way, odometry as given."""

    poses: np.ndarray
    odometry: np.ndarray
    known: Relations | None = None
    true: Trajectory | None = None
    laser_pose: np.ndarray = field(default_factory=lambda: np.zeros(3))
    read: int = 0

    @property
    def info(self) -> DatasetInfo:
        return DatasetInfo("room", "file", "a room")

    def scans(self) -> Iterator[LaserScan]:
        for index, (at, odometry) in enumerate(zip(self.poses, self.odometry, strict=True)):
            self.read += 1
            noise = np.random.default_rng(index).normal(0.0, 0.002, 180)
            ranges = raycast(ROOM, at[None], BEAMS, 180)[0] + noise
            yield LaserScan(0.0, ranges, BEAMS, odometry, self.laser_pose, index)

    def truth(self) -> Trajectory | None:
        return self.true

    def relations(self) -> Relations | None:
        return self.known


def log(count: int = 20, **more: object) -> Log:
    way = np.column_stack((np.linspace(-1.0, 1.0, count), np.zeros(count), np.linspace(0.0, 0.4, count)))
    return Log(way, way, **more)  # type: ignore[arg-type]


def related(way: np.ndarray, first: list[int], second: list[int]) -> Relations:
    i, j = np.array(first), np.array(second)
    return Relations(i, j, between_many(np.ascontiguousarray(way[i]), np.ascontiguousarray(way[j])))


def indices(pairs: list[TrialPair]) -> list[tuple[int, int]]:
    return [(pair.reference_index, pair.scan_index) for pair in pairs]


def misfit(pair: TrialPair) -> float:
    """Median distance from the scan's points, put where truth says, to the nearest of the reference (m)."""
    moved = transform(pair.truth, pair.scan_points)
    distances = np.linalg.norm(moved[:, None] - pair.reference_points[None], axis=2)
    return float(np.median(distances.min(axis=1)))


def test_relations_within_the_limits_with_their_own_truth() -> None:
    source = log()
    source.known = related(source.poses, [0, 5, 3, 8], [2, 1, 19, 9])
    pairs = make_pairs(source, TrialConfig(protocol="relations"))
    assert indices(pairs) == [(0, 2), (5, 1), (8, 9)]
    for pair, row in zip(pairs, (0, 1, 3), strict=True):
        np.testing.assert_array_equal(pair.truth, source.known.poses[row])
        assert pair.protocol == "relations"
        assert misfit(pair) < 0.03
    narrow = TrialConfig(protocol="relations", pair_angle_deg=0.5 * math.degrees(0.4 / 19) * 3)
    assert indices(make_pairs(source, narrow)) == [(8, 9)]


def test_reading_stops_at_the_last_scan_needed() -> None:
    source = log()
    source.known = related(source.poses, [0], [3])
    make_pairs(source, TrialConfig(protocol="relations"))
    assert source.read == 4


def test_points_are_in_the_robots_frame() -> None:
    source = log(laser_pose=pose(0.3, 0.0, 0.5))
    source.known = related(source.poses, [0], [0])
    (pair,) = make_pairs(source, TrialConfig(protocol="relations"))
    in_laser = next(source.scans()).points
    np.testing.assert_allclose(pair.scan_points, transform(pose(0.3, 0.0, 0.5), in_laser))


def test_static_pairs_lie_within_standstills_and_share_them_out() -> None:
    steps = [0.0] * 40 + [0.1, 0.2, 0.3] + [0.3] * 5 + [0.4] + [0.4] * 2
    odometry = np.column_stack((steps, np.zeros((len(steps), 2))))
    source = Log(odometry - [1.0, 0.0, 0.0], odometry)
    pairs = make_pairs(source, TrialConfig(protocol="static", count=8))
    assert len(set(indices(pairs))) == 8
    for pair in pairs:
        i, j = indices([pair])[0]
        assert i < j
        assert (i >= 1 and j <= 38) or (i >= 43 and j <= 46)
        assert not pair.truth.any()
        assert misfit(pair) < 0.01
    long_one = sum(i < 40 for i, _ in indices(pairs))
    assert long_one < 6  # one long standstill does not crowd out the others
    every = make_pairs(source, TrialConfig(protocol="static", count=10_000))
    assert len(set(indices(every))) == 38 * 37 // 2 + 4 * 3 // 2 + (1 if (48, 49) in indices(every) else 0)


def test_turning_on_the_spot_is_no_standstill() -> None:
    turning = np.column_stack((np.zeros((30, 2)), np.linspace(0.0, 1.0, 30)))
    with pytest.raises(DataError, match="static"):
        make_pairs(Log(turning, turning), TrialConfig(protocol="static"))


def test_split_halves_share_the_beams_of_one_scan() -> None:
    source = log(3)
    for pair, scan in zip(make_pairs(source, TrialConfig(protocol="split")), source.scans(), strict=True):
        assert indices([pair]) == [(scan.index, scan.index)]
        np.testing.assert_allclose(pair.reference_points, scan.points[0::2], atol=1e-12)
        np.testing.assert_allclose(pair.scan_points, scan.points[1::2], atol=1e-12)
        assert not pair.truth.any()


def test_consecutive_pairs_take_the_truth_of_the_trajectory() -> None:
    source = log()
    kept = np.array([0, 1, 2, 5, 6, 8, 10])
    truth = Trajectory(np.zeros(7), source.poses[kept], kept)
    pairs = make_pairs(source, TrialConfig(protocol="consecutive", consecutive_step=2), truth)
    assert indices(pairs) == [(0, 2), (6, 8), (8, 10)]
    assert all(misfit(pair) < 0.03 for pair in pairs)
    own = make_pairs(log(true=truth), TrialConfig(protocol="consecutive"))
    assert indices(own) == [(0, 1), (1, 2), (5, 6)]


def test_consecutive_reads_the_trajectory_that_the_config_names(tmp_path: Path) -> None:
    source, file = log(), tmp_path / "truth.csv"
    rows = "".join(f"{i},{x!r},{y!r},{theta!r}\n" for i, (x, y, theta) in enumerate(source.poses.tolist()))
    file.write_text("scan,x,y,theta\n" + rows, encoding="utf-8")
    pairs = make_pairs(source, TrialConfig(trajectory=file))
    assert {pair.protocol for pair in pairs} == {"consecutive"}
    assert len(pairs) == 19
    assert all(misfit(pair) < 0.03 for pair in pairs)
    with pytest.raises(ConfigError, match=r"\.tum or \.csv"):
        make_pairs(source, TrialConfig(trajectory=tmp_path / "truth.txt"))


def test_simulated_pairs_fit_where_truth_says() -> None:
    pairs = make_pairs(SimulatedDataset("hall"), TrialConfig(protocol="simulated", count=15))
    assert len(pairs) == 15
    assert any(pair.truth.any() for pair in pairs)
    for pair in pairs:
        assert math.hypot(pair.truth[0], pair.truth[1]) < 0.6
        assert abs(pair.truth[2]) < math.radians(40.0)
        assert misfit(pair) < 0.1


def test_auto_takes_the_best_truth_there_is() -> None:
    config = TrialConfig(count=3)

    def chosen(source: Log | SimulatedDataset, truth: Trajectory | None = None) -> str:
        return make_pairs(source, config, truth)[0].protocol

    moving, still = log(), log()
    still.odometry = np.zeros((20, 3))
    assert chosen(moving) == "split"
    assert chosen(still) == "static"
    assert chosen(moving, Trajectory(np.zeros(20), moving.poses, np.arange(20))) == "consecutive"
    assert chosen(SimulatedDataset("hall", scans=2)) == "simulated"
    moving.known = related(moving.poses, [0], [1])
    assert chosen(moving) == "relations"


@pytest.mark.parametrize("protocol", ["simulated", "relations", "static", "split", "consecutive"])
def test_count_is_kept_and_the_seed_decides(protocol: str) -> None:
    def make(seed: int) -> list[TrialPair]:
        config = TrialConfig.model_validate({"protocol": protocol, "count": 6, "seed": seed})
        if protocol == "simulated":
            return make_pairs(SimulatedDataset("hall"), config)
        source = log(40)
        source.true = Trajectory(np.zeros(40), source.poses, np.arange(40))
        source.known = related(source.poses, list(range(30)), list(range(1, 31)))
        if protocol == "static":
            source.odometry = np.zeros((40, 3))
        return make_pairs(source, config)

    first, again, other = make(1), make(1), make(2)
    assert len(first) == len(other) == 6
    for pair, same in zip(first, again, strict=True):
        np.testing.assert_array_equal(pair.scan_points, same.scan_points)
        np.testing.assert_array_equal(pair.truth, same.truth)
    assert any(
        pair.scan_points.shape != different.scan_points.shape
        or not np.array_equal(pair.scan_points, different.scan_points)
        for pair, different in zip(first, other, strict=True)
    )


def test_what_a_dataset_cannot_give_is_said() -> None:
    for protocol, message in (
        ("simulated", "not simulated"),
        ("relations", "no relations"),
        ("consecutive", "no true trajectory"),
    ):
        with pytest.raises(ConfigError, match=message):
            make_pairs(log(), TrialConfig.model_validate({"protocol": protocol}))
    beyond = Relations(np.array([0]), np.array([99]), np.zeros((1, 3)))
    with pytest.raises(DataError, match="no scan 99"):
        make_pairs(log(known=beyond), TrialConfig(protocol="relations"))
    far = Relations(np.array([0]), np.array([1]), np.array([[2.0, 0.0, 0.0]]))
    with pytest.raises(DataError, match="pair_distance"):
        make_pairs(log(known=far), TrialConfig(protocol="relations"))
