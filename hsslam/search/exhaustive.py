"""Exhaustive search of a window: a lattice of poses, or every pose there is, with proof."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import ConfigError
from hsslam.kernels.certify import certify, with_dominoes
from hsslam.kernels.correlative import BLOCKS, SIDES, best_of_lattice, pool, posterior_mean
from hsslam.kernels.fitness import count_hits
from hsslam.kernels.raster import Raster
from hsslam.matching.interface import Reference, SearchWindow
from hsslam.se2 import Points, Pose
from hsslam.search.fitness import FitnessName, HitFitness, build_raster

_SIDES = np.array(SIDES, dtype=np.int64)
_BLOCKS = np.array(BLOCKS, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Proof:
    """What an exhaustive search found.

    Parameters
    ----------
    pose : Pose
        The best pose.
    fitness : float
        What it is worth, as a share of the most there could be, in [0, 1].
    bound : float
        No pose of the window is worth more than this.
    evaluations : int
        Poses and blocks of poses looked at.
    """

    pose: Pose
    fitness: float
    bound: float
    evaluations: int


class ExhaustiveReference(Reference):
    """A reference with the raster of a fitness function and its pooled maxima.

    Parameters
    ----------
    points : Points
        (N, 2) m.
    fitness, half_side, resolution : str, float, float
        As for `hsslam.search.fitness.build_raster`.
    """

    def __init__(self, points: Points, fitness: FitnessName, half_side: float, resolution: float) -> None:
        super().__init__(points)
        self.raster: Raster = build_raster(fitness, points, self.surface, half_side, resolution)
        if self.raster.sided:
            raise ConfigError(f"fitness {fitness!r}: an exhaustive search knows no sides; choose 'surface'")
        self.pooled: NDArray[np.uint8] = pool(self.raster.cells, _SIDES)

    @cached_property
    def slabs(self) -> NDArray[np.uint8]:
        """Pooled maxima as the search of every pose needs them."""
        return with_dominoes(self.pooled)

    def fitness_of(self, points: Points) -> HitFitness:
        """Fitness of (N, 2) points."""
        return HitFitness.of(self.raster, points)


def lattice_search(
    reference: ExhaustiveReference,
    fitness: HitFitness,
    guess: Pose,
    window: SearchWindow,
    budget: int = sys.maxsize,
    least: float = 0.0,
) -> Proof:
    """Find the best pose of the lattice around a guess: steps of a raster cell, and of a cell's turn.

    A cell's turn is the rotation that moves the scan's farthest point by a cell. The bound is of the lattice
    only. With a ``budget`` of blocks and poses spent, nothing is proven: the best of those looked at, or the guess.
    So it is, with a fitness of 0, where no pose has one of ``least``.
    """
    turn = cell_turn(fitness)
    cell = 1.0 / fitness.frame[2]
    counts = np.floor(window.half / np.array([cell, cell, turn]) + 1e-9).astype(np.int64)
    floor = math.ceil(least * float(fitness.frame[3]) * fitness.count)
    pose, worth, evaluations = best_of_lattice(
        reference.pooled,
        _SIDES,
        _BLOCKS,
        fitness.frame,
        fitness.xs,
        fitness.ys,
        guess,
        counts,
        turn,
        budget,
        floor,
    )
    found = worth >= floor
    share = float(fitness.share(worth)) if found else 0.0
    bound = share if found else least
    return Proof(pose, share, bound if evaluations < budget else 1.0, evaluations)


def window_search(
    reference: ExhaustiveReference,
    fitness: HitFitness,
    guess: Pose,
    window: SearchWindow,
    tolerance: float,
    budget: int,
) -> Proof:
    """Find the best of all poses in a window, those between the poses of any lattice included.

    Parameters
    ----------
    reference, fitness, guess, window
        As for `lattice_search`, whose answer this begins with.
    tolerance : float
        The search may end with a bound this much over the fitness found.
    budget : int
        Boxes of poses looked at, at most.
    """
    known = lattice_search(reference, fitness, guess, window)
    most = float(fitness.frame[3]) * len(fitness.xs)
    # As everybody else counts it, which may differ from the lattice's count where a point lies on a border.
    x, y, theta = known.pose
    worth = count_hits(fitness.cells, fitness.frame, fitness.xs, fitness.ys, x, y, theta, 0)
    pose, worth, ceiling, evaluations = certify(
        reference.slabs,
        _SIDES,
        fitness.cells,
        fitness.frame,
        fitness.xs,
        fitness.ys,
        guess,
        window.half,
        cell_turn(fitness),
        known.pose,
        worth,
        int(tolerance * most),
        budget,
    )
    return Proof(pose, worth / most, ceiling / most, known.evaluations + evaluations)


def cell_turn(fitness: HitFitness) -> float:
    """Turn (rad) that moves the scan's farthest point by a cell, at most a radian."""
    return 1.0 / max(float(np.hypot(fitness.xs, fitness.ys).max()), 1.0)


def neighbourhood_mean(
    fitness: HitFitness, best: Pose, guess: Pose, window: SearchWindow, temperature: float
) -> Pose:
    """Mean pose around the best one of a lattice, poses weighted by their likelihood (Olson 2009, section IV).

    Parameters
    ----------
    fitness : HitFitness
        Of a smooth field.
    best : Pose
        Middle of the neighbourhood, two cells and two cells' turns each way.
    guess, window
        Poses outside take no part.
    temperature : float
        Points' worth of fitness by which the weight falls to 1 / e.
    """
    return posterior_mean(
        fitness.cells,
        fitness.frame,
        fitness.xs,
        fitness.ys,
        best,
        guess,
        window.half,
        cell_turn(fitness),
        temperature * fitness.frame[3],
    )
