"""Fifty false loops among the true ones, random and in groups that agree: the map stays as good as without."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from hsslam.config import Config
from hsslam.datasets.simulator import SimulatedDataset

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "eval" / "benchmarks"))

from false_loops import KINDS, Unfinished, error_of

FALSE = 50
SCANS = 230


@pytest.fixture(scope="module")
def office() -> SimulatedDataset:
    return SimulatedDataset("office", seed=1, scans=SCANS)


@pytest.fixture(scope="module")
def run(office: SimulatedDataset) -> Unfinished:
    """About a hundred keyframes, and true loops among them."""
    unfinished = Unfinished(Config(), office.scans())
    assert 60 <= len(unfinished.poses) <= 140
    assert unfinished.true_loops > 5
    return unfinished


@pytest.mark.parametrize("robust", ["cauchy", "gnc"])
def test_false_loops_do_not_harm(robust: str, run: Unfinished, office: SimulatedDataset) -> None:
    clean, before = run.finish(robust, [])
    error = error_of(clean, office)
    for draw in KINDS.values():
        false = draw(run.poses, FALSE, np.random.default_rng(7))
        result, rejected = run.finish(robust, false)
        assert error_of(result, office) <= 1.1 * error + 0.001
        assert rejected >= before + 0.9 * FALSE


def test_without_a_robust_loss_they_ruin_the_map(run: Unfinished, office: SimulatedDataset) -> None:
    """Else the tests above would show nothing."""
    clean = error_of(run.finish("none", [])[0], office)
    for draw in KINDS.values():
        result, _ = run.finish("none", draw(run.poses, FALSE, np.random.default_rng(7)))
        assert error_of(result, office) > 10.0 * clean
