"""What the experiments' figures share: one look, legends outside, curves told apart in grey."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from hsslam_eval.reproduce.experiment import Value
from hsslam_eval.style import Style, styles

DPI = 144
GREY = "#6b6b6b"


def panels(
    columns: int = 1, rows: int = 1, *, width: float = 5.6, height: float = 4.2
) -> tuple[Figure, list[Axes]]:
    """Make a figure and its axes, row by row; sizes (in) are of one panel."""
    figure = Figure(
        figsize=(width * columns, height * rows), dpi=DPI, layout="constrained", facecolor="white"
    )
    FigureCanvasAgg(figure)
    axes = [figure.add_subplot(rows, columns, place + 1) for place in range(rows * columns)]
    for each in axes:
        plain(each)
    return figure, axes


def plain(axes: Axes) -> None:
    """No frame above and right, a faint grid behind the data."""
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.set_axisbelow(True)
    axes.grid(True, which="major", color="#dddddd", linewidth=0.6)


def legend_below(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """One legend below all panels, from the labels of one of them."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=min(columns, len(labels)),
        frameon=False,
        handlelength=3.4,
    )


def curves(
    axes: Axes,
    x: ArrayLike,
    lines: Mapping[str, NDArray[np.float64]],
    looks: Mapping[str, Style] | None = None,
) -> None:
    """Draw a line per label over the same ``x``, marked at places that differ from line to line."""
    looks = looks if looks is not None else styles(list(lines))
    steps = np.asarray(x)
    for place, (label, y) in enumerate(lines.items()):
        look = looks[label]
        share = (np.arange(6) + (place + 0.5) / len(lines)) / 6.0
        axes.plot(
            steps[: len(y)],
            y,
            color=look.colour,
            linestyle=look.line,
            marker=look.marker,
            markersize=5,
            markevery=sorted({int(s * len(y)) for s in share}),
            linewidth=1.6,
            label=label,
        )


def with_intervals(
    axes: Axes, x: Sequence[float], lines: Mapping[str, Sequence[Value]], shift: float = 0.0
) -> None:
    """Draw measured values with their intervals, a line per label; ``shift`` keeps the bars of two apart."""
    looks = styles(list(lines))
    for place, (label, values) in enumerate(lines.items()):
        look = looks[label]
        y = np.array([value.value for value in values])
        below = np.array([value.value - value.low for value in values])
        above = np.array([value.high - value.value for value in values])
        axes.errorbar(
            np.asarray(x) + shift * (place - (len(lines) - 1) / 2.0),
            y,
            yerr=[below, above],
            color=look.colour,
            linestyle=look.line,
            marker=look.marker,
            markersize=6,
            capsize=3,
            linewidth=1.4,
            label=label,
        )
