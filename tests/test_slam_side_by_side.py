"""Work in parts: in their order, by as many threads as are asked for, and ended by an error."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from hsslam.config import load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.matching import create
from hsslam.slam.pipeline import Slam
from hsslam.slam.side_by_side import STRETCH, side_by_side, threads_for


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, STRETCH, 10 * STRETCH + 3])
def test_parts_come_in_their_order(count: int, threads: int) -> None:
    def work(i: int) -> int:
        time.sleep(0.001 * (i % 3))
        return i * i

    assert side_by_side(work, count, threads) == [i * i for i in range(count)]


def test_as_many_threads_work_as_are_asked_for() -> None:
    met = threading.Barrier(3, timeout=20.0)
    # None gets past before three are there.
    assert side_by_side(lambda i: met.wait() >= 0, 3 * STRETCH, 3) == [True] * (3 * STRETCH)


@pytest.mark.parametrize("wrong", [0, 7 * STRETCH])
@pytest.mark.parametrize("threads", [1, 2])
def test_an_error_ends_all_work_and_is_raised(threads: int, wrong: int) -> None:
    done = []

    def work(i: int) -> None:
        if i == wrong:
            raise RuntimeError("part")
        time.sleep(0.001)
        done.append(i)

    with pytest.raises(RuntimeError, match="part"):
        side_by_side(work, 100 * STRETCH, threads)
    assert len(done) < 50 * STRETCH


def test_threads_are_for_matchers_that_release_the_lock() -> None:
    assert threads_for(create("hide"), 3) == 3
    assert 1 <= threads_for(create("hide"), 0) <= 4
    assert threads_for(create("pl_icp"), 3) == 1


def test_what_is_found_does_not_depend_on_the_threads() -> None:
    log = SimulatedDataset("office", seed=3, scans=120)
    poses = [
        Slam(load_config(overrides=[f"graph.threads={threads}"])).solve(log.scans()).trajectory.poses
        for threads in (1, 2, 3)
    ]
    np.testing.assert_array_equal(poses[1], poses[0])
    np.testing.assert_array_equal(poses[2], poses[0])
