"""The figure of Tables 1 and 2: success ratio and error of each method over both windows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from matplotlib.lines import Line2D

from hsslam_eval.reproduce.data import PairSet
from hsslam_eval.reproduce.drawing import GREY, panels
from hsslam_eval.reproduce.duel import SIDES, Bouts, Published
from hsslam_eval.reproduce.experiment import Drawing, Value
from hsslam_eval.reproduce.methods import Method

_MARKERS = {0.20: "o", 0.30: "s"}
_COLOURS = {0.20: "#0072b2", 0.30: "#d55e00"}


def draw(
    bouts: Bouts,
    paper: Mapping[tuple[str, float], Published],
    methods: Sequence[Method],
    pairs: PairSet,
) -> Drawing:
    """Dots with intervals, hollow where the figure is the paper's; a row per method."""
    figure, (left, right) = panels(2, width=5.4, height=1.3 + 0.62 * len(methods))
    for row, method in enumerate(methods):
        for place, side in enumerate(SIDES):
            summary = bouts[method.label, side].result.summary().success["glasm"]
            said = paper.get((method.label, side))
            at = row + 0.26 * (place - 0.5)
            for axes, value, told in (
                (left, Value.of(summary.ratio, 100.0), 100.0 * said.success if said else math.nan),
                (
                    right,
                    Value.of(summary.displacement_m.mean, 100.0),
                    said.displacement if said else math.nan,
                ),
            ):
                axes.errorbar(
                    value.value,
                    at,
                    xerr=[[value.value - value.low], [value.high - value.value]],
                    color=_COLOURS[side],
                    marker=_MARKERS[side],
                    markersize=6,
                    capsize=3,
                    linewidth=1.4,
                )
                axes.plot(
                    told,
                    at,
                    marker=_MARKERS[side],
                    markersize=8,
                    markerfacecolor="white",
                    color=_COLOURS[side],
                )
    for axes, label in (
        (left, "success ratio (%), < 10 cm and < 0.01 rad"),
        (right, "mean displacement error of successes (cm)"),
    ):
        axes.set_yticks(range(len(methods)), [method.label for method in methods] if axes is left else [])
        axes.set_ylim(len(methods) - 0.5, -0.5)
        axes.set_xlabel(label)
    right.set_xlim(left=0.0)
    handles = [
        *(
            Line2D(
                [],
                [],
                color=_COLOURS[s],
                marker=_MARKERS[s],
                linestyle="none",
                label=f"ours, L = {100 * s:.0f} cm",
            )
            for s in SIDES
        ),
        Line2D(
            [],
            [],
            color=GREY,
            marker="o",
            markerfacecolor="white",
            markersize=8,
            linestyle="none",
            label="paper",
        ),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return Drawing(
        f"figure-{pairs.key}",
        f"{pairs.label}: success ratio and displacement error of the successes with 95% intervals; hollow: the "
        "paper's figures, on its own data.",
        figure,
    )
