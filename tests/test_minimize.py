"""The searches on their own: `hsslam.search.minimize`."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import Bounds, OptimizeResult

from hsslam.errors import ConfigError
from hsslam.search import minimize
from hsslam.search.generations import Gray
from hsslam.search.minimize import METHODS
from hsslam.search.operators import Improvisations, evolve, partners, schedule
from hsslam.search.options import ImprovedHarmony
from hsslam.search.problem import Box

BOX = [(-5.0, 5.0), (-2.0, 8.0), (0.0, 4.0)]
CENTRE = np.array([1.0, 2.0, 3.0])
SEARCHES: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in METHODS),
    ("genetic", {"encoding": "real"}),
]


def sphere(x: NDArray[np.float64]) -> float:
    return float(((x - CENTRE) ** 2).sum())


def sphere_columns(x: NDArray[np.float64]) -> NDArray[np.float64]:
    squares: NDArray[np.float64] = ((x - CENTRE[:, None]) ** 2).sum(axis=0)
    return squares


@numba.njit  # type: ignore[untyped-decorator]
def compiled_sphere(x: NDArray[np.float64], shift: float) -> float:
    total = 0.0
    for i in range(x.shape[0]):
        total += (x[i] - shift) ** 2
    return total


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_finds_the_minimum_of_a_sphere(method: str, options: dict[str, Any]) -> None:
    found = minimize(sphere, BOX, method, maxfev=4000, seed=3, **options)
    assert found.fun < 0.05
    np.testing.assert_allclose(found.x, CENTRE, atol=0.25)
    assert found.fun == sphere(found.x)


@pytest.mark.parametrize("method", ["hide", "de-rand-to-best"])
def test_differential_steps_find_it_to_many_digits(method: str) -> None:
    assert minimize(sphere, BOX, method, maxfev=4000, seed=3).fun < 1e-12


@pytest.mark.parametrize(("method", "options"), SEARCHES)
@pytest.mark.parametrize("maxfev", [1, 29, 30, 31, 47, 500])
def test_spends_the_budget_and_stays_within_bounds(method: str, options: dict[str, Any], maxfev: int) -> None:
    seen = []

    def outward(x: NDArray[np.float64]) -> float:
        seen.append(x.copy())
        return -float(x.sum())

    found = minimize(outward, BOX, method, maxfev=maxfev, seed=1, **options)
    points = np.array(seen)
    assert len(points) == found.nfev == maxfev
    low, high = np.array(BOX).T
    assert (points >= low).all()
    assert (points <= high).all()
    assert found.fun == min(-points.sum(axis=1))


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_the_same_seed_gives_the_same_result(method: str, options: dict[str, Any]) -> None:
    first, again, other = (minimize(sphere, BOX, method, maxfev=300, seed=s, **options) for s in (7, 7, 8))
    np.testing.assert_array_equal(first.x, again.x)
    np.testing.assert_array_equal(first.population, again.population)
    assert not np.array_equal(first.x, other.x)
    given_rng = minimize(sphere, BOX, method, maxfev=300, rng=np.random.default_rng(7), **options)
    np.testing.assert_array_equal(first.x, given_rng.x)


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_a_vectorized_objective_gives_the_same(method: str, options: dict[str, Any]) -> None:
    one, many = (
        minimize(f, BOX, method, maxfev=500, seed=2, vectorized=v, **options)
        for f, v in ((sphere, False), (sphere_columns, True))
    )
    np.testing.assert_allclose(one.x, many.x, rtol=1e-9)
    assert one.nfev == many.nfev == 500


@pytest.mark.parametrize("method", list(METHODS))
def test_a_compiled_objective_works(method: str) -> None:
    found = minimize(compiled_sphere, [(-3.0, 3.0)] * 2, method, args=(0.5,), maxfev=2000)
    np.testing.assert_allclose(found.x, 0.5, atol=0.2)


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_the_result_is_shaped_like_scipys(method: str, options: dict[str, Any]) -> None:
    found = minimize(sphere, BOX, method, maxfev=400, history=True, **options)
    assert isinstance(found, OptimizeResult)
    assert found.success is True
    assert found.status == 0
    assert "400 evaluations" in found.message
    assert found.nit > 0
    size = 120 if method == "genetic" else 30
    assert found.population.shape == (size, 3)
    assert found.population_energies.shape == (size,)
    assert (np.diff(found.population_energies) >= 0.0).all()
    np.testing.assert_array_equal(found.population[0], found.x)
    assert [sphere(x) for x in found.population] == pytest.approx(found.population_energies)
    assert found.history.shape == (400,)
    assert (np.diff(found.history) <= 0.0).all()
    assert found.history[-1] == found.fun
    assert "history" not in minimize(sphere, BOX, method, maxfev=40, **options)


def test_scipys_bounds_are_taken_too() -> None:
    low, high = np.array(BOX).T
    one, two = (minimize(sphere, bounds, maxfev=200) for bounds in (BOX, Bounds(low, high)))
    np.testing.assert_array_equal(one.x, two.x)


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_a_variable_may_be_fixed(method: str, options: dict[str, Any]) -> None:
    found = minimize(sphere, [(0.0, 2.0), (1.5, 1.5), (0.0, 4.0)], method, maxfev=600, **options)
    assert found.x[1] == 1.5


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_the_start_is_the_first_member(method: str, options: dict[str, Any]) -> None:
    found = minimize(sphere, BOX, method, x0=CENTRE, maxfev=300, history=True, **options)
    assert found.history[0] == found.fun == 0.0


@pytest.mark.parametrize(("method", "options"), SEARCHES)
def test_stops_when_the_average_no_longer_changes(method: str, options: dict[str, Any]) -> None:
    found = minimize(lambda x: 1.0, BOX, method, maxfev=5000, patience=300, **options)
    assert 300 <= found.nfev < 800
    assert (found.status, found.success) == (1, True)
    assert "300 evaluations" in found.message


def test_a_tolerance_stops_earlier() -> None:
    exact, loose = (
        minimize(lambda x: 1.0 + sphere(x), BOX, "hide", maxfev=5000, patience=200, tolerance=t)
        for t in (0.0, 1e-6)
    )
    assert loose.nfev < exact.nfev
    assert loose.fun == pytest.approx(1.0, abs=1e-4)


def test_nan_is_never_preferred() -> None:
    def holed(x: NDArray[np.float64]) -> float:
        return math.nan if x[0] < 0.0 else sphere(x)

    found = minimize(holed, BOX, maxfev=2000)
    assert found.fun < 1e-3
    nothing = minimize(lambda x: math.nan, BOX, maxfev=100)
    assert not nothing.success
    assert "not finite" in nothing.message


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"method": "hid"}, "did you mean 'hide'"),
        ({"method": "annealing"}, "harmony, ihs, de"),
        ({"memory_sise": 40}, r"hide\.memory_sise: unknown setting; did you mean 'memory_size'"),
        ({"method": "de", "memory_size": 40}, r"de\.memory_size: unknown setting"),
        ({"memory_size": 2}, r"hide\.memory_size"),
        ({"bandwidth_min": 0.5}, "bandwidth_min is larger"),
        ({"bounds": [(1.0, 0.0)]}, r"bounds\[0\].*low <= high"),
        ({"bounds": [(0.0, math.inf)]}, r"bounds\[0\].*finite"),
        ({"bounds": []}, "low, high"),
        ({"bounds": [(1.0, 2.0), (3.0,)]}, "low, high"),
        ({"maxfev": 0}, "maxfev"),
        ({"maxfev": 10.5}, "maxfev"),
        ({"patience": 0}, "patience"),
        ({"x0": [0.0, 0.0]}, "x0: expected 3 numbers"),
        ({"x0": [9.0, 0.0, 0.0]}, "x0: expected a point within"),
        ({"seed": 1, "rng": np.random.default_rng(1)}, "not both"),
        ({"objective": lambda x: "low"}, "must return a number"),
        ({"objective": lambda x: x.sum(), "vectorized": True}, r"must return \(K,\)"),
    ],
)
def test_bad_input_gets_one_clear_line(changed: dict[str, Any], message: str) -> None:
    call: dict[str, Any] = {"objective": sphere, "bounds": BOX, **changed}
    with pytest.raises(ConfigError, match=message) as caught:
        minimize(**call)
    assert "\n" not in str(caught.value)


def test_pitch_adjustment_and_bandwidth_follow_equations_2_and_3() -> None:
    rates, bandwidths = schedule(ImprovedHarmony(), np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(rates, [0.55, 0.765, 0.98])
    np.testing.assert_allclose(bandwidths * 30.0, [8.0, math.sqrt(8.0 * 0.2), 0.2])


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32), size=st.integers(3, 12))
def test_partners_differ_from_the_target_and_from_each_other(seed: int, size: int) -> None:
    first, second = partners(size, np.random.default_rng(seed))
    for target, pair in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        assert len({target, *pair}) == 3
        assert all(0 <= each < size for each in pair)


def test_partners_are_uniform() -> None:
    rng = np.random.default_rng(0)
    counts = np.zeros((4, 4))
    for _ in range(3000):
        first, second = partners(4, rng)
        counts[0, first[0]] += 1
        counts[1, second[0]] += 1
    np.testing.assert_allclose(counts[:2, 1:] / 3000, 1.0 / 3.0, atol=0.04)


def test_harmonies_come_from_the_memory_or_the_box() -> None:
    box = Box.of(BOX)
    rng = np.random.default_rng(0)
    memory = box.draw(5, rng)
    none, one = np.zeros(50), np.ones(50)
    kept = Improvisations.draw(box, 5, 1.0, none, one, rng)
    for k in range(50):
        assert (kept.improvise(k, memory) == memory).any(axis=0).all()
    near = Improvisations.draw(box, 5, 1.0, one, np.full(50, 0.01), rng)
    for k in range(50):
        distance = np.abs(near.improvise(k, memory) - memory).min(axis=0)
        assert (distance <= 0.01 * box.span + 1e-12).all()
        assert (distance > 0.0).any()
    fresh = Improvisations.draw(box, 5, 0.0, one, one, rng)
    assert not np.isin(fresh.improvise(0, memory), memory).any()


def test_without_crossover_one_variable_is_the_mutants() -> None:
    box = Box.of([(-1.0, 1.0)] * 6)
    rng = np.random.default_rng(0)
    members = box.draw(8, rng)
    trials = evolve(members, members, 0.3, 0.0, box, rng)
    assert ((trials != members).sum(axis=1) == 1).all()


@settings(deadline=None, max_examples=20)
@given(bits=st.integers(2, 40), share=st.floats(0.0, 1.0))
def test_gray_codes_round_trip(bits: int, share: float) -> None:
    box = Box.of([(-3.0, 5.0), (0.0, 1.0)])
    points = box.low[None] + share * box.span
    code = Gray(box, bits)
    genes = code.encode(points)
    assert genes.shape == (1, 2 * bits)
    np.testing.assert_allclose(code.decode(genes), points, atol=8.0 / (2**bits - 1))


def test_neighbouring_gray_codes_differ_in_a_bit() -> None:
    box = Box.of([(0.0, 31.0)])
    genes = Gray(box, 5).encode(np.arange(32.0)[:, None])
    assert (np.abs(np.diff(genes.astype(int), axis=0)).sum(axis=1) == 1).all()
