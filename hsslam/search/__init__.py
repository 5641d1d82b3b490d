"""Population searches over a box around a guess: harmony search, differential evolution, HIDE, genetic."""

from hsslam.kernels.random import seed_of
from hsslam.kernels.raster import Raster
from hsslam.kernels.surface import Surface, scan_lines
from hsslam.search.fitness import HitFitness
from hsslam.search.fitness_functions import FitnessFunction, fitness_names, register_fitness
from hsslam.search.genetic import genetic_search, genetic_search_all
from hsslam.search.harmony import harmony_search, harmony_search_all
from hsslam.search.hide import hide_search, hide_search_all
from hsslam.search.minimize import minimize
from hsslam.search.population import (
    NO_TRACE,
    KernelMatcher,
    PopulationConfig,
    PopulationMatcher,
    PopulationReference,
)

__all__ = [
    "NO_TRACE",
    "FitnessFunction",
    "HitFitness",
    "KernelMatcher",
    "PopulationConfig",
    "PopulationMatcher",
    "PopulationReference",
    "Raster",
    "Surface",
    "fitness_names",
    "genetic_search",
    "genetic_search_all",
    "harmony_search",
    "harmony_search_all",
    "hide_search",
    "hide_search_all",
    "minimize",
    "register_fitness",
    "scan_lines",
    "seed_of",
]
