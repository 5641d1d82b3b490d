"""The growing map in a plain window of matplotlib."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hsslam.live.latest import Latest
from hsslam.live.snapshot import Snapshot, placed
from hsslam.live.viewers import ViewerError, display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAUSE = 0.05
"""How long the window's own events are served before the next look for something new (s)."""

MARGIN = 0.05
ROOM = 0.2
"""Left around the finished map, and around one that may still grow, as parts of its size."""

DOT = 5.0
"""Points of the map are smaller than can be made out in a legend."""

COLOURS = {"map": "0.25", "trajectory": "#0072b2", "loops": "#d55e00", "scan": "#009e73"}


class MapDrawing:
    """A figure with a map that can be drawn anew, of a newer snapshot.

    Parameters
    ----------
    figure : Figure
        An empty one.
    title : str
        Over the map.
    """

    def __init__(self, figure: Figure, title: str) -> None:
        from matplotlib.collections import LineCollection
        from matplotlib.lines import Line2D

        self._figure = figure
        axes = self._axes = figure.add_subplot()
        axes.set_aspect(
            "equal", adjustable="box"
        )  # the view changes where `_frame` or the user changes it, only
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.set_title(title, loc="left", fontweight="bold")
        axes.grid(color="0.93")
        axes.set_axisbelow(True)
        self._status = axes.set_title("starting", loc="right", fontsize="medium", color="0.3")
        (self._points,) = axes.plot([], [], linestyle="none", marker="o", markersize=1.2, markeredgewidth=0.0)
        self._points.set(color=COLOURS["map"], label="map")
        self._loops = LineCollection([], colors=COLOURS["loops"], linewidths=0.6, alpha=0.7, label="loops")
        axes.add_collection(self._loops, autolim=False)
        (self._way,) = axes.plot([], [], color=COLOURS["trajectory"], linewidth=1.2, label="trajectory")
        (self._scan,) = axes.plot([], [], linestyle="none", marker="o", markersize=2.2, markeredgewidth=0.0)
        self._scan.set(color=COLOURS["scan"], label="newest scan")
        (self._robot,) = axes.plot([], [], linestyle="none", marker=(3, 0, 0.0), markersize=11.0)
        self._robot.set(color=COLOURS["trajectory"], markeredgecolor="white", label="robot")
        legend = figure.legend(loc="outside lower center", ncols=5, frameon=False)
        for handle in legend.legend_handles:
            if isinstance(handle, Line2D) and handle.get_markersize() < DOT:
                handle.set_markersize(DOT)
        self._view: NDArray[np.float64] | None = None

    def draw(self, snapshot: Snapshot) -> None:
        """Show another state of the map; where the user has zoomed, the view is left as it is."""
        points = placed(snapshot.points, snapshot.owners, snapshot.poses)
        scan = placed(
            snapshot.scan_points,
            np.zeros(len(snapshot.scan_points), dtype=np.int32),
            snapshot.scan_pose[None, :],
        )
        x, y, theta = snapshot.scan_pose
        self._points.set_data(points[:, 0], points[:, 1])
        self._way.set_data(snapshot.trajectory[:, 0], snapshot.trajectory[:, 1])
        self._loops.set_segments(list(snapshot.ties))
        self._scan.set_data(scan[:, 0], scan[:, 1])
        self._robot.set_data([x], [y])
        self._robot.set(marker=(3, 0, float(np.degrees(theta)) - 90.0))
        self._status.set_text(snapshot.status)
        self._frame(np.concatenate((points, scan, snapshot.trajectory)), final=snapshot.final)

    def _frame(self, everything: NDArray[np.float64], final: bool) -> None:
        """Keep all of the map in view, with room to grow so that the view seldom jumps."""
        axes = self._axes
        view = np.array((axes.get_xlim(), axes.get_ylim())).T
        if self._view is not None and not np.allclose(view, self._view):
            return
        low, high = everything.min(axis=0), everything.max(axis=0)
        if self._view is not None and not final and np.all(view[0] <= low) and np.all(high <= view[1]):
            return
        size = np.maximum(high - low, 1.0) * (1.0 + 2.0 * (MARGIN if final else ROOM))
        box = axes.get_position(original=True)
        shape = np.array((box.width, box.height)) * self._figure.get_size_inches()
        size = np.maximum(size, shape * np.max(size / shape))
        self._view = np.array((0.5 * (low + high - size), 0.5 * (low + high + size)))
        axes.set_xlim(*self._view[:, 0])
        axes.set_ylim(*self._view[:, 1])


def run(inbox: Latest[Snapshot], title: str, recording: str, shown: Callable[[], None]) -> None:
    """Show what comes in until the window is closed.

    Parameters
    ----------
    inbox : Latest of Snapshot
        Where snapshots come in.
    title : str
        Of the window and over the map.
    recording : str
        Not used: this viewer records nothing.
    shown : callable
        Called when the final snapshot is on the screen.

    Raises
    ------
    ViewerError
        No window can be opened; says why.
    """
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=(9.0, 7.0), layout="constrained")
    canvas: Any = figure.canvas
    if canvas.required_interactive_framework is None:
        if named := os.environ.get("MPLBACKEND"):
            raise ViewerError(f"MPLBACKEND={named} opens no window; unset it")
        raise ViewerError(
            f"matplotlib can open no window: there is no display {display()}, "
            "or no toolkit (pip install PyQt6)"
        )
    drawing = MapDrawing(figure, title)
    manager: Any = canvas.manager
    manager.set_window_title(f"hsslam: {title}")
    pyplot.show(block=False)
    while pyplot.fignum_exists(manager.num):
        snapshot = inbox.take(timeout=0.0)
        if snapshot is not None:
            drawing.draw(snapshot)
            canvas.draw()
            if snapshot.final:
                shown()
        canvas.start_event_loop(PAUSE)
