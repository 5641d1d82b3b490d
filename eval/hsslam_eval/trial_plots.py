"""The figures of trials. Every function returns a `Figure` of one panel."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter
from numpy.typing import NDArray

from hsslam_eval.comparison import MatcherOutcome, MatcherTrials, Measured
from hsslam_eval.panels import GREY, GRID, legend_below, log_axis, panel, rows
from hsslam_eval.significance import succeeded
from hsslam_eval.statistics import wilson_interval
from hsslam_eval.style import Style

_BINS = 6


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
    figure, axes = panel(5.2, 4.0)
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
    axes.axvline(threshold, color=GREY, linewidth=1.0, label=f"success: < {threshold:.3g}{_gap(unit)}")
    log_axis(axes, left, right)
    axes.set_ylim(0.0, 1.02)
    axes.set_xlabel(f"{quantity} error ({unit})")
    axes.set_ylabel("share of all trials (%)")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))
    axes.grid(True, which="major", color=GRID, linewidth=0.6)
    legend_below(figure, axes)
    return figure


def success_ratios(
    trials: Mapping[str, MatcherTrials], looks: Mapping[str, Style], confidence: float
) -> Figure:
    """Success ratio of each matcher, by the first definition of success, with its interval."""
    figure, axes = panel(5.2, 0.8 + 0.42 * len(trials))
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
    rows(axes, list(trials))
    return figure


def match_times(trials: Mapping[str, MatcherTrials], looks: Mapping[str, Style]) -> Figure:
    """Time per match: box from the 25th to the 75th percentile, line at the median, whiskers 5th to 95th."""
    figure, axes = panel(5.2, 0.8 + 0.42 * len(trials))
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
    log_axis(axes, min(low / 1.3, high / 8.0), high * 1.3)
    axes.set_xlabel("time per match (ms, log scale)")
    rows(axes, list(trials))
    return figure


def success_against(
    trials: Mapping[str, MatcherTrials],
    looks: Mapping[str, Style],
    confidence: float,
    *,
    quantity: str,
    initial: Mapping[str, NDArray[np.float64]],
    unit: str,
) -> Figure:
    """Success ratio against the error of the guess, in bins of as many trials each, with Wilson intervals.

    Parameters
    ----------
    trials, looks : mapping
        By label.
    confidence : float
        Of the intervals.
    quantity, unit : str
        Of the guess's error, for the axis.
    initial : mapping
        Errors of the guesses (N,) by label, in ``unit``.
    """
    figure, axes = panel(5.2, 4.0)
    for place, (label, outcome) in enumerate(trials.items()):
        good, look = succeeded(outcome), looks[label]
        parts = np.array_split(np.argsort(initial[label], kind="stable"), _BINS)
        parts = [part for part in parts if len(part)]
        found = [wilson_interval(int(good[part].sum()), len(part), confidence) for part in parts]
        middle = np.array([float(np.mean(initial[label][part])) for part in parts])
        ratio = np.array([interval.value for interval in found])
        low = ratio - np.array([interval.low for interval in found])
        high = np.array([interval.high for interval in found]) - ratio
        # The bins of all matchers are the same; moved apart a little, their intervals can be told apart.
        width = float(np.ptp(middle)) / _BINS if len(middle) > 1 else 0.0
        axes.errorbar(
            middle + 0.09 * width * (place - 0.5 * (len(trials) - 1)),
            ratio,
            yerr=[low, high],
            color=look.colour,
            linestyle=look.line,
            marker=look.marker,
            markersize=5,
            linewidth=1.4,
            elinewidth=0.8,
            capsize=2,
            label=label,
        )
    axes.set_ylim(-0.02, 1.04)
    axes.set_xlabel(f"{quantity} error of the guess ({unit})")
    axes.set_ylabel("success ratio (%)")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0, symbol=""))
    axes.grid(True, which="major", color=GRID, linewidth=0.6)
    legend_below(figure, axes)
    return figure


@dataclass(frozen=True)
class Point:
    """Cost and error of one matcher, each with the ends of its interval or range."""

    cost: Measured
    error: Measured


def pareto(points: Mapping[str, Point], looks: Mapping[str, Style], *, cost: str, error: str) -> Figure:
    """Error against cost, both logarithmic; a line joins those that no other beats in both.

    Parameters
    ----------
    points, looks : mapping
        By label; a point without a positive cost and error is left out.
    cost, error : str
        Axis labels with units.
    """
    figure, axes = panel(5.2, 4.0)
    shown = {label: point for label, point in points.items() if point.cost.value > 0.0 < point.error.value}
    for label, point in shown.items():
        look = looks[label]
        axes.errorbar(
            point.cost.value,
            point.error.value,
            xerr=_bars(point.cost),
            yerr=_bars(point.error),
            color=look.colour,
            marker=look.marker,
            markersize=8,
            capsize=3,
            elinewidth=1.0,
            linestyle="none",
            label=label,
        )
    front = pareto_front({label: (point.cost.value, point.error.value) for label, point in shown.items()})
    if len(front) > 1:
        way = np.array([(shown[label].cost.value, shown[label].error.value) for label in front])
        axes.plot(
            way[:, 0],
            way[:, 1],
            color=GREY,
            linewidth=1.0,
            linestyle="--",
            zorder=1.0,
            label="no other better in both",
        )
    if shown:
        costs = np.array([(point.cost.low, point.cost.high) for point in shown.values()])
        errors = np.array([(point.error.low, point.error.high) for point in shown.values()])
        log_axis(axes, *_round_ends(costs))
        log_axis(axes, *_round_ends(errors), vertical=True)
    axes.set_xlabel(cost)
    axes.set_ylabel(error)
    axes.grid(True, which="major", color=GRID, linewidth=0.6)
    legend_below(figure, axes)
    return figure


def pareto_front(points: Mapping[str, tuple[float, float]]) -> list[str]:
    """Labels of the points that no other beats in both coordinates, by the first coordinate."""
    front: list[str] = []
    lowest = math.inf
    for label, (_, value) in sorted(points.items(), key=lambda item: item[1]):
        if value < lowest:
            front.append(label)
            lowest = value
    return front


def trial_errors(
    matchers: Sequence[MatcherOutcome],
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Displacement errors (cm) and rotation errors (deg) by label, of those that have trials."""
    done = [(matcher.label, matcher.trials.data) for matcher in matchers if matcher.trials is not None]
    return (
        {label: 100.0 * np.asarray(data.displacement_m, dtype=np.float64) for label, data in done},
        {label: np.asarray(data.rotation_deg, dtype=np.float64) for label, data in done},
    )


def _marks(samples: int, place: int, matchers: int) -> list[int]:
    # Markers at different heights for different matchers, so that curves on one another still show both.
    share = (np.arange(6) + (place + 0.5) / matchers) / 6.0
    return sorted({int(s * samples) for s in share})


def _milliseconds(outcome: MatcherTrials) -> NDArray[np.float64]:
    seconds = np.asarray(outcome.data.seconds, dtype=np.float64)
    return 1e3 * np.maximum(seconds[np.isfinite(seconds)], 1e-9)


def _gap(unit: str) -> str:
    return unit if unit == "°" else f" {unit}"


def _bars(found: Measured) -> list[list[float]]:
    return [[max(0.0, found.value - found.low)], [max(0.0, found.high - found.value)]]


def _round_ends(values: NDArray[np.float64]) -> tuple[float, float]:
    positive = values[np.isfinite(values) & (values > 0.0)]
    low, high = float(positive.min()), float(positive.max())
    # At least from half to double, so that a small difference does not fill the picture.
    middle = math.sqrt(low * high)
    return min(low / 1.3, middle / 2.0), max(high * 1.3, middle * 2.0)
