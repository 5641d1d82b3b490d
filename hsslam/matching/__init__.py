"""The one interface between scans and poses: everything a plugin may import from here."""

from hsslam.errors import MatcherUnavailableError
from hsslam.matching.interface import (
    Estimate,
    Matcher,
    MatcherConfig,
    MatchResult,
    Reference,
    SearchWindow,
    clean,
)
from hsslam.matching.registry import MatcherInfo, create, describe, load, names, register
from hsslam.se2 import Points, Pose

__all__ = [
    "Estimate",
    "MatchResult",
    "Matcher",
    "MatcherConfig",
    "MatcherInfo",
    "MatcherUnavailableError",
    "Points",
    "Pose",
    "Reference",
    "SearchWindow",
    "clean",
    "create",
    "describe",
    "load",
    "names",
    "register",
]
