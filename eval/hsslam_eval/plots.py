"""The figures of a report: matplotlib's object API with Agg, so no display and no global state.

Every function returns a `Figure`; each figure has one panel, so that a page can set them side by side or below
one another as its width allows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, PercentFormatter
from numpy.typing import NDArray

from hsslam.mapping.occupancy import OccupancyGrid
from hsslam_eval.comparison import MatcherOutcome, MatcherTrials, SlamOutcome
from hsslam_eval.style import Style

DPI = 144
_GREY = "#6b6b6b"
_UNKNOWN = 0.2
Limits = tuple[float, float, float, float]


def error_distribution(
    errors: Mapping[str, NDArray[np.float64]],
    looks: Mapping[str, Style],
    *,
    quantity: str,
    unit: str,
    threshold: float,
) -> Figure:
    """Share of the trials whose error stays below a value, over all trials.

    Parameters
    ----------
    errors : mapping
        Errors (N,) by matcher, in ``unit``.
    looks : mapping
        `hsslam_eval.style.styles`.
    quantity, unit : str
        For the axis.
    threshold : float
        Of success, in ``unit``.
    """
    figure, axes = _panel(5.2, 4.0)
    positive = [values[values > 0.0] for values in errors.values()]
    pooled = np.concatenate([*positive, [threshold]])
    left = max(float(np.quantile(pooled, 0.01)), threshold * 1e-3) / 1.5
    right = max(float(pooled.max()), threshold) * 1.3
    for label, values in errors.items():
        ordered = np.sort(values[np.isfinite(values)])
        share = np.arange(1, len(ordered) + 1) / max(len(values), 1)
        look = looks[label]
        axes.step(
            np.concatenate(([left], np.maximum(ordered, left), [right])),
            np.concatenate(([0.0], share, share[-1:] if len(share) else [0.0])),
            where="post",
            color=look.colour,
            linestyle=look.line,
            marker=look.marker,
            markersize=5,
            markevery=_marks(len(ordered), list(errors).index(label), len(errors)),
            linewidth=1.6,
            label=label,
        )
    axes.axvline(threshold, color=_GREY, linewidth=1.0, label=f"success: < {threshold:.3g}{_gap(unit)}")
    _log_axis(axes, left, right)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel(f"{quantity} error ({unit})")
    axes.set_ylabel("share of all trials (%)")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
    _legend_below(figure, axes)
    return figure


def success_ratios(
    trials: Mapping[str, MatcherTrials], looks: Mapping[str, Style], confidence: float
) -> Figure:
    """Success ratio of each matcher, by the first definition of success, with its interval."""
    figure, axes = _panel(5.2, 0.8 + 0.42 * len(trials))
    for row, (label, outcome) in enumerate(trials.items()):
        ratio, look = outcome.successes[0].ratio, looks[label]
        axes.errorbar(
            100.0 * ratio.value,
            row,
            xerr=[[100.0 * (ratio.value - ratio.low)], [100.0 * (ratio.high - ratio.value)]],
            color=look.colour,
            marker=look.marker,
            markersize=7,
            capsize=4,
            linewidth=1.4,
        )
    axes.set_xlabel(f"success ratio with {100.0 * confidence:.3g} % interval (%)")
    _rows(axes, list(trials))
    return figure


def match_times(trials: Mapping[str, MatcherTrials], looks: Mapping[str, Style]) -> Figure:
    """Time per match: box from the 25th to the 75th percentile, line at the median, whiskers 5th to 95th."""
    figure, axes = _panel(5.2, 0.8 + 0.42 * len(trials))
    samples = [_milliseconds(outcome) for outcome in trials.values()]
    boxes = axes.boxplot(
        samples,
        positions=np.arange(len(samples)),
        orientation="horizontal",
        widths=0.55,
        whis=(5, 95),
        showfliers=False,
        patch_artist=True,
        medianprops={"color": "black", "linewidth": 1.8},
    )
    for box, label in zip(boxes["boxes"], trials, strict=True):
        box.set(facecolor="white", edgecolor=looks[label].colour, hatch=looks[label].hatch)
    timed = [sample for sample in samples if len(sample)] or [np.ones(1)]
    low = min(float(np.quantile(sample, 0.05)) for sample in timed)
    high = max(float(np.quantile(sample, 0.95)) for sample in timed)
    _log_axis(axes, min(low / 1.3, high / 8.0), high * 1.3)
    axes.set_xlabel("time per match (ms, log scale)")
    _rows(axes, list(trials))
    return figure


def trajectory(label: str, slam: SlamOutcome, look: Style, limits: Limits) -> Figure:
    """The robot's way by one matcher over the true one, or over odometry where truth is not known."""
    figure, axes = _panel(4.6, _map_height(4.6, limits) + 0.6)
    reference, path = _xy(slam.reference_path), _xy(slam.path)
    name = "truth" if slam.reference_kind == "truth" else "odometry alone"
    pattern: Any = "-" if slam.reference_kind == "truth" else (0, (2, 2))
    axes.plot(reference[:, 0], reference[:, 1], color="#b0b0b0", linewidth=3.0, linestyle=pattern, label=name)
    axes.plot(path[:, 0], path[:, 1], color=look.colour, linewidth=1.1, label=label)
    if len(path):
        axes.plot(*path[0], marker="o", color="black", markersize=5, linestyle="none", label="start")
    _metres(axes, limits)
    _legend_below(figure, axes)
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


def grid_map(grid: OccupancyGrid, limits: Limits) -> Figure:
    """Draw an occupancy grid: black where occupied, white where free, grey where unknown."""
    figure, axes = _panel(4.6, _map_height(4.6, limits))
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
    _metres(axes, limits)
    return figure


def trial_errors(
    matchers: Sequence[MatcherOutcome],
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Displacement errors (cm) and rotation errors (deg) by label, of those that have trials."""
    done = [(matcher.label, matcher.trials.data) for matcher in matchers if matcher.trials is not None]
    return (
        {label: 100.0 * np.asarray(data.displacement_m, dtype=np.float64) for label, data in done},
        {label: np.asarray(data.rotation_deg, dtype=np.float64) for label, data in done},
    )


def _panel(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_axisbelow(True)
    return figure, axes


def _legend_below(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(3, len(labels)),
        frameon=False,
        handlelength=3.2,
    )


def _rows(axes: Axes, labels: Sequence[str]) -> None:
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(True, axis="x", which="major", color="#dddddd", linewidth=0.6)


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


def _marks(samples: int, place: int, matchers: int) -> list[int]:
    # Markers at different heights for different matchers, so that curves on one another still show both.
    share = (np.arange(6) + (place + 0.5) / matchers) / 6.0
    return sorted({int(s * samples) for s in share})


def _log_axis(axes: Axes, left: float, right: float) -> None:
    axes.set_xscale("log")
    axes.set_xlim(left, right)
    decades = math.log10(right / left)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if decades < 3.0 else (1.0,), numticks=20))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())


def _milliseconds(outcome: MatcherTrials) -> NDArray[np.float64]:
    seconds = np.asarray(outcome.data.seconds, dtype=np.float64)
    return 1e3 * np.maximum(seconds[np.isfinite(seconds)], 1e-9)


def _gap(unit: str) -> str:
    return unit if unit == "°" else f" {unit}"


def _xy(points: Sequence[tuple[float, float]]) -> NDArray[np.float64]:
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)
