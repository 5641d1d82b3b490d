"""CSM: correlative scan matching on a likelihood field (Olson, "Real-time correlative scan matching", 2009)."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from hsslam.matching import (
    Estimate,
    Matcher,
    MatcherConfig,
    Points,
    Pose,
    Reference,
    SearchWindow,
    clean,
)
from hsslam.search.exhaustive import ExhaustiveReference, lattice_search, neighbourhood_mean


class CsmConfig(MatcherConfig):
    """Parameters of the correlative scan matcher."""

    deviation: float = Field(
        default=0.04,
        gt=0.0,
        le=1.0,
        description="standard deviation of the likelihood field around surfaces (m)",
    )
    resolution: float = Field(
        default=0.025,
        gt=0.0,
        le=0.5,
        description="side of a raster cell, and step of the search in x and y (m); in heading the step is the "
        "turn that moves the farthest point so far",
    )
    temperature: float = Field(
        default=1.0,
        gt=0.0,
        description="points' worth of likelihood by which a pose's weight in the mean around the best falls to 1 / e",
    )


class Csm(Matcher[CsmConfig]):
    """Coarse-to-fine exhaustive search of a likelihood field, then the likelihoods' mean around the best pose."""

    Config = CsmConfig
    summary = "correlative scan matching on a likelihood field (Olson 2009)"
    side_by_side = True
    covers_window = True

    def prepare(self, points: Points) -> ExhaustiveReference:
        """Make the likelihood field and its coarser levels; see `hsslam.matching.Matcher.prepare`."""
        return ExhaustiveReference(clean(points), "likelihood", self.config.deviation, self.config.resolution)

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Search the lattice around the guess, and average around its best pose."""
        assert isinstance(reference, ExhaustiveReference)
        fitness = reference.fitness_of(points)
        found = lattice_search(reference, fitness, guess, window)
        pose = neighbourhood_mean(fitness, found.pose, guess, window, self.config.temperature)
        return Estimate(pose, evaluations=found.evaluations, diagnostics={"likelihood": found.fitness})
