"""What a loop moves while a run goes on: the newest keyframes, and all of them if it must."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.config import GraphSection
from hsslam.se2 import pose
from hsslam.slam import incremental
from hsslam.slam.events import Edge
from hsslam.slam.factors import GraphError
from hsslam.slam.graph import PoseGraph

NOISE = np.diag([1e-3, 1e-3, 1e-4])
LENGTH = 0.02


@pytest.fixture(autouse=True)
def few_active(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(incremental, "ACTIVE", 20)


def drive(graph: PoseGraph, steps: int) -> None:
    """Go on along a line, every step measured too long by 1 mm."""
    for _ in range(steps):
        graph.add_keyframe(pose(LENGTH + 0.001, 0.0, 0.0), NOISE)


def close(graph: PoseGraph, first: int, error: float = 0.0) -> NDArray[np.float64]:
    """Close a loop to a keyframe, as far off as told, and return how far each pose moved by it (m)."""
    newest = len(graph) - 1
    before = graph.poses.copy()
    relative = pose(LENGTH * (newest - first) + error, 0.0, 0.0)
    graph.add_edge(Edge(first, newest, relative, 0.01 * NOISE, "loop"))
    assert graph.wants_update
    graph.update()
    return np.hypot(*(graph.poses - before)[:, :2].T)


def test_a_loop_does_not_move_what_is_old() -> None:
    graph = PoseGraph(GraphSection(robust="none"), np.zeros(3))
    drive(graph, 38)
    moved = close(graph, 0)
    assert moved[1] > 0.0  # all are young still
    drive(graph, 30)
    moved = close(graph, 5)
    assert (moved[:49] == 0.0).all()
    assert (moved[49:] > 0.0).all()
    assert graph.poses[68, 0] == pytest.approx(graph.poses[5, 0] + 63 * LENGTH, abs=0.004)
    drive(graph, 30)
    assert (close(graph, 60)[:50] == 0.0).all()


def test_a_loop_that_contradicts_what_is_old_moves_it() -> None:
    graph = PoseGraph(GraphSection(robust="none"), np.zeros(3))
    drive(graph, 38)
    close(graph, 0)
    drive(graph, 30)
    close(graph, 5)
    drive(graph, 30)
    moved = close(graph, 5, error=-0.5)
    assert (moved[6:] > 0.0).all()
    drive(graph, 30)
    assert (close(graph, 100)[:90] == 0.0).all()


def test_a_loop_that_contradicts_what_is_sure_does_not_move_what_is_old() -> None:
    graph = PoseGraph(GraphSection(), np.zeros(3))
    drive(graph, 38)
    close(graph, 0)
    drive(graph, 30)
    close(graph, 5)
    assert (close(graph, 5, error=-0.5)[:40] == 0.0).all()


def test_the_first_closure_of_a_long_way_moves_all_of_it() -> None:
    graph = PoseGraph(GraphSection(robust="none"), np.zeros(3))
    drive(graph, 150)
    moved = close(graph, 0)
    assert (moved[1:] > 0.0).all()


def test_a_graph_goes_on_after_the_optimisation_at_its_end() -> None:
    graph = PoseGraph(GraphSection(robust="none"), np.zeros(3))
    drive(graph, 60)
    close(graph, 0)
    graph.optimise()
    drive(graph, 30)
    assert (close(graph, 40)[:71] == 0.0).all()


@pytest.mark.parametrize(("first", "second"), [(3, 2), (2, 2), (-1, 3), (0, 11)])
def test_constraints_name_keyframes_that_exist_the_earlier_first(first: int, second: int) -> None:
    graph = PoseGraph(GraphSection(), np.zeros(3))
    drive(graph, 10)
    with pytest.raises(GraphError, match=f"{first} and {second}, of 11"):
        graph.add_edge(Edge(first, second, np.zeros(3), NOISE, "loop"))
