"""The one interface between scans and poses: everything a plugin may import from here."""

from hsslam.errors import MatcherUnavailableError
from hsslam.matching.interface import Matcher, MatcherConfig, Reference, SearchWindow, clean
from hsslam.matching.registry import MatcherInfo, create, describe, load, names, register
from hsslam.matching.results import Estimate, Matches, MatchResult
from hsslam.se2 import Points, Pose, Poses

__all__ = [
    "Estimate",
    "MatchResult",
    "Matcher",
    "MatcherConfig",
    "MatcherInfo",
    "MatcherUnavailableError",
    "Matches",
    "Points",
    "Pose",
    "Poses",
    "Reference",
    "SearchWindow",
    "clean",
    "create",
    "describe",
    "load",
    "names",
    "register",
]
