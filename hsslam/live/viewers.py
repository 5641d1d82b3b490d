"""Which viewers there are, and which of them can show something here."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from hsslam.errors import ConfigError, HsslamError, UnavailableError

AUTO = "auto"
RERUN = "rerun"
MATPLOTLIB = "matplotlib"

VIEWERS = {
    AUTO: "rerun if it is installed, else matplotlib",
    RERUN: "the viewer of rerun-sdk; without a display a recording to open later",
    MATPLOTLIB: "a plain window; needs a display",
}
"""Names and what they stand for."""

INSTALL = "pip install 'hsslam[live]'"

NO_DISPLAY = "no display"


class ViewerError(HsslamError):
    """A viewer cannot show anything, or not any more."""


@dataclass(frozen=True)
class Choice:
    """What will show the map.

    Parameters
    ----------
    viewer : str or None
        ``rerun`` or ``matplotlib``; None where nothing can.
    recording : path, optional
        The file that the viewer writes instead of opening a window.
    remark : str
        What the user should know; empty where what was wished for is done.
    """

    viewer: str | None
    recording: Path | None = None
    remark: str = ""


def rerun_installed() -> bool:
    """Whether there is rerun-sdk; it is not imported, which takes a second."""
    return find_spec("rerun") is not None


def display() -> str:
    """The display that windows open on; empty where there is none.

    On Linux an X or a Wayland display is named in the environment; elsewhere a session has one.
    """
    if sys.platform.startswith("linux"):
        return os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") or ""
    return sys.platform


def require_viewer(name: str) -> None:
    """Check that a viewer's name is known and that what it needs is installed.

    Raises
    ------
    ConfigError
        No viewer has this name.
    UnavailableError
        The extra ``live`` is not installed.
    """
    if name not in VIEWERS:
        raise ConfigError(f"the viewer is one of {', '.join(VIEWERS)}, found {name!r}")
    if name == RERUN and not rerun_installed():
        raise UnavailableError(RERUN, "rerun-sdk is not installed", INSTALL, "viewer")


def choose(name: str, recording: Path | None = None) -> Choice:
    """Decide what shows the map.

    Parameters
    ----------
    name : str
        One of `VIEWERS`.
    recording : path, optional
        Where rerun may record to if there is no display.

    Raises
    ------
    ConfigError, UnavailableError
        As `require_viewer`.
    """
    require_viewer(name)
    viewer = name if name != AUTO else RERUN if rerun_installed() else MATPLOTLIB
    if display():
        return Choice(viewer)
    if viewer == RERUN and recording is not None:
        return Choice(
            viewer, recording, f"{NO_DISPLAY}; recorded instead, to look at later: rerun {recording}"
        )
    # Some of matplotlib's backends need no display of this machine; who names one knows.
    if viewer == MATPLOTLIB and os.environ.get("MPLBACKEND"):
        return Choice(viewer)
    hint = "" if name == MATPLOTLIB or rerun_installed() else f" (a recording needs {INSTALL})"
    return Choice(None, remark=f"{NO_DISPLAY}, so no window; the run goes on without it{hint}")
