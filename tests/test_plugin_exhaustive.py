"""The exhaustive search finds what brute force finds, and nothing in the window is above its bound."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.errors import ConfigError
from hsslam.kernels.correlative import SIDES, pool
from hsslam.kernels.fitness import count_hits
from hsslam.matching import Pose, SearchWindow, create
from hsslam.search.exhaustive import ExhaustiveReference, cell_turn, lattice_search, window_search
from hsslam.search.fitness import HitFitness
from hsslam.search.fitness_functions import fitness_names

NAMES = [name for name in fitness_names() if name != "sides"]
WINDOW = SearchWindow(0.15, 0.1, np.radians(4.0))


def worth_at(fitness: HitFitness, pose: Pose) -> float:
    hits = count_hits(fitness.cells, fitness.frame, fitness.xs, fitness.ys, pose[0], pose[1], pose[2], 0)
    return fitness.share(hits)


def lattice_of(fitness: HitFitness, guess: Pose) -> NDArray[np.float64]:
    steps = np.array([1.0 / fitness.frame[2], 1.0 / fitness.frame[2], cell_turn(fitness)])
    counts = np.floor(WINDOW.half / steps + 1e-9)
    axes = [guess[d] + np.arange(-counts[d], counts[d] + 1) * steps[d] for d in range(3)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)


@settings(deadline=None, max_examples=30)
@given(st.integers(3, 70), st.integers(3, 70), st.integers(0, 1000))
def test_pooled_maxima_are_the_maxima_of_squares(rows: int, columns: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = (rng.random((rows, columns)) ** 40 * 255).astype(np.uint8)
    pooled = pool(cells, np.array(SIDES))
    for row, column in rng.integers((0, 0), (rows, columns), (20, 2)):
        expected = [cells[row : row + side, column : column + side].max() for side in SIDES]
        assert pooled[:, row, column].tolist() == expected


@pytest.mark.parametrize("name", NAMES)
def test_the_best_of_the_lattice_is_what_brute_force_finds(room_pair, name) -> None:
    first, second, truth = room_pair
    reference = ExhaustiveReference(first, name, 0.03, 0.025)
    fitness = reference.fitness_of(second)
    for offset in np.random.default_rng(3).uniform(-0.1, 0.1, (4, 3)):
        guess = truth + offset
        found = lattice_search(reference, fitness, guess, WINDOW)
        poses = lattice_of(fitness, guess)
        every = np.array([worth_at(fitness, pose) for pose in poses])
        assert np.abs(poses - found.pose).max(axis=1).min() < 1e-9
        # Whole cells are added to rounded sums in one, and rounded with them in the other.
        assert found.fitness == pytest.approx(every.max(), abs=1.01 / len(second))
        assert worth_at(fitness, found.pose) == pytest.approx(found.fitness, abs=1.01 / len(second))
        assert found.evaluations < len(poses)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_worth_less_than_asked_for_is_not_looked_for(room_pair, name) -> None:
    first, second, truth = room_pair
    reference = ExhaustiveReference(first, name, 0.03, 0.025)
    fitness = reference.fitness_of(second)
    guess = truth + (0.05, -0.03, 0.02)
    every = lattice_search(reference, fitness, guess, WINDOW)
    same = lattice_search(reference, fitness, guess, WINDOW, least=every.fitness - 1e-9)
    assert same.pose.tolist() == every.pose.tolist()
    assert (same.fitness, same.bound) == (every.fitness, every.bound)
    assert same.evaluations <= every.evaluations
    none = lattice_search(reference, fitness, guess, WINDOW, least=every.fitness + 1e-3)
    assert none.pose == pytest.approx(guess)
    assert none.fitness == 0.0
    assert every.fitness < none.bound < every.fitness + 0.01
    assert none.evaluations <= same.evaluations


@pytest.mark.parametrize("name", NAMES)
def test_no_pose_of_the_window_is_above_the_bound(room_pair, name) -> None:
    first, second, truth = room_pair
    reference = ExhaustiveReference(first, name, 0.03, 0.025)
    fitness = reference.fitness_of(second)
    rng = np.random.default_rng(4)
    for offset in rng.uniform(-0.1, 0.1, (3, 3)):
        guess = truth + offset
        proof = window_search(reference, fitness, guess, WINDOW, 0.0, 300_000)
        assert WINDOW.contains(guess, proof.pose)
        assert proof.fitness == worth_at(fitness, proof.pose)
        assert proof.fitness >= lattice_search(reference, fitness, guess, WINDOW).fitness - 1e-9
        assert 0.0 <= proof.bound - proof.fitness < 1.01 / len(second)
        anywhere = guess + rng.uniform(-WINDOW.half, WINDOW.half, (3000, 3))
        around = proof.pose + rng.normal(0.0, (0.003, 0.003, 0.001), (6000, 3))
        inside = [pose for pose in (*anywhere, *around) if WINDOW.contains(guess, pose, 0.0)]
        assert max(worth_at(fitness, pose) for pose in inside) <= proof.fitness


def test_a_proof_given_up_says_so(room_pair) -> None:
    first, second, truth = room_pair
    matcher = create("exhaustive", {"budget": 1, "refine": False})
    guess = truth + (0.05, 0.02, 0.01)
    result = matcher.match(matcher.prepare(first), second, guess, WINDOW, np.random.default_rng(0))
    assert result.diagnostics["proven"] is False
    assert result.diagnostics["fitness_bound"] > result.diagnostics["fitness"] + 0.005


@pytest.mark.parametrize("fitness", NAMES)
def test_no_search_is_above_it(room_pair, fitness) -> None:
    first, second, truth = room_pair
    settings_ = {"fitness": fitness, "refine": False, "half_side": 0.03}
    found = {}
    for name in ("hide", "exhaustive"):
        matcher = create(name, settings_)
        result = matcher.match(matcher.prepare(first), second, truth + 0.02, WINDOW, np.random.default_rng(0))
        found[name] = result.diagnostics["fitness"]
    assert found["exhaustive"] >= found["hide"] - 0.005
    assert found["exhaustive"] > 0.8


def test_a_wide_window_is_searched_whole(room_pair) -> None:
    first, second, truth = room_pair
    window = SearchWindow(1.0, 1.0, np.radians(45.0))
    matcher = create("exhaustive")
    guess = truth + (0.8, -0.7, 0.6)
    result = matcher.match(matcher.prepare(first), second, guess, window, np.random.default_rng(0))
    assert result.diagnostics["proven"]
    assert result.pose == pytest.approx(truth, abs=0.01)


def test_a_window_of_one_pose(room_pair) -> None:
    first, second, truth = room_pair
    window = SearchWindow(0.0, 0.0, 0.0)
    for proof in ("window", "lattice"):
        matcher = create("exhaustive", {"proof": proof, "refine": False})
        result = matcher.match(matcher.prepare(first), second, truth, window, np.random.default_rng(0))
        assert result.pose == pytest.approx(truth)


def test_settings_that_make_no_sense() -> None:
    with pytest.raises(ConfigError, match="proof"):
        create("exhaustive", {"proof": "vague"})
    with pytest.raises(ConfigError, match="tolerance"):
        create("exhaustive", {"tolerance": -0.1})


def test_of_sides_nothing_is_proven(room_pair) -> None:
    with pytest.raises(ConfigError, match="'sides': an exhaustive search knows no sides; choose 'surface'"):
        create("exhaustive", {"fitness": "sides"}).prepare(room_pair[0])
