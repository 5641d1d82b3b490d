"""PL-ICP: point-to-line ICP of our own (after Censi, "An ICP variant using a point-to-line metric", 2008)."""

from __future__ import annotations

import numpy as np
from pydantic import Field, model_validator

from hsslam.matching import Estimate, Matcher, Points, Pose, Reference, SearchWindow, clean
from hsslam.search.point_to_line import PointToLineReference, point_to_line_icp
from hsslam_plugins.local import LocalConfig


class PlIcpConfig(LocalConfig):
    """Parameters of PL-ICP: a stage that reaches far, and one that is precise."""

    max_iterations: int = Field(default=30, ge=1, description="iterations of a stage, at most")
    distance_start: float = Field(
        default=0.6,
        gt=0.0,
        le=3.0,
        description="reach of a correspondence at the start (m); shrinks linearly",
    )
    distance_middle: float = Field(
        default=0.15,
        gt=0.0,
        le=0.15,
        description="reach at the end of the first stage and the start of the second (m)",
    )
    distance_end: float = Field(default=0.08, gt=0.0, le=0.15, description="reach at the end (m)")
    robust_scale_start: float = Field(
        default=0.15,
        gt=0.0,
        description="scale of the Cauchy weight in the first stage (m): larger residuals weigh less",
    )
    robust_scale_end: float = Field(
        default=0.03, gt=0.0, description="scale of the Cauchy weight in the second stage (m)"
    )

    @model_validator(mode="after")
    def _shrinking(self) -> PlIcpConfig:
        if not self.distance_end <= self.distance_middle <= self.distance_start:
            raise ValueError("distance_start, distance_middle and distance_end must not grow in this order")
        if self.robust_scale_end > self.robust_scale_start:
            raise ValueError("robust_scale_end is larger than robust_scale_start")
        return self


class PlIcp(Matcher[PlIcpConfig]):
    """Robust point-to-line ICP from the guess."""

    Config = PlIcpConfig
    summary = "point-to-line ICP, robust, coarse to fine (after Censi 2008)"

    def prepare(self, points: Points) -> PointToLineReference:
        """Fit lines, and find the nearest of them everywhere; see `hsslam.matching.Matcher.prepare`."""
        return PointToLineReference(clean(points), self.config.distance_start)

    def extend(self, reference: Reference, points: Points) -> PointToLineReference:
        """Find the nearest line anew, the added ones among them; see `hsslam.matching.Matcher.extend`."""
        points = clean(points)
        every = np.vstack((reference.points, points))
        return PointToLineReference(every, self.config.distance_start, reference.surface.extended(points))

    def estimate(
        self,
        reference: Reference,
        points: Points,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> Estimate:
        """Start at the guess."""
        assert isinstance(reference, PointToLineReference)
        config = self.config
        pose, iterations, converged = point_to_line_icp(
            reference,
            points,
            guess,
            config.max_iterations,
            (config.distance_start, config.distance_middle, config.distance_end),
            (config.robust_scale_start, config.robust_scale_end),
        )
        return Estimate(
            window.keep(guess, pose, config.window_slack),
            converged=converged,
            evaluations=iterations,
        )
