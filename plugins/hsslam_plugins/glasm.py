"""GLASM: genetic scan matching (Lenac, Mumolo, Nolich 2007), the paper's yardstick."""

from __future__ import annotations

from pydantic import Field

from hsslam.matching import SearchWindow
from hsslam.search import KernelMatcher, PopulationConfig, genetic_search, genetic_search_all
from hsslam.search.fitness import FitnessName


class GlasmConfig(PopulationConfig):
    """Parameters of GLASM; population, generations, rates, bits and square as its authors published them."""

    fitness: FitnessName = Field(
        default="paper",
        description="`paper`: squares around the points; `surface`: squares along the segments between them; `sides`: "
        "of these, those of the side of a wall that the scan sees; `likelihood`: a smooth field around them",
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


class Glasm(KernelMatcher[GlasmConfig]):
    """Genetic search over the window, poses as Gray-coded bits."""

    Config = GlasmConfig
    summary = "genetic search, Gray-coded (Lenac, Mumolo, Nolich 2007)"
    kernel = staticmethod(genetic_search)
    kernel_all = staticmethod(genetic_search_all)

    def settings(self, window: SearchWindow) -> tuple[int, int, int, float, float, int]:
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
