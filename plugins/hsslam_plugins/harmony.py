"""What HSL and HIDE share: their parameters, and how these grow with the window."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from hsslam.matching import SearchWindow
from hsslam.search import KernelMatcher, PopulationConfig


class HarmonyConfig(PopulationConfig):
    """Harmony memory and its improvisation; defaults as published (paper, section 6)."""

    memory_size: int = Field(default=30, ge=4, description="harmonies in the memory (HMS)")
    memory_considering_rate: float = Field(
        default=0.88, ge=0.0, le=1.0, description="probability that a variable comes from the memory (HMCR)"
    )
    pitch_adjusting_rate_min: float = Field(
        default=0.55, ge=0.0, le=1.0, description="probability of pitch adjustment at the start (PAR_min)"
    )
    pitch_adjusting_rate_max: float = Field(
        default=0.98, ge=0.0, le=1.0, description="probability of pitch adjustment at the end (PAR_max)"
    )
    bandwidth_max: float = Field(
        default=8.0,
        gt=0.0,
        description="largest pitch adjustment at the start (BW_max; cm for x and y, degrees for theta)",
    )
    bandwidth_min: float = Field(
        default=0.2,
        gt=0.0,
        description="largest pitch adjustment at the end (BW_min; cm for x and y, degrees for theta)",
    )

    patience: int = Field(
        default=0,
        ge=0,
        description="end after this many evaluations that changed nothing (0: use up the budget)",
    )
    wide_windows: bool = Field(
        default=True,
        description="in windows far larger than the paper's: a larger memory, budget and bandwidth, a coarser raster",
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


PAPER_WINDOW = SearchWindow(0.15, 0.15, math.radians(10.0))
"""The window that the published parameters were tuned for (paper, section 6)."""

WIDE_FROM = 1.5
"""Parameters change for windows this many times as large along each axis, on geometric average."""


EFFORTS_KEPT = 64


@dataclass(frozen=True)
class Effort:
    """Parameters of one search, the window taken into account.

    Parameters
    ----------
    wide : bool
        Whether the window is far larger than the paper's.
    memory_size : int
        HMS: grows with the window's size along an axis.
    budget : int
        Evaluations after the memory is filled: grow with its square.
    bandwidth_min, bandwidth_max : float64 (3,)
        m, m, rad; the larger one grows with its root.
    """

    wide: bool
    memory_size: int
    budget: int
    bandwidth_min: NDArray[np.float64]
    bandwidth_max: NDArray[np.float64]


HarmonySettings: TypeAlias = tuple[
    int, float, tuple[float, float], NDArray[np.float64], NDArray[np.float64], int
]
"""HMS, HMCR, PAR_min and PAR_max, BW_min, BW_max, and the budget: what the kernels of both searches take first."""

HarmonyConfigT = TypeVar("HarmonyConfigT", bound=HarmonyConfig)


class HarmonyMatcher(KernelMatcher[HarmonyConfigT], Generic[HarmonyConfigT]):
    """Base of HSL and HIDE: how much effort a window is worth."""

    covers_window = True

    @property
    @abstractmethod
    def budget(self) -> int:
        """Evaluations after the memory is filled, as configured."""

    def is_wide(self, window: SearchWindow) -> bool:
        """Whether the window is far larger than the paper's."""
        return self.effort(window).wide

    def harmony_settings(self, window: SearchWindow) -> HarmonySettings:
        """What a search in a window is told of the harmony memory."""
        config, effort = self.config, self.effort(window)
        return (
            effort.memory_size,
            config.memory_considering_rate,
            config.pitch_adjusting_rates,
            effort.bandwidth_min,
            effort.bandwidth_max,
            effort.budget,
        )

    def effort(self, window: SearchWindow) -> Effort:
        """Parameters for a window; as configured unless it is wide (and ``wide_windows`` is on)."""
        known = self._efforts.get(window)
        if known is None:
            # Windows come from a few settings; a caller that makes ever new ones must not fill the memory.
            if len(self._efforts) >= EFFORTS_KEPT:
                self._efforts.clear()
            known = self._efforts[window] = self._effort(window)
        return known

    @cached_property
    def _efforts(self) -> dict[SearchWindow, Effort]:
        return {}

    def _effort(self, window: SearchWindow) -> Effort:
        config = self.config
        low, high = bandwidth(config.bandwidth_min), bandwidth(config.bandwidth_max)
        growth = float(np.prod(window.half / PAPER_WINDOW.half)) ** (1.0 / 3.0)
        if not config.wide_windows or growth < WIDE_FROM:
            return Effort(False, config.memory_size, self.budget, low, high)
        memory_size, budget = round(config.memory_size * growth), round(self.budget * growth**2)
        return Effort(True, memory_size, budget, low, high * math.sqrt(growth))


def bandwidth(value: float) -> NDArray[np.float64]:
    """Bandwidths of x, y (m) and theta (rad) from one figure in centimetres and degrees."""
    return np.array([value / 100.0, value / 100.0, math.radians(value)])
