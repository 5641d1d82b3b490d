"""HIDE: harmony search whose memory differential evolution improves (paper, section 5)."""

from __future__ import annotations

from pydantic import Field

from hsslam.matching import SearchWindow
from hsslam.search import hide_search, hide_search_all
from hsslam_plugins.harmony import HarmonyConfig, HarmonyMatcher, HarmonySettings

WIDE_WEIGHT = 0.8
"""F in wide windows: the published 0.44 gathers the memory in one basin before it has seen the others."""


class HideConfig(HarmonyConfig):
    """Parameters of HIDE."""

    evaluations: int = Field(
        default=220, ge=1, description="fitness evaluations after the memory is filled (NFE)"
    )
    harmony_run: int = Field(
        default=14, ge=1, description="improvisations between two differential steps (HRT)"
    )
    attraction: float = Field(
        default=0.7, ge=0.0, le=2.0, description="pull towards the best harmony (lambda)"
    )
    weight: float = Field(
        default=0.44, ge=0.0, le=2.0, description="weight of the difference of two harmonies (F)"
    )
    crossover_rate: float = Field(
        default=0.9,
        ge=0.0,
        le=1.0,
        description="share of variables taken from the mutant (the paper gives none)",
    )


class Hide(HarmonyMatcher[HideConfig]):
    """Harmony search and differential evolution in turn over the window."""

    Config = HideConfig
    summary = "harmony search improved by differential evolution (paper, section 5)"
    kernel = staticmethod(hide_search)
    kernel_all = staticmethod(hide_search_all)

    @property
    def budget(self) -> int:
        """See `HideConfig.evaluations`."""
        return self.config.evaluations

    def settings(self, window: SearchWindow) -> tuple[*HarmonySettings, int, float, float, float, int]:
        """What `hide_search` is told of the search."""
        config = self.config
        return (
            *self.harmony_settings(window),
            config.harmony_run,
            config.attraction,
            WIDE_WEIGHT if self.is_wide(window) else config.weight,
            config.crossover_rate,
            config.patience,
        )
