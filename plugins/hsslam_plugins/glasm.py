"""GLASM: genetic scan matching (Lenac, Mumolo, Nolich 2007), the paper's yardstick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hsslam.matching import Pose, Poses, SearchWindow
from hsslam.search import (
    NO_TRACE,
    Batch,
    HitFitness,
    PopulationConfig,
    PopulationMatcher,
    Raster,
    genetic_search,
    genetic_search_all,
    seed_of,
    seeds_of,
)
from hsslam.search.fitness import FitnessName


class GlasmConfig(PopulationConfig):
    """Parameters of GLASM; population, generations, rates, bits and square as its authors published them."""

    fitness: FitnessName = Field(
        default="paper",
        description="`paper`: squares around the points; `surface`: squares along the segments between them; "
        "`likelihood`: a smooth field around these",
    )
    half_side: float = Field(
        default=0.0525,
        gt=0.0,
        le=1.0,
        description="half side of the squares of the fitness (m): 10.5 cm squares",
    )
    refine: bool = Field(
        default=False, description="polish the best pose by Gauss-Newton on the lines of both scans"
    )
    population_size: int = Field(default=120, ge=2, description="chromosomes in a generation")
    generations: int = Field(default=12, ge=1, description="generations evaluated")
    bits: int = Field(default=9, ge=2, le=20, description="bits of the Gray code of each variable")
    crossover_rate: float = Field(
        default=1.0, ge=0.0, le=1.0, description="probability that a child has two parents"
    )
    mutation_rate: float = Field(
        default=0.12, ge=0.0, le=1.0, description="probability that a bit of a child flips"
    )
    tournament: int = Field(
        default=3, ge=1, description="contestants for each parent (the authors give no selection)"
    )


class Glasm(PopulationMatcher[GlasmConfig]):
    """Genetic search over the window, poses as Gray-coded bits."""

    Config = GlasmConfig
    summary = "genetic search, Gray-coded (Lenac, Mumolo, Nolich 2007)"
    side_by_side = True

    def search(
        self,
        fitness: HitFitness,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
        trace: NDArray[np.float64] = NO_TRACE,
    ) -> tuple[Pose, int, int]:
        """See `hsslam.search.genetic_search`."""
        return genetic_search(
            fitness.cells,
            fitness.frame,
            fitness.scaled,
            fitness.count,
            guess,
            window.half,
            *self._settings,
            seed_of(rng),
            trace,
        )

    def search_all(
        self,
        raster: Raster,
        batch: Batch,
        most: int,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> tuple[Poses, NDArray[np.int64]]:
        """See `hsslam.search.genetic_search_all`."""
        return genetic_search_all(
            raster.cells,
            raster.frame,
            batch.points,
            batch.ends,
            batch.guesses,
            most,
            window.half,
            *self._settings,
            seeds_of(rng, len(batch)),
        )

    @property
    def _settings(self) -> tuple[int, int, int, float, float, int]:
        """What `genetic_search` is told of the search."""
        config = self.config
        return (
            config.population_size,
            config.generations,
            config.bits,
            config.crossover_rate,
            config.mutation_rate,
            config.tournament,
        )
