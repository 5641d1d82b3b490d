"""HIDE: harmony memory improved by differential evolution (paper, section 5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.fitness import evaluate, scale, scratch
from hsslam.kernels.random import below, seeded, uniform
from hsslam.se2 import Points, Pose, Poses
from hsslam.search.batch import part
from hsslam.search.harmony import fill_memory, improvise, narrowing, record


@kernel
def evolve(
    memory: NDArray[np.float64],
    target: int,
    best: int,
    guess: Pose,
    half: NDArray[np.float64],
    attraction: float,
    weight: float,
    crossover_rate: float,
    state: NDArray[np.uint64],
    out: NDArray[np.float64],
) -> None:
    """Make the trial vector of one member (paper, equation 12: DE/rand-to-best/1); into ``out`` (3,).

    ``x + lambda (best - x) + F (r1 - r2)`` with two members that differ from each other and from ``x``, then
    binomial crossover with ``x``: at least one variable is the mutant's. Clipped to the window.
    """
    size = memory.shape[0]
    first = below(state, size - 1)
    if first >= target:
        first += 1
    second = below(state, size - 2)
    if second >= min(first, target):
        second += 1
    if second >= max(first, target):
        second += 1
    forced = below(state, 3)
    for d in range(3):
        value = memory[target, d]
        if d == forced or uniform(state) < crossover_rate:
            value += attraction * (memory[best, d] - value) + weight * (memory[first, d] - memory[second, d])
        out[d] = min(max(value, guess[d] - half[d]), guess[d] + half[d])


@kernel
def hide_search(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    scaled: NDArray[np.float32],
    count: int,
    guess: Pose,
    half: NDArray[np.float64],
    memory_size: int,
    memory_considering_rate: float,
    pitch_adjusting_rates: tuple[float, float],
    bandwidth_min: NDArray[np.float64],
    bandwidth_max: NDArray[np.float64],
    budget: int,
    harmony_run: int,
    attraction: float,
    weight: float,
    crossover_rate: float,
    patience: int,
    seed: int,
    trace: NDArray[np.float64],
) -> tuple[Pose, int, int]:
    """Search the window for the pose with most hits (paper: HIDE, Fig. 5).

    ``harmony_run`` improvisations, then a differential step of every harmony in turn, and so on until
    ``budget`` evaluations are spent. Pitch adjustment and bandwidth follow the share of the budget spent.

    Parameters
    ----------
    cells, frame, scaled, count, guess, half, memory_size, memory_considering_rate, pitch_adjusting_rates, \
bandwidth_min, bandwidth_max, patience, seed, trace
        As for `hsslam.search.harmony.harmony_search`.
    budget : int
        NFE: evaluations after the memory was filled.
    harmony_run : int
        HRT: improvisations between two differential steps.
    attraction : float
        lambda: pull towards the best harmony.
    weight : float
        F: weight of the difference of two harmonies.
    crossover_rate : float
        Share of variables taken from the mutant.

    Returns
    -------
    (Pose, int, int)
        Best harmony, its hits, and how often the fitness was evaluated, the memory's filling included.
    """
    flat, index, state = cells.reshape(cells.size), scratch(), seeded(seed)
    xs, ys, facing = scaled[0], scaled[1], scaled[2]
    memory = np.empty((memory_size, 3))
    hits = np.empty(memory_size, dtype=np.int64)
    fill_memory(cells, frame, scaled, count, guess, half, index, state, memory, hits, trace)
    candidate = np.empty(3)
    shrink = narrowing(bandwidth_min, bandwidth_max, budget)
    par_min, par_max = pitch_adjusting_rates
    idle = spent = 0
    while spent < budget and not 0 < patience <= idle:
        worst = int(np.argmin(hits))
        bandwidth = bandwidth_max * shrink**spent
        for _ in range(min(harmony_run, budget - spent)):
            rate = par_min + (par_max - par_min) * spent / budget
            improvise(memory, guess, half, memory_considering_rate, rate, bandwidth, state, candidate)
            x, y, theta = candidate
            found = evaluate(
                flat, cells.shape, frame, xs, ys, facing, count, x, y, theta, hits[worst] + 1, index
            )
            for d in range(3):
                bandwidth[d] *= shrink[d]
            spent += 1
            idle += 1
            if found > hits[worst]:
                memory[worst] = candidate
                hits[worst] = found
                worst = int(np.argmin(hits))
                idle = 0
            if memory_size + spent - 1 < trace.shape[0]:
                record(trace, memory_size + spent - 1, memory, hits)
        best = int(np.argmax(hits))
        for target in range(min(memory_size, budget - spent)):
            evolve(memory, target, best, guess, half, attraction, weight, crossover_rate, state, candidate)
            x, y, theta = candidate
            found = evaluate(
                flat, cells.shape, frame, xs, ys, facing, count, x, y, theta, hits[target] + 1, index
            )
            spent += 1
            idle += 1
            if found > hits[target]:
                memory[target] = candidate
                hits[target] = found
                idle = 0
                if found > hits[best]:
                    best = target
            if memory_size + spent - 1 < trace.shape[0]:
                record(trace, memory_size + spent - 1, memory, hits)
    best = int(np.argmax(hits))
    return memory[best].copy(), hits[best], memory_size + spent


@kernel
def hide_search_all(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    ends: NDArray[np.int64],
    guesses: Poses,
    most: int,
    half: NDArray[np.float64],
    memory_size: int,
    memory_considering_rate: float,
    pitch_adjusting_rates: tuple[float, float],
    bandwidth_min: NDArray[np.float64],
    bandwidth_max: NDArray[np.float64],
    budget: int,
    harmony_run: int,
    attraction: float,
    weight: float,
    crossover_rate: float,
    patience: int,
    seeds: NDArray[np.int64],
) -> tuple[Poses, NDArray[np.int64]]:
    """`hide_search` for each scan of a batch; see `hsslam.search.harmony.harmony_search_all`."""
    found, spent, trace = np.empty_like(guesses), np.empty_like(ends), np.empty((0, 4))
    for i in range(ends.shape[0]):
        scan = part(points, ends, i)
        count = min(most, scan.shape[0])
        found[i], _, spent[i] = hide_search(
            cells,
            frame,
            scale(scan, part(lines, ends, i), frame, count),
            count,
            guesses[i],
            half,
            memory_size,
            memory_considering_rate,
            pitch_adjusting_rates,
            bandwidth_min,
            bandwidth_max,
            budget,
            harmony_run,
            attraction,
            weight,
            crossover_rate,
            patience,
            seeds[i],
            trace,
        )
    return found, spent
