"""The relations metric: exact on what is exact, blind to the frame, and as published on the peers' files."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.errors import DataError
from hsslam.io.relations import Relations
from hsslam.se2 import between, between_many, compose, compose_many, pose
from hsslam.trajectory import Trajectory
from hsslam_eval.metrics import fill_in, relations_errors

angles = st.floats(-3.1, 3.1)
lengths = st.floats(-20.0, 20.0)
poses = st.builds(pose, lengths, lengths, angles)


def trajectory(poses: np.ndarray, indices: np.ndarray | None = None) -> Trajectory:
    indices = np.arange(len(poses)) if indices is None else np.asarray(indices)
    return Trajectory(np.zeros(len(poses)), np.array(poses), indices.astype(np.int64))


def walk(seed: int, count: int = 30) -> np.ndarray:
    rng = np.random.default_rng(seed)
    out = [pose(0.0, 0.0, 0.0)]
    for _ in range(count - 1):
        out.append(compose(out[-1], rng.normal(0.0, [0.3, 0.05, 0.4])))
    return np.array(out)


def relations_of(true: np.ndarray, seed: int, count: int = 25) -> Relations:
    rng = np.random.default_rng(seed)
    first, second = rng.integers(0, len(true), (2, count))
    return Relations(first, second, between_many(true[first], true[second]))


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), frame=poses)
def test_the_truth_has_no_error_in_any_frame(seed: int, frame: np.ndarray) -> None:
    true = walk(seed)
    moved = compose_many(np.tile(frame, (len(true), 1)), true)
    errors = relations_errors(trajectory(moved), None, relations_of(true, seed))
    assert errors.translation.max() < 1e-9
    assert errors.rotation.max() < 1e-9


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 1000), error=poses)
def test_a_known_error_of_the_second_pose_is_measured_as_it_is(seed: int, error: np.ndarray) -> None:
    true = walk(seed)
    wrong = true.copy()
    wrong[-1] = compose(true[-1], error)
    last = len(true) - 1
    relation = Relations(np.array([3]), np.array([last]), between(true[3], true[last])[None])
    found = relations_errors(trajectory(wrong), None, relation)
    assert found.translation[0] == pytest.approx(math.hypot(error[0], error[1]), abs=1e-9)
    assert found.rotation[0] == pytest.approx(abs(error[2]), abs=1e-9)


def test_summary_by_hand() -> None:
    estimate = trajectory(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, -0.5]]))
    found = relations_errors(
        estimate, None, Relations(np.zeros(3, np.int64), np.array([1, 2, 3]), np.zeros((3, 3)))
    ).summary()
    assert found["count"] == 3
    assert found["translation_mean_m"] == pytest.approx(4 / 3)
    assert found["translation_std_m"] == pytest.approx(np.std([1, 3, 0]))
    assert found["translation_squared_mean_m2"] == pytest.approx(10 / 3)
    assert found["translation_median_m"] == pytest.approx(1.0)
    assert found["translation_max_m"] == pytest.approx(3.0)
    assert found["rotation_mean_deg"] == pytest.approx(math.degrees(0.5) / 3)
    assert found["rotation_max_deg"] == pytest.approx(math.degrees(0.5))


def test_missing_scans_are_carried_by_odometry_from_the_last_pose() -> None:
    true = walk(4)
    odometry = compose_many(np.tile(pose(5.0, -2.0, 1.0), (len(true), 1)), true)
    kept = np.array([5, 9, 20])
    filled = fill_in(trajectory(true[kept], kept), trajectory(odometry), np.array([0, 5, 6, 19, 20, 29]))
    np.testing.assert_allclose(filled, true[[0, 5, 6, 19, 20, 29]], atol=1e-9)


def test_a_jump_at_the_next_pose_does_not_reach_back() -> None:
    estimate = trajectory(np.array([[0.0, 0.0, 0.0], [9.0, 9.0, 1.0]]), np.array([0, 4]))
    odometry = trajectory(np.column_stack((np.arange(5.0), np.zeros((5, 2)))))
    np.testing.assert_allclose(fill_in(estimate, odometry, np.array([3])), [[3.0, 0.0, 0.0]])


def test_missing_scans_without_odometry_are_an_error() -> None:
    with pytest.raises(DataError, match=r"no pose for 1 scans, the first of them scan 1; .*odometry"):
        fill_in(trajectory(np.zeros((2, 3)), np.array([0, 2])), None, np.array([0, 1]))


def test_odometry_of_another_log_is_an_error() -> None:
    with pytest.raises(DataError, match="no pose for scan 7"):
        fill_in(trajectory(np.zeros((1, 3))), trajectory(np.zeros((5, 3))), np.array([7]))


def test_nothing_to_compare_is_an_error() -> None:
    none = Relations(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)))
    with pytest.raises(DataError, match="no relations"):
        relations_errors(trajectory(np.zeros((1, 3))), None, none)
    one = Relations(np.zeros(1, np.int64), np.zeros(1, np.int64), np.zeros((1, 3)))
    with pytest.raises(DataError, match="empty"):
        relations_errors(trajectory(np.zeros((0, 3))), None, one)


def test_peers_figures_come_out_to_the_last_printed_digit(shared_data: Path) -> None:
    from hsslam.io.carmen import read_carmen
    from hsslam.io.relations import read_relations
    from hsslam.io.trajectory_csv import read_trajectory_csv

    intel = shared_data / "intel"
    row = re.compile(r"\| `(\S+\.csv)` \| (\d+\.\d+) \+- (\d+\.\d+) \| (\d+\.\d+) \|")
    published = row.findall((shared_data / "README.md").read_text(encoding="utf-8"))
    assert len(published) == 5
    odometry = trajectory(np.array([scan.odometry for scan in read_carmen(intel / "intel.clf.bz2")]))
    relations = read_relations(intel / "intel.relations", index=intel / "intel.relations.index.csv")
    for name, mean, std, rotation in published:
        found = relations_errors(read_trajectory_csv(intel / "peers" / name), odometry, relations).summary()
        assert found["count"] == 2984
        printed = (f"{found['translation_mean_m']:.4f}", f"{found['translation_std_m']:.4f}")
        assert (*printed, f"{found['rotation_mean_deg']:.3f}") == (mean, std, rotation), name
