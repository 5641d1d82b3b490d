"""HSL: localisation by harmony search (paper, section 4)."""

from __future__ import annotations

from pydantic import Field

from hsslam.matching import SearchWindow
from hsslam.search import harmony_search, harmony_search_all
from hsslam_plugins.harmony import HarmonyConfig, HarmonyMatcher, HarmonySettings


class HslConfig(HarmonyConfig):
    """Parameters of HSL."""

    improvisations: int = Field(default=250, ge=1, description="new harmonies made (NI)")


class Hsl(HarmonyMatcher[HslConfig]):
    """Harmony search over the window."""

    Config = HslConfig
    summary = "harmony search (paper, section 4)"
    kernel = staticmethod(harmony_search)
    kernel_all = staticmethod(harmony_search_all)

    @property
    def budget(self) -> int:
        """See `HslConfig.improvisations`."""
        return self.config.improvisations

    def settings(self, window: SearchWindow) -> tuple[*HarmonySettings, int]:
        """What `harmony_search` is told of the search."""
        return (*self.harmony_settings(window), self.config.patience)
