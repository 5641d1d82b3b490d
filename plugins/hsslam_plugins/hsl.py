"""HSL: localisation by harmony search (paper, section 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from hsslam.matching import Pose, Poses, SearchWindow
from hsslam.search import (
    NO_TRACE,
    Batch,
    HitFitness,
    Raster,
    harmony_search,
    harmony_search_all,
    seed_of,
    seeds_of,
)
from hsslam_plugins.harmony import HarmonyConfig, HarmonyMatcher, HarmonySettings


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
        return harmony_search(
            fitness.cells,
            fitness.frame,
            fitness.scaled,
            fitness.count,
            guess,
            window.half,
            *self._settings(window),
            seed_of(rng),
            trace,
        )

    def search_all(
        self,
        raster: Raster,
        batch: Batch,
        most: int,
        window: SearchWindow,
        rng: np.random.Generator,
    ) -> tuple[Poses, NDArray[np.int64]]:
        """See `hsslam.search.harmony_search_all`."""
        return harmony_search_all(
            raster.cells,
            raster.frame,
            batch.points,
            batch.ends,
            batch.guesses,
            most,
            window.half,
            *self._settings(window),
            seeds_of(rng, len(batch)),
        )

    def _settings(self, window: SearchWindow) -> tuple[*HarmonySettings, int]:
        """What `harmony_search` is told of the search."""
        return (*self.harmony_settings(window), self.config.patience)
