"""The pipeline and its graph, on the simulated office and on graphs made by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.config import Config, GraphSection, load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.errors import DataError
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import between, between_many, compose, pose
from hsslam.slam.events import Edge, Event, KeyframeAdded, LoopChecked, Optimised, SlamResult, Tracked
from hsslam.slam.factors import GraphError, body_covariance
from hsslam.slam.graph import PoseGraph
from hsslam.slam.journal import Replay
from hsslam.slam.pipeline import Slam
from hsslam.slam.recovery import steps_along


@pytest.fixture(scope="module")
def office() -> SimulatedDataset:
    return SimulatedDataset("office", seed=1, scans=500)


@pytest.fixture(scope="module")
def office_run(office: SimulatedDataset) -> tuple[SlamResult, list[Event]]:
    slam = Slam(Config())
    events = list(slam.run(office.scans()))
    return slam.result(), events


def errors(poses: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Errors (m) of positions seen from the first pose."""
    seen = between_many(np.tile(poses[0], (len(poses), 1)), poses)
    true = between_many(np.tile(truth[0], (len(truth), 1)), truth)
    return np.hypot(*(seen - true)[:, :2].T)


def test_every_scan_gets_a_pose_near_the_truth(
    office: SimulatedDataset, office_run: tuple[SlamResult, list[Event]]
) -> None:
    result, _ = office_run
    truth = office.truth()
    assert truth is not None
    assert len(result.trajectory) == len(truth) == 500
    found = errors(result.trajectory.poses, truth.poses)
    odometry = errors(result.odometry.poses, truth.poses)
    assert found.max() < 0.08
    assert found.max() < 0.2 * odometry.max()
    assert (np.asarray(result.trajectory.stamps) == truth.stamps).all()


def test_events_tell_what_happened(office_run: tuple[SlamResult, list[Event]]) -> None:
    result, events = office_run
    tracked = [e for e in events if isinstance(e, Tracked)]
    keyframes = [e for e in events if isinstance(e, KeyframeAdded)]
    loops = [e for e in events if isinstance(e, LoopChecked)]
    assert [e.scan for e in tracked] == list(range(500))
    assert [e.keyframe for e in keyframes] == list(range(len(result.keyframes)))
    assert loops == result.loops
    assert any(loop.accepted for loop in loops)
    assert all(bool(loop.reason) is not loop.accepted for loop in loops)
    assert isinstance(events[-1], Optimised)
    assert sum(e.matched for e in tracked) == result.matched


