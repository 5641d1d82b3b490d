"""A map that is shown while it grows: in a window, or as a recording to look at later.

A viewer is a process of its own, fed through a pipe. It may be slow, be closed or crash: the run that feeds it
neither waits for it nor changes its results.

>>> with LiveMap(slam) as live:  # doctest: +SKIP
...     for scan in scans:
...         live.update(slam.process(scan), scan)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hsslam.live.feed import LiveMap
    from hsslam.live.viewers import VIEWERS, require_viewer

__all__ = ["VIEWERS", "LiveMap", "require_viewer"]

# Loaded when used: a viewer's process is in this package too, and needs nothing of what a run needs.
_HOMES = {
    "LiveMap": "hsslam.live.feed",
    "VIEWERS": "hsslam.live.viewers",
    "require_viewer": "hsslam.live.viewers",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'hsslam.live' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
