"""The searches of `hsslam.search.minimize`: from a problem and options to a last population."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from hsslam.search.operators import Improvisations, attracted, evolve, schedule
from hsslam.search.options import BestEvolution, Evolution, Harmony, Hide, ImprovedHarmony, SimpleEvolution
from hsslam.search.problem import Floats, Problem

Outcome: TypeAlias = tuple[Floats, Floats, int]
"""Last population (M, N), its energies (M,), iterations."""

_BATCH = 128
"""Improvisations whose random numbers are drawn together."""


def harmony_search(problem: Problem, options: Harmony, rng: np.random.Generator) -> Outcome:
    """Harmony search with fixed PAR and BW (paper, section 3); an iteration is an improvisation."""
    memory, energies = problem.fill(options.memory_size, rng)
    iterations = 0
    while not problem.done(energies):
        count = min(_BATCH, problem.left)
        rates, bandwidths = np.full(count, options.pitch_adjusting_rate), np.full(count, options.bandwidth)
        batch = Improvisations.draw(
            problem.box, len(memory), options.memory_considering_rate, rates, bandwidths, rng
        )
        iterations += _play(problem, batch, memory, energies)
    return memory, energies, iterations


def improved_harmony_search(problem: Problem, options: ImprovedHarmony, rng: np.random.Generator) -> Outcome:
    """Harmony search with rising PAR and falling BW (paper, equations 2 and 3); NI is what the budget leaves."""
    memory, energies = problem.fill(options.memory_size, rng)
    improvisations = problem.left
    iterations = 0
    while not problem.done(energies):
        batch = _scheduled(problem, options, improvisations, min(_BATCH, problem.left), len(memory), rng)
        iterations += _play(problem, batch, memory, energies)
    return memory, energies, iterations


def simple_evolution(problem: Problem, options: SimpleEvolution, rng: np.random.Generator) -> Outcome:
    """Differential evolution by equation 11; an iteration is a generation."""
    return _evolution(problem, options, lambda members, _: options.base_factor * members, rng)


def best_evolution(problem: Problem, options: BestEvolution, rng: np.random.Generator) -> Outcome:
    """DE/rand-to-best/1, equation 12; an iteration is a generation."""
    return _evolution(
        problem, options, lambda members, best: attracted(members, best, options.attraction), rng
    )


def hide(problem: Problem, options: Hide, rng: np.random.Generator) -> Outcome:
    """HIDE (paper, section 5.2 and Fig. 5); an iteration is a harmony run and a differential step.

    Equation 12 is read to the letter: x_best is the best of the memory at the step's beginning, and all harmonies
    of a step are made from the memory as it was then. The matcher's kernel lets a harmony that improved serve the
    next one at once.
    """
    memory, energies = problem.fill(options.memory_size, rng)
    budget = problem.left
    iterations = 0
    while not problem.done(energies):
        count = min(options.harmony_run, problem.left)
        if count:
            _play(problem, _scheduled(problem, options, budget, count, len(memory), rng), memory, energies)
        iterations += 1
        if problem.left and not problem.stalled:
            bases = attracted(memory, int(np.argmin(energies)), options.attraction)
            trials = evolve(memory, bases, options.weight, options.crossover_rate, problem.box, rng)
            _select(memory, energies, trials, problem.many(trials))
    return memory, energies, iterations


def _scheduled(
    problem: Problem,
    options: ImprovedHarmony,
    budget: int,
    count: int,
    memory_size: int,
    rng: np.random.Generator,
) -> Improvisations:
    gone = budget - problem.left
    rates, bandwidths = schedule(options, np.arange(gone, gone + count) / budget)
    return Improvisations.draw(
        problem.box, memory_size, options.memory_considering_rate, rates, bandwidths, rng
    )


def _play(problem: Problem, batch: Improvisations, memory: Floats, energies: Floats) -> int:
    """Improvise; what beats the memory's worst takes its place (paper, section 3, step 4). How many were made."""
    worst = int(np.argmax(energies))
    count = len(batch.kept)
    for k in range(count):
        harmony = batch.improvise(k, memory)
        energy = problem.one(harmony)
        if energy < energies[worst]:
            memory[worst] = harmony
            energies[worst] = energy
            worst = int(np.argmax(energies))
        if problem.done(energies):
            return k + 1
    return count


def _evolution(
    problem: Problem,
    options: Evolution,
    bases: Callable[[Floats, int], Floats],
    rng: np.random.Generator,
) -> Outcome:
    members, energies = problem.fill(options.population_size, rng)
    iterations = 0
    while not problem.done(energies):
        based = bases(members, int(np.argmin(energies)))
        trials = evolve(members, based, options.weight, options.crossover_rate, problem.box, rng)
        _select(members, energies, trials, problem.many(trials))
        iterations += 1
    return members, energies, iterations


def _select(members: Floats, energies: Floats, trials: Floats, found: Floats) -> None:
    """Keep each trial that beats its own parent (paper, section 5.1.1); the last may lack for want of budget."""
    better = np.flatnonzero(found < energies[: len(found)])
    members[better] = trials[better]
    energies[better] = found[better]
