"""Exhaustive: the proven best pose of the window, by branch and bound (Olson 2009; Hess et al. 2016)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from hsslam.matching import Estimate, Matcher, Points, Pose, Reference, SearchWindow, clean
from hsslam.search import PopulationConfig, scan_lines
from hsslam.search.exhaustive import ExhaustiveReference, lattice_search, window_search
from hsslam.search.fitness import FitnessName
from hsslam.search.polish import polish


class ExhaustiveConfig(PopulationConfig):
    """Parameters of the exhaustive search; those of the fitness as for the population searches."""

    fitness: FitnessName = Field(
        default="surface",
        description="as for `hide`, but not `sides`: what is proven is proven of places, whichever way points face",
    )
    proof: Literal["window", "lattice"] = Field(
        default="window",
        description="`window`: the best of all poses in the window; `lattice`: the best of those a cell of the "
        "raster apart, and in heading the turn that moves the farthest point by a cell",
    )
    tolerance: float = Field(
        default=0.005,
        ge=0.0,
        lt=1.0,
        description="`window`: another pose may be better by this share of the most there could be; below one "
        "point in all: by none",
    )
    budget: int = Field(
        default=300_000,
        ge=1,
        description="`window`: boxes of poses looked at, at most; then the proof is given up",
    )


class Exhaustive(Matcher[ExhaustiveConfig]):
    """Branch and bound over the window.

    The answer's ``diagnostics`` hold ``fitness``, that of the pose found before any refinement;
    ``fitness_bound``, which no pose of the searched set exceeds; and ``proven``, whether the bound is within
    ``tolerance`` of the fitness. Up to a point more than found may be left unproven in boxes of poses some
    hundredths of a millimetre wide, where borders of raster cells cross.
    """

    Config = ExhaustiveConfig
    summary = "branch and bound: the proven best pose of the window (Olson 2009; Hess et al. 2016)"
    side_by_side = True
    covers_window = True

    def prepare(self, points: Points) -> ExhaustiveReference:
        """Rasterise a reference and pool its maxima; see `hsslam.matching.Matcher.prepare`."""
        config = self.config
        reference = ExhaustiveReference(clean(points), config.fitness, config.half_side, config.resolution)
        if config.proof == "window":
            reference.slabs  # noqa: B018  (built on first use, which is not to fall into a match)
        return reference

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Search, prove, refine; see `hsslam.search.polish.polish`."""
        assert isinstance(reference, ExhaustiveReference)
        config = self.config
        fitness = reference.fitness_of(points)
        if config.proof == "window":
            proof = window_search(reference, fitness, guess, window, config.tolerance, config.budget)
        else:
            proof = lattice_search(reference, fitness, guess, window)
        diagnostics: dict[str, Any] = {
            "fitness": proof.fitness,
            "fitness_bound": proof.bound,
            "proven": proof.bound - proof.fitness <= config.tolerance,
        }
        if not config.refine:
            return Estimate(proof.pose, evaluations=proof.evaluations, diagnostics=diagnostics)
        refined, diagnostics["refine_iterations"] = polish(
            reference, points, scan_lines(points), proof.pose, guess, window, config.refine_iterations
        )
        return Estimate(refined, evaluations=proof.evaluations, diagnostics=diagnostics)
