"""Harmony search with varying pitch adjustment and bandwidth (paper, sections 3 and 4; IHS, equations 2 and 3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.fitness import count_hits
from hsslam.se2 import Pose


@kernel
def improvise(
    memory: NDArray[np.float64],
    guess: Pose,
    half: NDArray[np.float64],
    memory_considering_rate: float,
    pitch_adjusting_rate: float,
    bandwidth: NDArray[np.float64],
    rng: np.random.Generator,
    out: NDArray[np.float64],
) -> None:
    """Make a new harmony (paper, Algorithm 1 and equations 7 and 8); into ``out`` (3,).

    Each variable is taken from a random harmony with probability HMCR, and then moved by up to a bandwidth
    either way with probability PAR; else it is drawn from the whole window. The result is clipped to the window.
    """
    for d in range(3):
        if rng.random() <= memory_considering_rate:
            value = memory[int(rng.random() * memory.shape[0]), d]
            if rng.random() <= pitch_adjusting_rate:
                value += (2.0 * rng.random() - 1.0) * bandwidth[d]
        else:
            value = guess[d] + (2.0 * rng.random() - 1.0) * half[d]
        out[d] = min(max(value, guess[d] - half[d]), guess[d] + half[d])


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
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    guess: Pose,
    half: NDArray[np.float64],
    rng: np.random.Generator,
    memory: NDArray[np.float64],
    hits: NDArray[np.int64],
    trace: NDArray[np.float64],
) -> None:
    """Fill the memory: the guess itself, then harmonies uniform in the window (paper, equations 1, 5 and 6)."""
    for i in range(memory.shape[0]):
        for d in range(3):
            offset = 0.0 if i == 0 else (2.0 * rng.random() - 1.0) * half[d]
            memory[i, d] = guess[d] + offset
        hits[i] = count_hits(cells, frame, xs, ys, memory[i, 0], memory[i, 1], memory[i, 2], 0)
        if i < trace.shape[0]:
            record(trace, i, memory, hits[: i + 1])


@kernel
def harmony_search(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    xs: NDArray[np.float32],
    ys: NDArray[np.float32],
    guess: Pose,
    half: NDArray[np.float64],
    memory_size: int,
    memory_considering_rate: float,
    pitch_adjusting_rates: tuple[float, float],
    bandwidth_min: NDArray[np.float64],
    bandwidth_max: NDArray[np.float64],
    improvisations: int,
    patience: int,
    rng: np.random.Generator,
    trace: NDArray[np.float64],
) -> tuple[Pose, int, int]:
    """Search the window for the pose with most hits (paper: HSL).

    Parameters
    ----------
    cells, frame, xs, ys : arrays
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
    rng : numpy.random.Generator
        Source of every random choice.
    trace : float64 (E, 4)
        Filled with the best pose and its hits after each of the first E evaluations; E may be 0.

    Returns
    -------
    (Pose, int, int)
        Best harmony, its hits, and how often the fitness was evaluated.
    """
    memory = np.empty((memory_size, 3))
    hits = np.empty(memory_size, dtype=np.int64)
    fill_memory(cells, frame, xs, ys, guess, half, rng, memory, hits, trace)
    candidate = np.empty(3)
    bandwidth = np.empty(3)
    worst = int(np.argmin(hits))
    par_min, par_max = pitch_adjusting_rates
    idle = spent = 0
    for t in range(improvisations):
        if 0 < patience <= idle:
            break
        share = t / improvisations
        for d in range(3):
            bandwidth[d] = bandwidth_max[d] * math.exp(math.log(bandwidth_min[d] / bandwidth_max[d]) * share)
        rate = par_min + (par_max - par_min) * share
        improvise(memory, guess, half, memory_considering_rate, rate, bandwidth, rng, candidate)
        found = count_hits(cells, frame, xs, ys, candidate[0], candidate[1], candidate[2], hits[worst] + 1)
        if found > hits[worst]:
            memory[worst] = candidate
            hits[worst] = found
            worst = int(np.argmin(hits))
            idle = 0
        spent += 1
        idle += 1
        if memory_size + t < trace.shape[0]:
            record(trace, memory_size + t, memory, hits)
    best = int(np.argmax(hits))
    return memory[best].copy(), hits[best], memory_size + spent
