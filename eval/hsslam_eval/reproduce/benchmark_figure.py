"""Convergence of the searches on benchmark functions: a figure per number of variables."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from hsslam_eval.reproduce import drawing
from hsslam_eval.reproduce.benchmark_runs import SOLVED, BenchmarksResult, Problem
from hsslam_eval.reproduce.contestants import HIDE
from hsslam_eval.reproduce.experiment import Drawing
from hsslam_eval.style import Style, styles

_HIDE = Style("#000000", "-", "*", "")
"""The one all others are set against stands out."""


def draw(result: BenchmarksResult, dimension: int) -> Drawing:
    """Error over evaluations in so many variables, a panel per function."""
    problems = [problem for problem in result.problems if problem.dimension == dimension]
    columns = min(3, len(problems))
    figure, axes = drawing.panels(columns, -(-len(problems) // columns), width=4.8, height=4.0)
    for panel in axes[len(problems) :]:
        panel.set_visible(False)
    for place, (panel, problem) in enumerate(zip(axes, problems, strict=False)):
        _panel(panel, result, problem)
        if place >= len(problems) - columns:
            panel.set_xlabel("evaluations")
        if place % columns == 0:
            panel.set_ylabel("median error")
    drawing.legend_below(figure, axes[0])
    return Drawing(
        f"convergence-{dimension}",
        f"{dimension} variables: error of the best point so far (its value less the minimum's) over evaluations, "
        f"median of {result.size.runs} runs; the band is HIDE's first to third quartile. Errors under {SOLVED:g} are "
        "drawn there.",
        figure,
    )


def _panel(panel: Axes, result: BenchmarksResult, problem: Problem) -> None:
    looks = {**styles([other.label for other in result.others]), HIDE: _HIDE}
    evaluations = result.shares * result.size.evaluations_per_dimension * problem.dimension
    low, middle, high = np.maximum(result.quartiles[problem], SOLVED)
    place = result.labels.index(HIDE)
    panel.fill_between(evaluations, low[place], high[place], color=_HIDE.colour, alpha=0.13, linewidth=0.0)
    drawing.curves(panel, evaluations, dict(zip(result.labels, middle, strict=True)), looks)
    panel.lines[place].set(linewidth=2.4, markersize=9, zorder=3)
    panel.set_yscale("log")
    panel.set_xlim(0.0, 1.02 * evaluations[-1])
    panel.set_title(problem.function.title, fontsize=11)
