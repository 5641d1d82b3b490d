"""ATE and RPE: against evo, by hand, and on what must not matter."""

from __future__ import annotations

import numpy as np
import pytest
from evo.core import metrics as evo_metrics  # type: ignore[import-untyped]
from evo.core.trajectory import PosePath3D  # type: ignore[import-untyped]
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.errors import ConfigError, DataError
from hsslam.se2 import compose_many, pose, transform
from hsslam.trajectory import Trajectory
from hsslam_eval.metrics import align_rigid, ate, rpe

seeds = st.integers(0, 10_000)


def trajectory(poses: np.ndarray, indices: np.ndarray | None = None) -> Trajectory:
    indices = np.arange(len(poses)) if indices is None else indices
    return Trajectory(np.zeros(len(poses)), np.ascontiguousarray(poses), indices.astype(np.int64))


def true_and_estimate(seed: int, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    headings = np.cumsum(rng.normal(0.0, 0.3, count))
    steps = rng.uniform(0.05, 0.5, count)[:, None] * np.column_stack((np.cos(headings), np.sin(headings)))
    wrapped = (headings + np.pi) % (2 * np.pi) - np.pi
    true = np.column_stack((np.cumsum(steps, axis=0), wrapped))
    noisy = compose_many(true, rng.normal(0.0, [0.1, 0.1, 0.05], (count, 3)))
    frame = pose(*rng.uniform(-3.0, 3.0, 3))
    return true, compose_many(np.tile(frame, (count, 1)), noisy)


def evo_path(poses: np.ndarray) -> PosePath3D:
    matrices = []
    for x, y, theta in poses:
        m = np.eye(4)
        m[:2, :2] = [[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]]
        m[:2, 3] = x, y
        matrices.append(m)
    return PosePath3D(poses_se3=matrices)


def evo_error(metric: evo_metrics.PE, true: PosePath3D, estimate: PosePath3D) -> np.ndarray:
    metric.process_data((true, estimate))
    return np.asarray(metric.error)


@pytest.mark.parametrize("align", [True, False])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_ate_is_evos(seed: int, align: bool) -> None:
    true, estimate = true_and_estimate(seed)
    reference, other = evo_path(true), evo_path(estimate)
    if align:
        other.align(reference)
    relation = evo_metrics.PoseRelation
    found = ate(trajectory(estimate), trajectory(true), align=align)
    position = evo_metrics.APE(relation.translation_part)
    np.testing.assert_allclose(found.translation, evo_error(position, reference, other), atol=1e-9)
    heading = evo_metrics.APE(relation.rotation_angle_rad)
    np.testing.assert_allclose(found.rotation, evo_error(heading, reference, other), atol=1e-6)
    summary, statistics = found.summary(), position.get_all_statistics()
    for name in ("rmse", "mean", "median", "std", "max"):
        assert summary[f"translation_{name}_m"] == pytest.approx(statistics[name]), name


@pytest.mark.parametrize(("delta", "unit"), [(1, "frames"), (7, "frames"), (1.0, "metres"), (2.5, "metres")])
def test_rpe_is_evos(delta: float, unit: str) -> None:
    true, estimate = true_and_estimate(3)
    found = rpe(trajectory(estimate), trajectory(true), delta, unit)  # type: ignore[arg-type]
    for relation, ours in (
        (evo_metrics.PoseRelation.translation_part, found.translation),
        (evo_metrics.PoseRelation.rotation_angle_rad, found.rotation),
    ):
        metric = evo_metrics.RPE(
            relation,
            delta,
            evo_metrics.Unit.frames if unit == "frames" else evo_metrics.Unit.meters,
            all_pairs=unit == "frames",
            pairs_from_reference=True,
        )
        theirs = evo_error(metric, evo_path(true), evo_path(estimate))
        assert len(theirs) > 3
        np.testing.assert_allclose(ours, theirs, atol=1e-6)


@settings(deadline=None, max_examples=30)
@given(seed=seeds, x=st.floats(-50, 50), y=st.floats(-50, 50), theta=st.floats(-3.1, 3.1))
def test_alignment_finds_the_motion_between_two_copies(seed: int, x: float, y: float, theta: float) -> None:
    points = np.random.default_rng(seed).normal(size=(12, 2))
    motion = pose(x, y, theta)
    np.testing.assert_allclose(align_rigid(points, transform(motion, points)), motion, atol=1e-8)


@settings(deadline=None, max_examples=30)
@given(seed=seeds)
def test_no_small_change_of_the_alignment_fits_better(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source, target = rng.normal(size=(2, 15, 2))
    best = align_rigid(source, target)

    def misfit(motion: np.ndarray) -> float:
        return float(np.square(transform(motion, source) - target).sum())

    for nudge in np.vstack((np.eye(3), -np.eye(3))) * 1e-3:
        assert misfit(best + nudge) > misfit(best)


def test_poses_are_put_together_by_the_number_of_their_scan() -> None:
    true, _ = true_and_estimate(5)
    kept = np.array([2, 3, 17, 40, 41])
    found = ate(trajectory(true[kept], kept), trajectory(true), align=False)
    assert found.scans.tolist() == kept.tolist()
    assert found.translation.max() < 1e-12
    relative = rpe(trajectory(true[kept], kept), trajectory(true), 2)
    assert (relative.first.tolist(), relative.second.tolist()) == ([2, 3, 17], [17, 40, 41])


def test_rpe_by_path_cuts_where_the_true_path_reaches_delta() -> None:
    true = np.column_stack((np.arange(11) * 0.1, np.zeros((11, 2))))
    found = rpe(trajectory(true), trajectory(true), 0.3, "metres")
    assert found.first.tolist() == [0, 3, 6]
    assert found.second.tolist() == [3, 6, 9]


def test_bad_requests_say_what_is_wrong() -> None:
    true, estimate = true_and_estimate(6, count=5)
    both = trajectory(estimate), trajectory(true)
    with pytest.raises(ConfigError, match="whole"):
        rpe(*both, delta=1.5)
    with pytest.raises(ConfigError, match="positive"):
        rpe(*both, delta=0.0, unit="metres")
    with pytest.raises(DataError, match="smaller delta"):
        rpe(*both, delta=5)
    with pytest.raises(DataError, match="no scan in common"):
        ate(trajectory(estimate, np.arange(5) + 100), trajectory(true))
