"""Population searches: what they find, what they spend, what they repeat."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.kernels.random import seeded
from hsslam.matching import SearchWindow, create
from hsslam.search import HitFitness
from hsslam.search.genetic import decode, encode
from hsslam.search.harmony import improvise
from hsslam.search.hide import evolve

WINDOW = SearchWindow(0.15, 0.15, math.radians(10.0))
POPULATION = ["hsl", "hide", "glasm"]
Pair = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


@pytest.mark.parametrize("name", POPULATION)
def test_finds_the_pose_from_the_edge_of_the_window(name: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    matcher = create(name)
    guess = truth + [0.13, -0.13, math.radians(8.0)]
    result = matcher.match(matcher.prepare(reference), scan, guess, WINDOW, np.random.default_rng(0))
    assert np.hypot(*(result.pose - truth)[:2]) < 0.06
    assert abs(result.pose[2] - truth[2]) < math.radians(2.0)


@pytest.mark.parametrize(
    ("name", "parameters", "evaluations"),
    [
        ("hsl", {}, 280),
        ("hsl", {"improvisations": 10, "memory_size": 5}, 15),
        ("hide", {}, 250),
        ("hide", {"evaluations": 77, "memory_size": 8}, 85),
        ("glasm", {}, 1440),
    ],
)
def test_spends_the_published_budget(
    name: str, parameters: dict[str, Any], evaluations: int, room_pair: Pair
) -> None:
    reference, scan, truth = room_pair
    matcher = create(name, parameters)
    result = matcher.match(matcher.prepare(reference), scan, truth, WINDOW, np.random.default_rng(0))
    assert result.evaluations == evaluations


@pytest.mark.parametrize("name", POPULATION)
def test_never_finds_less_than_the_guess_has(name: str, room_pair: Pair) -> None:
    """The first harmony is the guess itself (paper, equation 5); a chromosome rounds it to its code."""
    reference, scan, truth = room_pair
    matcher = create(name, {"refine": False})
    prepared = matcher.prepare(reference)
    tiny = SearchWindow(1e-6, 1e-6, 1e-6)
    at_truth = matcher.match(prepared, scan, truth, tiny, np.random.default_rng(0)).diagnostics["fitness"]
    for seed in range(5):
        found = matcher.match(prepared, scan, truth, WINDOW, np.random.default_rng(seed))
        assert found.diagnostics["fitness"] >= at_truth - 1e-12


@pytest.mark.parametrize("name", POPULATION)
def test_another_seed_finds_another_pose(name: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    matcher = create(name, {"refine": False})
    prepared = matcher.prepare(reference)
    guess = truth + [0.05, 0.05, 0.05]
    poses = {
        tuple(matcher.match(prepared, scan, guess, WINDOW, np.random.default_rng(s)).pose) for s in range(3)
    }
    assert len(poses) == 3


def test_refinement_beats_the_search_alone(room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    errors = {}
    for refine in (False, True):
        matcher = create("hide", {"refine": refine})
        prepared = matcher.prepare(reference)
        found = [
            matcher.match(prepared, scan, truth + [0.05, 0.05, 0.05], WINDOW, np.random.default_rng(s)).pose
            for s in range(10)
        ]
        errors[refine] = np.mean([np.hypot(*(pose - truth)[:2]) for pose in found])
    assert errors[True] < 0.5 * errors[False]


@pytest.mark.parametrize("name", ["hsl", "hide"])
def test_a_truth_just_outside_the_window_is_refined_onto_its_edge(name: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    matcher = create(name)
    prepared = matcher.prepare(reference)
    for seed in range(5):
        guess = truth - [1.1 * WINDOW.half_x, 0.04, 0.05]
        result = matcher.match(prepared, scan, guess, WINDOW, np.random.default_rng(seed))
        assert result.pose[0] == pytest.approx(guess[0] + WINDOW.half_x)
        assert result.pose[1:] == pytest.approx(truth[1:], abs=0.005)


@given(st.integers(2, 20), st.floats(-1.0, 1.0))
@settings(deadline=None, max_examples=50)
def test_gray_code_round_trip(bits: int, share: float) -> None:
    step = 2.0 / ((1 << bits) - 1)
    code = encode(3.0 + share, bits, 3.0, 1.0)
    assert 0 <= code < 1 << bits
    assert decode(code, bits, 3.0, 1.0) == pytest.approx(3.0 + share, abs=0.5 * step + 1e-9)


def test_gray_codes_of_neighbours_differ_in_one_bit() -> None:
    values = np.linspace(-1.0, 1.0, 32)
    codes = [encode(v, 5, 0.0, 1.0) for v in values]
    assert all((a ^ b).bit_count() == 1 for a, b in pairwise(codes))


def test_improvisation_stays_in_the_window_and_uses_the_memory() -> None:
    rng, state = np.random.default_rng(1), seeded(1)
    guess, half = np.array([1.0, 2.0, 0.5]), np.array([0.1, 0.2, 0.3])
    memory = guess + rng.uniform(-1, 1, (30, 3)) * half
    out = np.empty(3)
    from_memory = 0
    for _ in range(2000):
        improvise(memory, guess, half, 0.88, 0.0, np.full(3, 5.0), state, out)
        assert (np.abs(out - guess) <= half + 1e-12).all()
        from_memory += out[0] in memory[:, 0]
    assert from_memory / 2000 == pytest.approx(0.88, abs=0.03)
    improvise(memory, guess, half, 1.0, 1.0, np.full(3, 100.0), state, out)
    assert (np.abs(out - guess) <= half + 1e-12).all()


def test_differential_step_follows_equation_12() -> None:
    """With F = 0 and every variable crossed over, the trial is x + lambda (best - x)."""
    rng, state = np.random.default_rng(2), seeded(2)
    guess, half = np.zeros(3), np.ones(3)
    memory = rng.uniform(-1, 1, (6, 3))
    out = np.empty(3)
    evolve(memory, 2, 4, guess, half, 0.7, 0.0, 1.0, state, out)
    assert out == pytest.approx(memory[2] + 0.7 * (memory[4] - memory[2]))
    for _ in range(300):
        evolve(memory, 2, 4, guess, half, 0.0, 1.0, 1.0, state, out)
        steps = [memory[a] - memory[b] for a in range(6) for b in range(6) if len({a, b, 2}) == 3]
        expected = [np.clip(memory[2] + step, -1.0, 1.0) for step in steps]
        assert min(np.abs(out - e).max() for e in expected) < 1e-12


@pytest.mark.parametrize("name", POPULATION)
def test_trace_never_falls_and_ends_at_the_answer(name: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    matcher = create(name)
    fitness = HitFitness.of(matcher.prepare(reference).raster, scan)
    _, _, evaluations = matcher.search(fitness, truth, WINDOW, np.random.default_rng(3))
    trace = np.full((evaluations, 4), np.nan)
    pose, hits, _ = matcher.search(fitness, truth, WINDOW, np.random.default_rng(3), trace)
    assert (np.diff(trace[:, 3]) >= 0).all()
    assert trace[-1, 3] == hits
    assert (trace[-1, :3] == pose).all()


@pytest.mark.parametrize(("name", "budget"), [("hsl", "improvisations"), ("hide", "evaluations")])
def test_patience_ends_a_search_that_changes_nothing(name: str, budget: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    matcher = create(name, {budget: 20_000, "patience": 100})
    result = matcher.match(matcher.prepare(reference), scan, truth, WINDOW, np.random.default_rng(1))
    assert 130 <= result.evaluations < 10_000
    assert np.hypot(*(result.pose - truth)[:2]) < 0.03


@pytest.mark.parametrize("fitness", ["paper", "surface", "sides", "likelihood"])
@pytest.mark.parametrize("name", POPULATION)
def test_every_fitness_serves_every_search(name: str, fitness: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    matcher = create(name, {"fitness": fitness, "refine": False})
    prepared = matcher.prepare(reference)
    result = matcher.match(prepared, scan, truth + [0.08, -0.08, 0.08], WINDOW, np.random.default_rng(2))
    assert 0.0 < result.diagnostics["fitness"] <= 1.0
    assert np.hypot(*(result.pose - truth)[:2]) < 0.08


def along(*corners: tuple[float, float]) -> np.ndarray:
    """Returns every 2 cm from one corner to the next, with 5 mm of noise."""
    legs = [np.linspace(p, q, int(math.dist(p, q) / 0.02)) for p, q in pairwise(corners)]
    places = np.vstack(legs)
    return places + np.random.default_rng(len(places)).normal(0.0, 0.005, places.shape)


@pytest.mark.parametrize("name", ["hsl", "hide"])
def test_past_a_door_the_wall_behind_is_not_taken_for_its_front(name: str) -> None:
    """Of a wall of 16 cm the robot has seen one side; the other, new, would hit it: more than fits where it is."""
    before = np.vstack(
        (along((-3.0, -1.0), (0.0, -1.0), (0.0, -0.45), (0.16, -0.45)), along((2.5, -1.0), (5.0, -1.0)),
         along((4.0, 0.6), (4.0, 0.9)), along((0.16, 0.45), (0.0, 0.45), (0.0, 1.0), (-3.0, 1.0)))
    )  # fmt: skip
    past = np.vstack(
        (along((0.16, -0.45), (0.16, -1.0), (5.0, -1.0)), along((4.0, 0.6), (4.0, 0.9)),
         along((3.0, 1.0), (0.16, 1.0), (0.16, 0.45)))
    )  # fmt: skip
    window = SearchWindow(0.25, 0.25, math.radians(10.0))
    for parameters, found_there in (({}, True), ({"fitness": "surface"}, False)):
        matcher = create(name, parameters)
        reference = matcher.prepare(before)
        for seed in range(5):
            result = matcher.match(reference, past, np.zeros(3), window, np.random.default_rng(seed))
            assert (np.hypot(*result.pose[:2]) < 0.02) == found_there


@pytest.mark.parametrize("name", ["hsl", "hide"])
def test_a_wide_window_is_searched_wider(name: str, room_pair: Pair) -> None:
    reference, scan, truth = room_pair
    wide = SearchWindow(1.0, 1.0, math.radians(45.0))
    matcher = create(name)
    prepared = matcher.prepare(reference)
    rng = np.random.default_rng(5)
    errors = []
    for seed in range(20):
        guess = truth + rng.uniform(-1.0, 1.0, 3) * wide.half
        result = matcher.match(prepared, scan, guess, wide, np.random.default_rng(seed))
        errors.append(np.hypot(*(result.pose - truth)[:2]))
    assert np.mean(np.array(errors) < 0.05) >= 0.9
