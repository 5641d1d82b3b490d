"""Genetic search over Gray-coded poses: GLASM (Lenac, Mumolo, Nolich, "Fast genetic scan matching", 2007)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.fitness import evaluate, scale, scratch
from hsslam.kernels.random import below, seeded, uniform
from hsslam.se2 import Points, Pose, Poses
from hsslam.search.batch import part


@kernel
def decode(gray: int, bits: int, centre: float, half: float) -> float:
    """Value of a Gray-coded variable: codes 0 .. 2^bits - 1 span ``centre`` -+ ``half``."""
    code = gray
    shift = 1
    while shift < bits:
        code ^= code >> shift
        shift *= 2
    return centre + half * (2.0 * code / ((1 << bits) - 1) - 1.0)


@kernel
def encode(value: float, bits: int, centre: float, half: float) -> int:
    """Gray code nearest to a value within ``centre`` -+ ``half``."""
    share = (value - centre) / half if half > 0.0 else 0.0
    code = round(0.5 * (share + 1.0) * ((1 << bits) - 1))
    code = min(max(code, 0), (1 << bits) - 1)
    return code ^ (code >> 1)


@kernel
def genetic_search(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    scaled: NDArray[np.float32],
    count: int,
    guess: Pose,
    half: NDArray[np.float64],
    population_size: int,
    generations: int,
    bits: int,
    crossover_rate: float,
    mutation_rate: float,
    tournament: int,
    seed: int,
    trace: NDArray[np.float64],
) -> tuple[Pose, int, int]:
    """Search the window for the pose with most hits (GLASM).

    A chromosome is three Gray-coded variables. Each generation keeps its best chromosome and makes the others
    from parents that won a tournament, by one-point crossover and, with probability ``mutation_rate``, the
    flip of one bit.

    Parameters
    ----------
    cells, frame, scaled, count, guess, half, seed, trace
        As for `hsslam.search.harmony.harmony_search`.
    population_size, generations : int
        Chromosomes, and how often they are evaluated: the budget is their product.
    bits : int
        Per variable, at most 20.
    crossover_rate, mutation_rate : float
        Probabilities, per child.
    tournament : int
        Contestants for each parent.

    Returns
    -------
    (Pose, int, int)
        Best pose, its hits, and how often the fitness was evaluated.
    """
    flat, index, state = cells.reshape(cells.size), scratch(), seeded(seed)
    xs, ys, facing = scaled[0], scaled[1], scaled[2]
    genes = np.empty((population_size, 3), dtype=np.int64)
    children = np.empty((population_size, 3), dtype=np.int64)
    hits = np.zeros(population_size, dtype=np.int64)
    best_genes = np.empty(3, dtype=np.int64)
    best_hits = -1
    for i in range(population_size):
        for d in range(3):
            genes[i, d] = encode(guess[d], bits, guess[d], half[d]) if i == 0 else below(state, 1 << bits)
    for generation in range(generations):
        for i in range(population_size):
            x = decode(genes[i, 0], bits, guess[0], half[0])
            y = decode(genes[i, 1], bits, guess[1], half[1])
            theta = decode(genes[i, 2], bits, guess[2], half[2])
            hits[i] = evaluate(flat, cells.shape, frame, xs, ys, facing, count, x, y, theta, 0, index)
            if hits[i] > best_hits:
                best_hits = hits[i]
                best_genes[:] = genes[i]
            evaluation = generation * population_size + i
            if evaluation < trace.shape[0]:
                for d in range(3):
                    trace[evaluation, d] = decode(best_genes[d], bits, guess[d], half[d])
                trace[evaluation, 3] = best_hits
        if generation == generations - 1:
            break
        children[0] = best_genes
        for i in range(1, population_size):
            mother = select(hits, tournament, state)
            children[i] = genes[mother]
            if uniform(state) < crossover_rate:
                father = select(hits, tournament, state)
                cross(genes[mother], genes[father], bits, state, children[i])
            if uniform(state) < mutation_rate:
                bit = below(state, 3 * bits)
                children[i, bit // bits] ^= 1 << (bit % bits)
        genes, children = children, genes
    pose = np.empty(3)
    for d in range(3):
        pose[d] = decode(best_genes[d], bits, guess[d], half[d])
    return pose, best_hits, population_size * generations


@kernel
def genetic_search_all(
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    ends: NDArray[np.int64],
    guesses: Poses,
    most: int,
    half: NDArray[np.float64],
    population_size: int,
    generations: int,
    bits: int,
    crossover_rate: float,
    mutation_rate: float,
    tournament: int,
    seeds: NDArray[np.int64],
) -> tuple[Poses, NDArray[np.int64]]:
    """`genetic_search` for each scan of a batch; see `hsslam.search.harmony.harmony_search_all`."""
    found, spent, trace = np.empty_like(guesses), np.empty_like(ends), np.empty((0, 4))
    for i in range(ends.shape[0]):
        scan = part(points, ends, i)
        count = min(most, scan.shape[0])
        found[i], _, spent[i] = genetic_search(
            cells,
            frame,
            scale(scan, part(lines, ends, i), frame, count),
            count,
            guesses[i],
            half,
            population_size,
            generations,
            bits,
            crossover_rate,
            mutation_rate,
            tournament,
            seeds[i],
            trace,
        )
    return found, spent


@kernel
def select(hits: NDArray[np.int64], tournament: int, state: NDArray[np.uint64]) -> int:
    """Winner of a tournament among ``tournament`` random chromosomes."""
    winner = below(state, hits.shape[0])
    for _ in range(tournament - 1):
        other = below(state, hits.shape[0])
        if hits[other] > hits[winner]:
            winner = other
    return winner


@kernel
def cross(
    mother: NDArray[np.int64],
    father: NDArray[np.int64],
    bits: int,
    state: NDArray[np.uint64],
    child: NDArray[np.int64],
) -> None:
    """One-point crossover of the whole chromosome; into ``child`` (3,)."""
    point = 1 + below(state, 3 * bits - 1)
    for d in range(3):
        from_father = min(max(point - d * bits, 0), bits)
        low = (1 << from_father) - 1
        child[d] = (father[d] & low) | (mother[d] & ~low)
