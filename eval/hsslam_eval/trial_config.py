"""Settings of the trials."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal, TypeAlias

from pydantic import Field, model_validator

from hsslam.config import Section
from hsslam.matching.interface import SearchWindow

Protocol: TypeAlias = Literal["simulated", "relations", "static", "split", "consecutive"]


class SuccessThreshold(Section):
    """How near the truth an answer must be to count as a success; both limits are exclusive."""

    name: str = Field(min_length=1, description="what reports call it")
    displacement: float = Field(gt=0.0, description="distance from the truth below which it succeeds (m)")
    rotation: float = Field(gt=0.0, description="rotation error below which it succeeds (rad)")


def default_thresholds() -> tuple[SuccessThreshold, ...]:
    """Return the GLASM authors' limits, and two rounder pairs to compare with others."""
    return (
        SuccessThreshold(name="glasm", displacement=0.10, rotation=0.01),
        SuccessThreshold(name="10cm_2deg", displacement=0.10, rotation=math.radians(2.0)),
        SuccessThreshold(name="5cm_1deg", displacement=0.05, rotation=math.radians(1.0)),
    )


class TrialConfig(Section):
    """Everything that decides which trials are run and how they are judged."""

    protocol: Literal["auto", "simulated", "relations", "static", "split", "consecutive"] = Field(
        default="auto",
        description="where the true pose of a trial comes from; auto: relations where the dataset has them, "
        "simulated where it is simulated, consecutive where a trajectory is given, else static, else split",
    )
    count: int = Field(default=500, ge=1, description="trials to run; fewer where there are fewer pairs")
    seed: int = Field(default=0, ge=0, description="of the choice of pairs, of guesses and of matchers")
    half_xy: float = Field(
        default=0.15, gt=0.0, description="the guess is off by up to this much along x and along y: L / 2 (m)"
    )
    half_theta_deg: float = Field(default=10.0, gt=0.0, le=180.0, description="and by this in heading (deg)")
    thresholds: tuple[SuccessThreshold, ...] = Field(
        default_factory=default_thresholds, min_length=1, description="what counts as success, side by side"
    )
    pair_distance: float = Field(
        default=0.6, gt=0.0, description="relations, simulated: the two scans are less than this apart (m)"
    )
    pair_angle_deg: float = Field(
        default=40.0, gt=0.0, le=180.0, description="relations, simulated: and turned by less than this (deg)"
    )
    consecutive_step: int = Field(default=1, ge=1, description="consecutive: scans i and i + this")
    trajectory: Path | None = Field(
        default=None,
        description="consecutive: true poses, .tum or .csv, where the dataset has none",
    )
    static_distance: float = Field(
        default=0.001, ge=0.0, description="static: odometry that moved no further than this stood still (m)"
    )
    static_angle_deg: float = Field(
        default=0.05, ge=0.0, description="static: and that turned no further than this (deg)"
    )
    static_margin: int = Field(
        default=1,
        ge=0,
        description="static: scans left out at both ends of a standstill, as odometry may lag",
    )
    warm_up: int = Field(default=2, ge=0, description="calls before the clock counts: compilation, imports")
    confidence: float = Field(default=0.95, gt=0.0, lt=1.0, description="of the intervals in the summary")
    resamples: int = Field(default=2000, ge=100, description="bootstrap samples per interval")

    @model_validator(mode="after")
    def _names_differ(self) -> TrialConfig:
        names = [threshold.name for threshold in self.thresholds]
        if len(set(names)) < len(names):
            raise ValueError(f"thresholds need different names, found {', '.join(names)}")
        return self

    @property
    def window(self) -> SearchWindow:
        """The box that guesses are drawn from, and that matchers search."""
        return SearchWindow(self.half_xy, self.half_xy, math.radians(self.half_theta_deg))
