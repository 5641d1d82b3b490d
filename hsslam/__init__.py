"""hsslam: 2D laser scan matchers that compete on equal terms and feed one pose graph.

Importing the package is cheap: what is named here is loaded when it is first used, and everything else is
imported from its own module.

>>> from hsslam import match
>>> match(scan_a, scan_b, method="hide").pose  # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hsslam.version import __version__

if TYPE_CHECKING:
    from hsslam.config import Config, load_config
    from hsslam.datasets.catalogue import open_dataset
    from hsslam.matching import MatchResult, SearchWindow
    from hsslam.pair import match
    from hsslam.scan import LaserScan, ScanGeometry
    from hsslam.slam.events import SlamResult
    from hsslam.slam.pipeline import Slam

__all__ = [
    "Config",
    "LaserScan",
    "MatchResult",
    "ScanGeometry",
    "SearchWindow",
    "Slam",
    "SlamResult",
    "__version__",
    "load_config",
    "match",
    "open_dataset",
]

_HOMES = {
    "Config": "hsslam.config",
    "LaserScan": "hsslam.scan",
    "MatchResult": "hsslam.matching",
    "ScanGeometry": "hsslam.scan",
    "SearchWindow": "hsslam.matching",
    "Slam": "hsslam.slam.pipeline",
    "SlamResult": "hsslam.slam.events",
    "load_config": "hsslam.config",
    "match": "hsslam.pair",
    "open_dataset": "hsslam.datasets.catalogue",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'hsslam' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
