"""HSL: localisation by harmony search (paper, section 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hsslam.matching import Pose, SearchWindow
from hsslam.search import NO_TRACE, HitFitness, harmony_search, seed_of
from hsslam_plugins.harmony import HarmonyConfig, HarmonyMatcher


class HslConfig(HarmonyConfig):
    """Parameters of HSL."""

    improvisations: int = Field(default=250, ge=1, description="new harmonies made (NI)")


class Hsl(HarmonyMatcher[HslConfig]):
    """Harmony search over the window."""

    Config = HslConfig
    summary = "harmony search (paper, section 4)"

    @property
    def budget(self) -> int:
        """See `HslConfig.improvisations`."""
        return self.config.improvisations

    def search(
        self,
        fitness: HitFitness,
        guess: Pose,
        window: SearchWindow,
        rng: np.random.Generator,
        trace: NDArray[np.float64] = NO_TRACE,
    ) -> tuple[Pose, int, int]:
        """See `hsslam.search.harmony_search`."""
        config = self.config
        scaled = self.effort(window)
        return harmony_search(
            fitness.cells,
            fitness.frame,
            fitness.scaled,
            fitness.count,
            guess,
            window.half,
            scaled.memory_size,
            config.memory_considering_rate,
            config.pitch_adjusting_rates,
            scaled.bandwidth_min,
            scaled.bandwidth_max,
            scaled.budget,
            config.patience,
            seed_of(rng),
            trace,
        )
