"""What a reader tells apart in the figures: markers in the legend, loops from ways, accepted from rejected."""

from __future__ import annotations

from dataclasses import replace

import matplotlib.colors
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from test_report_page import slam

from hsslam_eval.comparison import Loop, Measured
from hsslam_eval.map_plots import trajectory
from hsslam_eval.style import styles
from hsslam_eval.trial_plots import Point, pareto


def legend(figure: Figure) -> dict[str, Line2D]:
    (box,) = figure.legends
    handles = box.legend_handles
    assert all(isinstance(handle, Line2D) for handle in handles)
    return {text.get_text(): handle for text, handle in zip(box.get_texts(), handles, strict=True)}


def test_the_legend_of_error_against_time_shows_each_marker_by_itself() -> None:
    looks = styles(["a", "b", "c"])
    value = Measured(1.0, 0.9, 1.1)
    points = {label: Point(value, replace(value, value=1.0 + n)) for n, label in enumerate(looks)}
    shown = legend(pareto(points, looks, cost="time (ms)", error="error (cm)"))
    assert {label: line.get_marker() for label, line in shown.items()} == {
        label: look.marker for label, look in looks.items()
    }


def test_loops_look_like_no_matchers_way_and_differ_without_colour() -> None:
    loops = [
        Loop((0.0, 0.0), (1.0, 1.0), True),
        Loop((0.0, 0.0), (2.0, 1.0), False),
    ]
    figure = trajectory(
        "hide", replace(slam("hide"), loops=loops), styles(["hide"])["hide"], (-1.0, -1.0, 3.0, 3.0)
    )
    (axes,) = figure.axes
    drawn = [lines for lines in axes.collections if isinstance(lines, LineCollection)]
    colours = {matplotlib.colors.to_hex(lines.get_color()[0]) for lines in drawn}
    assert len(colours) == 2 and colours.isdisjoint(
        {look.colour for look in styles(list("abcdefg")).values()}
    )
    assert len({str(lines.get_linestyle()) for lines in drawn}) == 2
