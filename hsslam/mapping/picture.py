"""Pictures of maps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hsslam.io.atomic import atomic_path
from hsslam.mapping.occupancy import OccupancyGrid
from hsslam.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TRAJECTORY_COLOUR = "#0072b2"
_LOOP_COLOUR = "#d55e00"
_REFUSED_COLOUR = "#cc79a7"
_UNKNOWN_SHADE = 0.80


def write_map_png(
    path: Path | str,
    grid: OccupancyGrid,
    trajectory: Trajectory | None = None,
    loops: NDArray[np.float64] | Sequence[Sequence[float]] | None = None,
    title: str = "",
    *,
    refused: NDArray[np.float64] | Sequence[Sequence[float]] | None = None,
    dpi: int = 120,
) -> None:
    """Draw a map, the way of the robot and its loop closures, into a PNG file; needs no display.

    Parameters
    ----------
    path : path
        The file.
    grid : OccupancyGrid
        The map.
    trajectory : Trajectory, optional
        Robot poses in the map's frame.
    loops : float64 (L, 4), optional
        x1, y1, x2, y2 (m) of the two places that each loop closure ties together.
    title : str
        Over the picture.
    refused : float64 (R, 4), optional
        Of loops that were found and not believed.
    dpi : int
        Pixels per inch of a figure 9 inches wide.

    Raises
    ------
    DataError
        The file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    left, right, bottom, top = grid.extent
    width = 9.0
    height = float(np.clip(width * (top - bottom) / (right - left), 2.0, 14.0)) + 1.4
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    draw_map(axes, grid, trajectory, loops, refused)
    axes.set_title(title)
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, format="png", dpi=dpi)


def draw_map(
    axes: Axes,
    grid: OccupancyGrid,
    trajectory: Trajectory | None = None,
    loops: NDArray[np.float64] | Sequence[Sequence[float]] | None = None,
    refused: NDArray[np.float64] | Sequence[Sequence[float]] | None = None,
) -> None:
    """Draw into axes what `write_map_png` draws, without title and legend (its entries are labelled)."""
    from matplotlib.collections import LineCollection

    # Bytes, resampled before they are coloured: Matplotlib's own choice takes three times as much memory.
    axes.imshow(
        _shades(grid),
        cmap="gray",
        vmin=0,
        vmax=255,
        origin="lower",
        extent=grid.extent,
        interpolation="nearest",
        interpolation_stage="data",
    )
    if trajectory is not None and len(trajectory):
        x, y = trajectory.poses[:, 0], trajectory.poses[:, 1]
        axes.plot(x, y, color=_TRAJECTORY_COLOUR, linewidth=1.0, label="trajectory")
        ends: dict[str, Any] = {"color": _TRAJECTORY_COLOUR, "markeredgecolor": "black", "linestyle": "none"}
        axes.plot(x[:1], y[:1], marker="o", label="start", **ends)
        axes.plot(x[-1:], y[-1:], marker="s", label="end", **ends)
    # Thin and behind the trajectory: a log that comes back often has thousands of ties.
    for label, lines, colour, style in (
        ("loop closures", loops, _LOOP_COLOUR, "solid"),
        ("loops refused", refused, _REFUSED_COLOUR, "dotted"),
    ):
        ties = np.asarray(() if lines is None else lines, dtype=np.float64).reshape(-1, 2, 2)
        if len(ties):
            axes.add_collection(
                LineCollection(
                    list(ties),
                    colors=colour,
                    linestyles=style,
                    linewidths=0.6,
                    alpha=0.7,
                    label=f"{label} ({len(ties)})",
                    zorder=1.5,
                )
            )
    axes.set_xlim(*grid.extent[:2])
    axes.set_ylim(*grid.extent[2:])
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _shades(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """How bright each cell is drawn, (H, W): occupied 0, free 255."""
    shade = np.where(grid.visited, 1.0 - grid.probability, np.float32(_UNKNOWN_SHADE))
    return np.round(255.0 * shade).astype(np.uint8)
