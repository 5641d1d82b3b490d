"""Which loops move the estimate while a run goes on, and which wait for its end."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.config import GraphSection
from hsslam.se2 import pose
from hsslam.slam.events import Edge
from hsslam.slam.graph import PoseGraph

NOISE = np.diag([1e-3, 1e-3, 1e-4])


def drifted(step: float) -> PoseGraph:
    """Ten steps of a metre, measured ``step`` too long."""
    graph = PoseGraph(GraphSection(), np.zeros(3))
    for _ in range(10):
        graph.add_keyframe(pose(1.0 + step, 0.0, 0.0), NOISE)
    return graph


def test_many_loops_that_say_nothing_new_cost_no_update_but_count_at_the_end() -> None:
    graph = drifted(0.001)
    for _ in range(50):
        graph.add_edge(Edge(0, 10, pose(10.0, 0.0, 0.0), 0.01 * NOISE, "loop"))
    assert not graph.wants_update
    assert graph.poses[10, 0] == pytest.approx(10.01)
    graph.optimise()
    assert graph.poses[10, 0] == pytest.approx(10.0, abs=0.001)


@pytest.mark.parametrize("relative", [pose(10.0, 0.0, 0.0), pose(10.05, 0.0, 0.02)])
def test_a_loop_that_says_something_moves_the_estimate_at_once(relative: NDArray[np.float64]) -> None:
    graph = drifted(0.005)
    before = np.abs(graph.poses[10] - relative).max()
    graph.add_edge(Edge(0, 10, relative, NOISE, "loop"))
    assert graph.wants_update
    graph.update()
    assert not graph.wants_update
    assert np.abs(graph.poses[10] - relative).max() < 0.7 * before


def test_a_graph_that_was_optimised_goes_on_from_there() -> None:
    graph = drifted(0.001)
    for _ in range(50):
        graph.add_edge(Edge(0, 10, pose(10.0, 0.0, 0.0), 0.01 * NOISE, "loop"))
    graph.optimise()
    for _ in range(10):
        graph.add_keyframe(pose(1.01, 0.0, 0.0), NOISE)
    assert graph.poses[20, 0] == pytest.approx(20.1, abs=0.002)
    graph.add_edge(Edge(0, 20, pose(20.0, 0.0, 0.0), 0.01 * NOISE, "loop"))
    graph.update()
    assert graph.poses[20, 0] < 20.06
    assert graph.poses[10, 0] == pytest.approx(10.0, abs=0.002)
