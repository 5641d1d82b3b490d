"""What every figure of a report is made of: a panel, a legend under it, rows, logarithmic axes.

matplotlib's object API with Agg, so no display and no global state. Each figure has one panel, so that a page can set
them side by side or below one another as its width allows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

DPI = 144
GREY = "#6b6b6b"
GRID = "#dddddd"


def panel(width: float, height: float) -> tuple[Figure, Axes]:
    """Make a figure of one panel, its size in inches."""
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_axisbelow(True)
    return figure, axes


def legend_below(figure: Figure, axes: Axes, columns: int = 3) -> None:
    """Put the legend under the panel, in so many columns; a marker's shape is seen without its error bars."""
    drawn, labels = axes.get_legend_handles_labels()
    handles = [handle[0] if isinstance(handle, ErrorbarContainer) else handle for handle in drawn]
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(columns, len(labels)),
        frameon=False,
        handlelength=3.2,
    )


def rows(axes: Axes, labels: Sequence[str]) -> None:
    """Make the vertical axis one of labelled rows, the first on top."""
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.grid(True, axis="x", which="major", color=GRID, linewidth=0.6)


def log_axis(axes: Axes, low: float, high: float, *, vertical: bool = False) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks."""
    if vertical:
        axes.set_yscale("log")
        axes.set_ylim(low, high)
    else:
        axes.set_xscale("log")
        axes.set_xlim(low, high)
    axis: Axis = axes.yaxis if vertical else axes.xaxis
    subs = (1.0, 2.0, 5.0) if math.log10(high / low) < 3.0 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=20))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
