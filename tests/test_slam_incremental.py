"""The estimate while a run goes on, where iSAM2 gives up on its factors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hsslam.se2 import Poses, between, compose, pose
from hsslam.slam import incremental
from hsslam.slam.events import Edge
from hsslam.slam.factors import GraphError
from hsslam.slam.incremental import Incremental

TRUTH: Poses = np.array([pose(0.3 * i, 0.0, 0.0) for i in range(6)])


class GivesUp:
    """An iSAM2 that can solve nothing."""

    def update(self, *_: Any) -> None:
        """Fail as GTSAM does."""
        raise RuntimeError("Indeterminate linear system detected while working near variable 3")


def solved(monkeypatch: pytest.MonkeyPatch, *gives_up: str) -> Poses:
    """Poses of a chain that drifted, and a loop that tells of it, where some factorisations fail."""
    make = incremental._isam
    monkeypatch.setattr(
        incremental, "_isam", lambda kind="CHOLESKY": GivesUp() if kind in gives_up else make(kind)
    )
    solver = Incremental(TRUTH[0], robust_scale=None)
    drifting = pose(0.3, 0.02, 0.0)
    estimate = [TRUTH[0]]
    for k in range(5):
        solver.add(Edge(k, k + 1, drifting, 1e-2 * np.eye(3), "odometry"))
        estimate.append(compose(estimate[-1], drifting))
    solver.add(Edge(0, 5, between(TRUTH[0], TRUTH[5]), 1e-6 * np.eye(3), "loop"))
    poses = np.array(estimate)
    solver.solve(poses)
    return poses


def test_what_the_usual_factors_cannot_solve_is_solved_by_others(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = solved(monkeypatch)
    assert np.abs(usual[-1] - TRUTH[-1]).max() < 0.01
    assert solved(monkeypatch, "CHOLESKY") == pytest.approx(usual, abs=1e-6)


def test_what_none_can_solve_is_said_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(GraphError, match="do not fix every pose"):
        solved(monkeypatch, "CHOLESKY", "QR")
