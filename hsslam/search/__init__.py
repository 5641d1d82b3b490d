"""Population searches over a box around a guess: harmony search, differential evolution, HIDE, genetic."""

from hsslam.kernels.random import seed_of
from hsslam.search.fitness import FITNESS_NAMES, HitFitness
from hsslam.search.genetic import genetic_search
from hsslam.search.harmony import harmony_search
from hsslam.search.hide import hide_search
from hsslam.search.minimize import minimize
from hsslam.search.population import (
    NO_TRACE,
    PopulationConfig,
    PopulationMatcher,
    PopulationReference,
)

__all__ = [
    "FITNESS_NAMES",
    "NO_TRACE",
    "HitFitness",
    "PopulationConfig",
    "PopulationMatcher",
    "PopulationReference",
    "genetic_search",
    "harmony_search",
    "hide_search",
    "minimize",
    "seed_of",
]
