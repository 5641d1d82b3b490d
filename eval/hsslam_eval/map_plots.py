"""The figures of SLAM runs: trajectories with their loops, and maps. Every function returns a `Figure` of one panel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from hsslam.mapping.occupancy import OccupancyGrid
from hsslam_eval.comparison import SlamOutcome
from hsslam_eval.panels import DPI, legend_below, panel
from hsslam_eval.style import Style

_UNKNOWN = 0.2
# Neither is a matcher's colour, and they differ in print without colours too.
_ACCEPTED: dict[str, Any] = {"color": "#000000", "linestyle": "-"}
_REJECTED: dict[str, Any] = {"color": "#e0007a", "linestyle": (0, (2, 1.5))}
Limits = tuple[float, float, float, float]


def trajectory(label: str, slam: SlamOutcome, look: Style, limits: Limits) -> Figure:
    """The robot's way by one matcher over the true one, or over odometry where truth is not known; its loops."""
    figure, axes = panel(4.6, _map_height(4.6, limits) + 0.6)
    reference, path = _xy(slam.reference_path), _xy(slam.path)
    name = "truth" if slam.reference_kind == "truth" else "odometry alone"
    pattern: Any = "-" if slam.reference_kind == "truth" else (0, (2, 2))
    axes.plot(reference[:, 0], reference[:, 1], color="#b0b0b0", linewidth=3.0, linestyle=pattern, label=name)
    axes.plot(path[:, 0], path[:, 1], color=look.colour, linewidth=1.1, label=label)
    # Thousands of loops would hide the rest: the more there are, the thinner.
    width = float(np.clip(12.0 / math.sqrt(max(len(slam.loops), 1)), 0.2, 0.8))
    for accepted, look_of_loops in ((False, _REJECTED), (True, _ACCEPTED)):
        loops = [(loop.first, loop.second) for loop in slam.loops if loop.accepted is accepted]
        if loops:
            axes.add_collection(LineCollection(loops, linewidths=width, zorder=1.5, **look_of_loops))
    if len(path):
        axes.plot(*path[0], marker="o", color="black", markersize=5, linestyle="none", label="start")
    _metres(axes, limits)
    for accepted, look_of_loops, name in ((True, _ACCEPTED, "accepted"), (False, _REJECTED, "rejected")):
        count = sum(loop.accepted is accepted for loop in slam.loops)
        if slam.loops:
            axes.add_line(Line2D([], [], linewidth=1.2, label=f"loop {name} ({count})", **look_of_loops))
    legend_below(figure, axes, 2)
    return figure


def trajectory_limits(outcomes: Sequence[SlamOutcome]) -> Limits:
    """Axes for all trajectories: what the truth spans, or else the estimates (`common_limits`)."""
    boxes = []
    for slam in outcomes:
        points = _xy(slam.reference_path if slam.reference_kind == "truth" else slam.path)
        if len(points):
            (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
            boxes.append((float(x0), float(y0), float(x1), float(y1)))
    return common_limits(boxes)


def common_limits(boxes: Sequence[Limits]) -> Limits:
    """Axes for all panels: the median of their boxes with a margin (m).

    The median, since one matcher that lost its way must not shrink the others to a dot.
    """
    if not boxes:
        return (-1.0, -1.0, 1.0, 1.0)
    x0, y0, x1, y1 = np.median(np.array(boxes), axis=0)
    margin = 0.04 * max(x1 - x0, y1 - y0) + 0.3
    return (float(x0 - margin), float(y0 - margin), float(x1 + margin), float(y1 + margin))


def occupied_box(grid: OccupancyGrid) -> Limits:
    """Where the occupied cells are, but for a stray half of a hundredth at each side (m)."""
    rows, columns = np.nonzero(grid.log_odds > 0.0)
    if len(rows) == 0:
        left, right, low, high = grid.extent
        return (left, low, right, high)
    share = (0.005, 0.995)
    (left, right), (low, high) = np.quantile(columns, share), np.quantile(rows, share)
    x, y = float(grid.origin[0]), float(grid.origin[1])
    side = grid.resolution
    return (x + left * side, y + low * side, x + (right + 1) * side, y + (high + 1) * side)


def grid_map(
    grid: OccupancyGrid, limits: Limits, path: NDArray[np.float64] | None = None, colour: str = "black"
) -> Figure:
    """Draw an occupancy grid: black where occupied, white where free, grey where unknown; on it the robot's way.

    Parameters
    ----------
    grid : OccupancyGrid
        The map.
    limits : tuple
        Of the axes: left, bottom, right, top (m).
    path : float64 (N, 2), optional
        Places (m) in the frame of the map.
    colour : str
        Of the way.
    """
    figure, axes = panel(4.6, _map_height(4.6, limits))
    # Cells finer than the picture's dots are joined, a wall winning over free space, or thin walls would fade.
    cells = (limits[2] - limits[0]) / grid.resolution
    step = max(1, math.ceil(cells / (3.8 * DPI)))
    shade = np.select([grid.log_odds > 0.0, grid.log_odds < 0.0], [1.0, 0.0], -1.0)
    rows, columns = shade.shape
    shade = np.pad(shade, ((0, -rows % step), (0, -columns % step)), constant_values=-1.0)
    shade = shade.reshape(shade.shape[0] // step, step, shade.shape[1] // step, step).max(axis=(1, 3))
    shade[shade < 0.0] = _UNKNOWN
    x, y, side = float(grid.origin[0]), float(grid.origin[1]), step * grid.resolution
    extent = (x, x + shade.shape[1] * side, y, y + shade.shape[0] * side)
    axes.imshow(
        shade, cmap="gray_r", vmin=0.0, vmax=1.0, origin="lower", extent=extent, interpolation="nearest"
    )
    axes.set_facecolor(str(1.0 - _UNKNOWN))
    if path is not None:
        axes.plot(path[:, 0], path[:, 1], color=colour, linewidth=0.5, alpha=0.8)
    _metres(axes, limits)
    return figure


def _metres(axes: Axes, limits: Limits) -> None:
    x0, y0, x1, y1 = limits
    axes.set_aspect("equal")
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")


def _map_height(width: float, limits: Limits) -> float:
    x0, y0, x1, y1 = limits
    return 0.6 + float(np.clip((width - 0.7) * (y1 - y0) / (x1 - x0), 1.2, 2.0 * width))


def _xy(points: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)
