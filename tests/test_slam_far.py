"""Places that are metres away from where they are thought to be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import keyframes_of, room_scan_at

from hsslam.config import load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.matching import create
from hsslam.matching.interface import SearchWindow
from hsslam.se2 import Points, Poses, between, compose, pose, wrap
from hsslam.search.exhaustive import ExhaustiveReference, lattice_search
from hsslam.slam.far import CELL, FarSearch
from hsslam.slam.loops import Candidate, LoopCloser
from hsslam.slam.stopwatch import Stopwatch

WIDE = SearchWindow(6.0, 6.0, math.radians(30.0))
PLACE = room_scan_at(np.zeros(3)).points


@pytest.mark.parametrize("guess", [pose(4.5, -3.0, 0.3), pose(-2.0, 5.0, -0.4), pose(0.0, 0.0, 0.0)])
def test_a_place_is_found_from_metres_away(guess: np.ndarray) -> None:
    truth = pose(0.4, -0.3, 0.1)
    found = FarSearch(PLACE).best(room_scan_at(truth, noise=0.01).points, compose(guess, truth), WIDE)
    assert np.abs(found[:2] - truth[:2]).max() < 2.0 * CELL
    assert abs(wrap(found[2] - truth[2])) < math.radians(2.0)


def test_without_points_the_guess_is_all_there_is() -> None:
    nothing, guess = np.empty((0, 2)), pose(1.0, 2.0, 0.3)
    assert (FarSearch(PLACE).best(nothing, guess, WIDE) == guess).all()
    assert (FarSearch(nothing).best(PLACE, guess, WIDE) == guess).all()


def test_a_search_that_nothing_settles_ends_with_the_guess() -> None:
    """Three points fit everywhere: every pose of the window would have to be looked at."""
    reference = ExhaustiveReference(PLACE, "likelihood", CELL, CELL)
    fitness = reference.fitness_of(PLACE[:3])
    proof = lattice_search(reference, fitness, np.zeros(3), WIDE, budget=50)
    assert proof.evaluations < 50 + math.prod(2 * np.floor(WIDE.half / CELL) + 1)
    assert proof.bound == 1.0
    assert (proof.pose == 0.0).all()


def test_other_answers_are_looked_for_on_every_side_and_outside_of_what_is_near() -> None:
    answer, near = pose(0.1, 0.2, 0.05), SearchWindow(0.5, 0.5, math.radians(15.0))
    found = FarSearch(PLACE).elsewhere(PLACE, answer, WIDE, near)
    assert len(found) == 6
    for other in found:
        off = np.abs(other - answer)
        assert (off >= near.half - 1e-6).any()
        assert (off <= WIDE.half + 1e-6).all()


def test_a_window_that_reaches_no_further_holds_no_other_answer() -> None:
    near = SearchWindow(0.5, 0.5, math.radians(15.0))
    assert FarSearch(PLACE).elsewhere(PLACE, np.zeros(3), near, near) == []


DRIFT = pose(4.2, -3.1, 0.15)


@pytest.fixture(scope="module")
def round_trip() -> tuple[Poses, list[Points]]:
    """True poses and points of keyframes along the office's corridor, and of one more, back among the first ones."""
    log = SimulatedDataset("office", scans=121, seed=3)
    scans = list(log.scans())
    numbers = [*range(0, 121, 4), 22]
    return log.poses[numbers], [scans[i].robot_points for i in numbers]


@pytest.mark.parametrize("name", ["hide", "pl_icp"])
def test_a_loop_is_found_after_a_drift_of_metres(name: str, round_trip: tuple[Poses, list[Points]]) -> None:
    truth, points = round_trip
    estimate = truth.copy()
    estimate[-1] = compose(DRIFT, truth[-1])
    closer = LoopCloser(load_config(overrides=[f"matcher={name}"]), create(name), Stopwatch())
    candidate = Candidate(first=5, variance_xy=2.0**2, variance_theta=math.radians(5.0) ** 2)
    loop = closer.match(candidate, keyframes_of(points, estimate))
    assert loop.reason == ""
    assert loop.relative == pytest.approx(between(truth[5], truth[-1]), abs=0.03)
    assert closer.ambiguity(loop, keyframes_of(points, estimate)) > 0.9


@pytest.mark.parametrize(
    ("half", "std", "found"),
    [(2.0, 2.0, True), (2.0, 0.6, False)],
    ids=["the graph is that unsure", "the graph is surer"],
)
def test_a_place_beyond_the_far_window_is_found_where_the_graph_is_unsure_of_more(
    half: float, std: float, found: bool, round_trip: tuple[Poses, list[Points]]
) -> None:
    truth, points = round_trip
    estimate = truth.copy()
    estimate[-1] = compose(DRIFT, truth[-1])
    window = [f"loops.far_window.half_x={half}", f"loops.far_window.half_y={half}"]
    closer = LoopCloser(load_config(overrides=window), create("hide"), Stopwatch())
    candidate = Candidate(first=5, variance_xy=std**2, variance_theta=math.radians(5.0) ** 2)
    loop = closer.match(candidate, keyframes_of(points, estimate))
    off = between(between(truth[5], truth[-1]), loop.relative)
    assert (math.hypot(off[0], off[1]) < 0.03) is found