def test_same_seed_same_result_and_replay_changes_nothing(office: SimulatedDataset) -> None:
    def run(replay: Replay | None = None) -> tuple[SlamResult, list[Event]]:
        slam = Slam(Config(), replay)
        events = list(slam.run(s for s in office.scans() if s.index < 120))
        return slam.result(), events

    first, events = run()
    again, _ = run()
    half = events[: len(events) // 2]
    replay = Replay(
        tracked={e.scan: e for e in half if isinstance(e, Tracked)},
        loops={(e.first, e.second): e for e in half if isinstance(e, LoopChecked)},
    )
    resumed, _ = run(replay)
    assert (first.trajectory.poses == again.trajectory.poses).all()
    assert (first.trajectory.poses == resumed.trajectory.poses).all()


@pytest.mark.parametrize("matcher", ["hsl", "glasm"])
def test_other_matchers_drive_it(matcher: str, office: SimulatedDataset) -> None:
    slam = Slam(load_config(overrides=[f"matcher={matcher}"]))
    for _ in slam.run(s for s in office.scans() if s.index < 60):
        pass
    truth = office.truth()
    assert truth is not None
    assert errors(slam.result().trajectory.poses, truth.poses[:60]).max() < 0.15


def blind(index: int) -> LaserScan:
    geometry = ScanGeometry(-1.5, 0.1, range_max=8.0)
    return LaserScan(
        float(index), np.full(30, 9.0), geometry, odometry=pose(0.1 * index, 0.0, 0.0), index=index
    )


def test_odometry_stands_in_where_nothing_is_seen() -> None:
    slam = Slam(Config())
    events = list(slam.run(blind(i) for i in range(30)))
    assert not any(e.matched for e in events if isinstance(e, Tracked) and e.scan > 0)
    assert slam.result().trajectory.poses[-1] == pytest.approx([2.9, 0.0, 0.0], abs=1e-6)


def test_a_log_without_scans_is_an_error() -> None:
    with pytest.raises(DataError, match="no scans"):
        list(Slam(Config()).run([]))


SMALL = np.diag([1e-4, 1e-4, 1e-4])


def square(drift: float, config: GraphSection | None = None) -> tuple[PoseGraph, list[NDArray[np.float64]]]:
    """A square of 40 keyframes driven with a heading drift; returns the graph and the true poses."""
    truth = [np.zeros(3)]
    graph = PoseGraph(config or GraphSection(), np.zeros(3))
    for i in range(39):
        step = pose(0.0, 0.0, math.pi / 2) if i % 10 == 9 else pose(1.0, 0.0, 0.0)
        truth.append(compose(truth[-1], step))
        graph.add_keyframe(step + np.array([0.0, 0.0, drift]), 10.0 * SMALL)
    return graph, truth


def largest_error(graph: PoseGraph, truth: list[NDArray[np.float64]]) -> float:
    return float(np.hypot(*(graph.poses - np.array(truth))[:, :2].T).max())


def loop(truth: list[NDArray[np.float64]], first: int, second: int) -> Edge:
    return Edge(first, second, between(truth[first], truth[second]), SMALL, "loop")


def test_a_loop_corrects_drift_online_and_in_the_batch() -> None:
    graph, truth = square(0.005)
    before = largest_error(graph, truth)
    graph.add_edge(loop(truth, 0, 39))
    graph.add_edge(loop(truth, 5, 25))
    graph.update()
    online = largest_error(graph, truth)
    error_before, error_after, _ = graph.optimise()
    assert online < 0.5 * before
    assert error_after <= error_before + 1e-9
    assert largest_error(graph, truth) < 0.5 * before


@pytest.mark.parametrize("robust", ["cauchy", "gnc"])
def test_a_false_loop_does_not_ruin_the_graph(robust: str) -> None:
    config = GraphSection(robust=robust)
    graph, truth = square(0.001, config)
    clean = largest_error(graph, truth)
    for first, second in ((0, 39), (2, 37), (5, 30)):
        graph.add_edge(loop(truth, first, second))
    graph.add_edge(Edge(3, 20, pose(0.2, 0.1, 0.0), SMALL, "loop"))
    _, _, disbelieved = graph.optimise()
    assert largest_error(graph, truth) < max(clean, 0.1)
    assert disbelieved[-1]
    assert disbelieved.sum() == 1


@pytest.mark.parametrize(
    ("relative", "covariance", "words"),
    [
        (np.array([np.nan, 0.0, 0.0]), SMALL, "not finite"),
        (np.zeros(3), np.diag([1.0, 1.0, -1.0]), "not positive definite"),
        (np.zeros(3), np.full((3, 3), np.nan), "not positive definite"),
    ],
)
def test_unusable_constraints_are_refused(
    relative: NDArray[np.float64], covariance: NDArray[np.float64], words: str
) -> None:
    graph = PoseGraph(GraphSection(), np.zeros(3))
    with pytest.raises(GraphError, match=words):
        graph.add_keyframe(relative, covariance)


def test_covariance_is_turned_into_the_second_pose_frame() -> None:
    """Certain along the first pose's x is certain along the second pose's y after a quarter turn."""
    edge = Edge(0, 1, pose(1.0, 0.0, math.pi / 2), np.diag([1e-6, 1.0, 1e-4]), "loop")
    turned = body_covariance(edge)
    assert turned[0, 0] == pytest.approx(1.0, rel=1e-3)
    assert turned[1, 1] < 1e-4


def test_tracking_survives_odometry_that_jumps(office: SimulatedDataset) -> None:
    """As the MIT CSAIL log's does: a step of nearly a metre and half a turn that never happened."""
    jump = pose(0.8, 0.1, math.radians(50.0))

    def scans() -> Iterator[LaserScan]:
        for scan in office.scans():
            if scan.index == 80:
                return
            yield scan if scan.index < 40 else replace(scan, odometry=compose(jump, scan.odometry))

    slam = Slam(Config())
    events = list(slam.run(scans()))
    truth = office.truth()
    assert truth is not None
    assert all(e.matched for e in events if isinstance(e, Tracked))
    assert errors(slam.result().trajectory.poses, truth.poses[:80]).max() < 0.08


def test_tiles_cover_the_wide_window_and_overlap() -> None:
    for wide, tile in ((0.75, 0.2), (1.0, 0.3), (0.1, 0.2), (math.pi / 3, math.pi / 18)):
        middles = steps_along(wide, tile)
        assert middles == pytest.approx(-middles[::-1])
        assert middles[-1] + tile >= wide
        assert (np.diff(middles) < 2.0 * tile).all()


def test_marginal_covariances_grow_along_a_chain_and_shrink_with_a_loop() -> None:
    long = np.diag([1e-4, 9e-4, 1e-4])
    chain = PoseGraph(GraphSection(), pose(1.0, 2.0, 0.5))
    for _ in range(10):
        chain.add_keyframe(pose(1.0, 0.0, 0.3), long)
    open_end = chain.marginal_covariances()
    assert open_end.shape == (11, 3, 3)
    traces = open_end[:, 0, 0] + open_end[:, 1, 1]
    assert (np.diff(traces) > 0.0).all()
    # One step along x, seen in a map that is turned by 0.5: heading noise of the start is negligible.
    c, s = math.cos(0.5), math.sin(0.5)
    turn = np.array([[c, -s], [s, c]])
    step = body_covariance(Edge(0, 1, pose(1.0, 0.0, 0.3), long, "odometry"))
    back = np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    assert open_end[1, :2, :2] == pytest.approx(
        turn @ back @ step[:2, :2] @ back.T @ turn.T, rel=1e-3, abs=1e-7
    )
    closed = chain
    closed.add_edge(Edge(0, 10, between(chain.poses[0], chain.poses[10]), long, "loop"))
    assert closed.marginal_covariances()[10].trace() < 0.5 * open_end[10].trace()


def test_a_run_that_is_asked_for_marginals_has_them(office: SimulatedDataset) -> None:
    slam = Slam(load_config(overrides=["graph.marginals=true", "graph.rescan_keyframes=0"]))
    for _ in slam.run(s for s in office.scans() if s.index < 40):
        pass
    result = slam.result()
    assert result.covariances is not None
    assert result.covariances.shape == (len(result.keyframes), 3, 3)
    assert (np.linalg.eigvalsh(result.covariances) > 0.0).all()


def test_rounds_of_refinement_end_when_nothing_moves(office: SimulatedDataset) -> None:
    slam = Slam(load_config(overrides=["graph.refine_rounds=30", "graph.rescan_keyframes=0"]))
    events = slam.run(s for s in office.scans() if s.index < 150)
    stages = [event.stage for event in events if isinstance(event, Optimised)]
    assert stages[:2] == ["final", "refinement 1"]
    assert len(stages) < 12


def test_a_finished_run_goes_on_and_is_finished_again(office: SimulatedDataset) -> None:
    slam = Slam()
    scans = [scan for scan in office.scans() if scan.index < 80]
    for scan in scans[:40]:
        slam.process(scan)
    assert len(list(slam.finish())) > 0
    assert len(slam.result().trajectory.poses) == 40
    for scan in scans[40:]:
        slam.process(scan)
    assert len(list(slam.finish())) > 0
    found = slam.result().trajectory.poses
    assert len(found) == 80
    error = between_many(office.poses[:80], found)
    assert np.hypot(error[:, 0], error[:, 1]).max() < 0.05


def test_after_the_last_scan_none_may_follow(office: SimulatedDataset) -> None:
    scans = [scan for scan in office.scans() if scan.index < 31]
    ended, open_end = Slam(), Slam()
    for slam in (ended, open_end):
        for scan in scans[:30]:
            slam.process(scan)
    list(ended.finish(last=True))
    list(open_end.finish())
    assert (ended.result().trajectory.poses == open_end.result().trajectory.poses).all()
    with pytest.raises(DataError, match="finished for the last time"):
        ended.process(scans[30])
    with pytest.raises(DataError, match="finished for the last time"):
        list(ended.finish())
