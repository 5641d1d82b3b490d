"""Parameters that HSL and HIDE share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from hsslam.search import PopulationConfig


class HarmonyConfig(PopulationConfig):
    """Harmony memory and its improvisation; defaults as published (paper, section 6)."""

    memory_size: int = Field(30, ge=4, description="harmonies in the memory (HMS)")
    memory_considering_rate: float = Field(
        0.88, ge=0.0, le=1.0, description="probability that a variable comes from the memory (HMCR)"
    )
    pitch_adjusting_rate_min: float = Field(
        0.55, ge=0.0, le=1.0, description="probability of pitch adjustment at the start (PAR_min)"
    )
    pitch_adjusting_rate_max: float = Field(
        0.98, ge=0.0, le=1.0, description="probability of pitch adjustment at the end (PAR_max)"
    )
    bandwidth_max: float = Field(
        8.0,
        gt=0.0,
        description="largest pitch adjustment at the start (BW_max; cm for x and y, degrees for theta)",
    )
    bandwidth_min: float = Field(
        0.2,
        gt=0.0,
        description="largest pitch adjustment at the end (BW_min; cm for x and y, degrees for theta)",
    )

    @model_validator(mode="after")
    def _ordered(self) -> HarmonyConfig:
        if self.bandwidth_min > self.bandwidth_max:
            raise ValueError("bandwidth_min is larger than bandwidth_max")
        return self

    @property
    def pitch_adjusting_rates(self) -> tuple[float, float]:
        """PAR_min, PAR_max."""
        return self.pitch_adjusting_rate_min, self.pitch_adjusting_rate_max


def bandwidth(value: float) -> NDArray[np.float64]:
    """Bandwidths of x, y (m) and theta (rad) from one figure in centimetres and degrees."""
    return np.array([value / 100.0, value / 100.0, math.radians(value)])
