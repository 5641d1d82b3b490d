"""Harmony search with varying pitch adjustment and bandwidth (paper, sections 3 and 4; IHS, equations 2 and 3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.fitness import evaluate, scale, scratch
from hsslam.kernels.random import below, seeded, uniform
from hsslam.se2 import Points, Pose, Poses
from hsslam.search.batch import part


@kernel
def improvise(
    memory: NDArray[np.float64],
    guess: Pose,
    half: NDArray[np.float64],
    memory_considering_rate: float,
    pitch_adjusting_rate: float,
    bandwidth: NDArray[np.float64],
    state: NDArray[np.uint64],
    out: NDArray[np.float64],
) -> None:
    """Make a new harmony (paper, Algorithm 1 and equations 7 and 8); into ``out`` (3,).

    Each variable is taken from a random harmony with probability HMCR, and then moved by up to a bandwidth
    either way with probability PAR; else it is drawn from the whole window. The result is clipped to the window.
    """
    for d in range(3):
        if uniform(state) <= memory_considering_rate:
            value = memory[below(state, memory.shape[0]), d]
            if uniform(state) <= pitch_adjusting_rate:
                value += (2.0 * uniform(state) - 1.0) * bandwidth[d]
        else:
            value = guess[d] + (2.0 * uniform(state) - 1.0) * half[d]
        out[d] = min(max(value, guess[d] - half[d]), guess[d] + half[d])


@kernel
def narrowing(
    bandwidth_min: NDArray[np.float64], bandwidth_max: NDArray[np.float64], budget: int
) -> NDArray[np.float64]:
    """By what the bandwidths shrink with every evaluation (paper, equation 3, step by step), (3,)."""
    return (bandwidth_min / bandwidth_max) ** (1.0 / budget)


@kernel
def record(
    trace: NDArray[np.float64], evaluation: int, memory: NDArray[np.float64], hits: NDArray[np.int64]
) -> None:
    """Write the best harmony and its hits to a row of the trace."""
    best = int(np.argmax(hits))
    trace[evaluation, :3] = memory[best]
    trace[evaluation, 3] = hits[best]


@kernel
def fill_memory(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    scaled: NDArray[np.float32],
    count: int,
    guess: Pose,
    half: NDArray[np.float64],
    index: NDArray[np.uint32],
    state: NDArray[np.uint64],
    memory: NDArray[np.float64],
    hits: NDArray[np.int64],
    trace: NDArray[np.float64],
) -> None:
    """Fill the memory: the guess itself, then harmonies uniform in the window (paper, equations 1, 5 and 6)."""
    flat, xs, ys, facing = cells.reshape(cells.size), scaled[0], scaled[1], scaled[2]
    for i in range(memory.shape[0]):
        for d in range(3):
            offset = 0.0 if i == 0 else (2.0 * uniform(state) - 1.0) * half[d]
            memory[i, d] = guess[d] + offset
        hits[i] = evaluate(
            flat,
            cells.shape,
            frame,
            xs,
            ys,
            facing,
            count,
            memory[i, 0],
            memory[i, 1],
            memory[i, 2],
            0,
            index,
        )
        if i < trace.shape[0]:
            record(trace, i, memory, hits[: i + 1])


@kernel
def harmony_search(
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
    improvisations: int,
    patience: int,
    seed: int,
    trace: NDArray[np.float64],
) -> tuple[Pose, int, int]:
    """Search the window for the pose with most hits (paper: HSL).

    Parameters
    ----------
    cells, frame, scaled, count
        Of a `HitFitness`.
    guess : Pose
        Centre of the window and first harmony.
    half : float64 (3,)
        Half sides of the window (m, m, rad).
    memory_size : int
        HMS.
    memory_considering_rate : float
        HMCR.
    pitch_adjusting_rates : (float, float)
        PAR_min and PAR_max (equation 2).
    bandwidth_min, bandwidth_max : float64 (3,)
        BW_min and BW_max (equation 3; m, m, rad).
    improvisations : int
        NI.
    patience : int
        The search ends after this many improvisations in a row that did not enter the memory, whose average
        fitness then has not changed (paper, section 4.4); 0 to use up NI in any case.
    seed : int
        Of every random choice; at least 0.
    trace : float64 (E, 4)
        Filled with the best pose and its hits after each of the first E evaluations; E may be 0.

    Returns
    -------
    (Pose, int, int)
        Best harmony, its hits, and how often the fitness was evaluated.
    """
    flat, index, state = cells.reshape(cells.size), scratch(), seeded(seed)
    xs, ys, facing = scaled[0], scaled[1], scaled[2]
    memory = np.empty((memory_size, 3))
    hits = np.empty(memory_size, dtype=np.int64)
    fill_memory(cells, frame, scaled, count, guess, half, index, state, memory, hits, trace)
    candidate = np.empty(3)
    bandwidth, shrink = bandwidth_max.copy(), narrowing(bandwidth_min, bandwidth_max, improvisations)
    worst = int(np.argmin(hits))
    par_min, par_max = pitch_adjusting_rates
    idle = spent = 0
    for t in range(improvisations):
        if 0 < patience <= idle:
            break
        rate = par_min + (par_max - par_min) * t / improvisations
        improvise(memory, guess, half, memory_considering_rate, rate, bandwidth, state, candidate)
        x, y, theta = candidate
        found = evaluate(flat, cells.shape, frame, xs, ys, facing, count, x, y, theta, hits[worst] + 1, index)
        if found > hits[worst]:
            memory[worst] = candidate
            hits[worst] = found
            worst = int(np.argmin(hits))
            idle = 0
        for d in range(3):
            bandwidth[d] *= shrink[d]
        spent += 1
        idle += 1
        if memory_size + t < trace.shape[0]:
            record(trace, memory_size + t, memory, hits)
    best = int(np.argmax(hits))
    return memory[best].copy(), hits[best], memory_size + spent


@kernel
def harmony_search_all(
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
    improvisations: int,
    patience: int,
    seeds: NDArray[np.int64],
) -> tuple[Poses, NDArray[np.int64]]:
    """`harmony_search` for each scan of a `hsslam.search.batch.Batch`, with up to ``most`` points and a seed each.

    Returns
    -------
    (Poses (N, 3), int64 (N,))
        Best harmonies, and how often the fitness was evaluated.
    """
    found, spent, trace = np.empty_like(guesses), np.empty_like(ends), np.empty((0, 4))
    for i in range(ends.shape[0]):
        scan = part(points, ends, i)
        count = min(most, scan.shape[0])
        found[i], _, spent[i] = harmony_search(
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
            improvisations,
            patience,
            seeds[i],
            trace,
        )
    return found, spent
