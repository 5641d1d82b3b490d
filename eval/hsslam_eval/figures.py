"""Which figures a report shows, drawn and encoded."""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Literal

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from hsslam.io.tum import read_tum
from hsslam.mapping.rosmap import read_rosmap
from hsslam_eval import map_plots, trial_plots
from hsslam_eval.comparison import Comparison, Measured, SlamOutcome
from hsslam_eval.slam_tables import figures_of
from hsslam_eval.style import Style, styles

FORMATS = ("png", "svg", "pdf")


@dataclass(frozen=True)
class Picture:
    """A figure, drawn in every format.

    Parameters
    ----------
    key : str
        Its files' stem.
    caption : str
        What it shows.
    files : dict
        Its bytes by format: those of `FORMATS`.
    shown : str
        The format that the page shows.
    width, height : int
        Its size in CSS pixels.
    """

    key: str
    caption: str
    files: dict[str, bytes]
    shown: Literal["png", "svg"]
    width: int
    height: int

    @property
    def url(self) -> str:
        """The image as a data URL."""
        kind = "image/svg+xml" if self.shown == "svg" else "image/png"
        return f"data:{kind};base64,{base64.b64encode(self.files[self.shown]).decode('ascii')}"


def trial_pictures(comparison: Comparison, prefix: str) -> list[Picture]:
    """Success and time, error against time, distributions of both errors, success against the guess's errors."""
    trials = {m.label: m.trials for m in comparison.matchers if m.trials is not None}
    if not trials:
        return []
    looks = _looks(comparison)
    displacement, rotation = trial_plots.trial_errors(comparison.matchers)
    success = next(iter(trials.values())).successes[0]
    confidence = float(comparison.config["trials"]["confidence"])
    percent = f"{100.0 * confidence:.3g} %"
    both = f"{100.0 * success.displacement_limit_m:.3g} cm and {success.rotation_limit_deg:.3g}°"
    points = {
        label: trial_plots.Point(
            _scaled(found.seconds.median, 1e3), _scaled(found.displacement_all_m.median, 100.0)
        )
        for label, found in trials.items()
        # The error of one that never answered is that of the guess; as a point it would be the cheapest of all.
        if sum(found.unanswered.values()) < found.count
    }
    mute = [label for label in trials if label not in points]
    absent = f" Not shown, because it never gave an answer: {', '.join(mute)}." if mute else ""
    guess = {
        label: np.array(found.data.initial_displacement_m, dtype=np.float64) * 100.0
        for label, found in trials.items()
    }
    turn = {
        label: np.array(found.data.initial_rotation_deg, dtype=np.float64) for label, found in trials.items()
    }
    bins = f"Bins of as many trials each; bars: {percent} Wilson intervals. Success: below {both}."
    return [
        _picture(
            f"{prefix}-success",
            f"Success ratio: share of trials with errors below {both}, and its {percent} interval.",
            trial_plots.success_ratios(trials, looks, confidence),
        ),
        _picture(
            f"{prefix}-time",
            "Time per match: line at the median, box from the 25th to the 75th percentile, whiskers from the 5th "
            "to the 95th. Log scale.",
            trial_plots.match_times(trials, looks),
        ),
        _picture(
            f"{prefix}-pareto",
            f"Error against time: median displacement error over all trials and median time per match, with {percent} "
            f"bootstrap intervals. Further down and left is better; log scales.{absent}",
            trial_plots.pareto(
                points,
                looks,
                cost="time per match, median (ms)",
                error="displacement error, median (cm)",
            ),
        ),
        _picture(
            f"{prefix}-displacement",
            "Displacement error: share of all trials whose error is below a value. Further up and left is better.",
            trial_plots.error_distribution(
                displacement,
                looks,
                quantity="displacement",
                unit="cm",
                threshold=100.0 * success.displacement_limit_m,
            ),
        ),
        _picture(
            f"{prefix}-rotation",
            "Rotation error: share of all trials whose error is below a value. Further up and left is better.",
            trial_plots.error_distribution(
                rotation, looks, quantity="rotation", unit="°", threshold=success.rotation_limit_deg
            ),
        ),
        _picture(
            f"{prefix}-success-displacement",
            f"Success against the displacement error of the guess. {bins}",
            trial_plots.success_against(
                trials, looks, confidence, quantity="displacement", initial=guess, unit="cm"
            ),
        ),
        _picture(
            f"{prefix}-success-rotation",
            f"Success against the rotation error of the guess. {bins}",
            trial_plots.success_against(
                trials, looks, confidence, quantity="rotation", initial=turn, unit="°"
            ),
        ),
    ]


def slam_pictures(comparison: Comparison, prefix: str) -> list[Picture]:
    """Error against wall time, where both are known of two runs at least."""
    points = {}
    error = ""
    for matcher in comparison.matchers:
        errors = [found for run in matcher.runs if (found := _error(run))]
        seconds = [run.wall_seconds for run in matcher.runs if math.isfinite(run.wall_seconds)]
        if errors and seconds:
            error = errors[0][0]
            points[matcher.label] = trial_plots.Point(_range(seconds), _range([value for _, value in errors]))
    if len(points) < 2:
        return []
    several = any(len(matcher.runs) > 1 for matcher in comparison.matchers)
    return [
        _picture(
            f"{prefix}-slam-pareto",
            "SLAM, error against time: further down and left is better; log scales."
            + (" Mean over the seeds, bars from the smallest to the largest." if several else ""),
            trial_plots.pareto(points, _looks(comparison), cost="wall time (s)", error=error),
        )
    ]


def place_pictures(comparison: Comparison, prefix: str, folder: Path) -> list[Picture]:
    """For each matcher its trajectory, and its map where there is one; all at one scale, of its first run."""
    runs = {m.label: m.slam for m in comparison.matchers if m.slam is not None}
    looks = _looks(comparison)
    limits = map_plots.trajectory_limits(list(runs.values()))
    # A report written away from the run folders goes without their maps.
    homes = {label: folder / run.folder for label, run in runs.items() if run.folder}
    maps = {
        label: read_rosmap(home / "map.yaml")
        for label, home in homes.items()
        if (home / "map.yaml").is_file()
    }
    map_limits = map_plots.common_limits([map_plots.occupied_box(grid) for grid in maps.values()])
    pictures = []
    for label, run in runs.items():
        came_to = figures_of(run)
        pictures.append(
            _picture(
                f"{prefix}-trajectory-{label}",
                f"{label}: trajectory over {_reference(run.reference_kind)}{_astray(run.path, limits)}"
                f"{'. ' + came_to if came_to else ''}.",
                map_plots.trajectory(label, run, looks[label], limits),
                # As lines, thousands of loops would make the page many times as large.
                shown="png",
            )
        )
        if label in maps:
            way = homes[label] / "trajectory.tum"
            path = read_tum(way).poses[:, :2] if way.is_file() else None
            pictures.append(
                _picture(
                    f"{prefix}-map-{label}",
                    f"{label}: map, cells of {100.0 * maps[label].resolution:.3g} cm, and the robot's way.",
                    map_plots.grid_map(maps[label], map_limits, path, looks[label].colour),
                    shown="png",
                )
            )
    return pictures


def _error(run: SlamOutcome) -> tuple[str, float] | None:
    if run.accuracy.relations is not None:
        return "relations, mean translation error (m)", run.accuracy.relations["translation_mean_m"]
    if run.accuracy.ate is not None:
        return "ATE rmse (m)", run.accuracy.ate["translation_rmse_m"]
    return None


def _range(values: list[float]) -> Measured:
    return Measured(float(np.mean(values)), min(values), max(values))


def _scaled(found: Measured, scale: float) -> Measured:
    return Measured(scale * found.value, scale * found.low, scale * found.high)


def _looks(comparison: Comparison) -> dict[str, Style]:
    return styles([matcher.label for matcher in comparison.matchers])


def _reference(kind: str) -> str:
    return "the true one" if kind == "truth" else "odometry alone"


def _astray(path: list[tuple[float, float]], limits: map_plots.Limits) -> str:
    x0, y0, x1, y1 = limits
    outside = sum(not (x0 <= x <= x1 and y0 <= y <= y1) for x, y in path)
    if not outside:
        return ""
    return f"; {math.ceil(100.0 * outside / len(path))} % of it lies outside the picture"


_METADATA: dict[str, dict[str, str | None]] = {
    # No date or version inside: the same comparison gives the same bytes.
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


def _picture(key: str, caption: str, figure: Figure, shown: Literal["png", "svg"] = "svg") -> Picture:
    files = {}
    with matplotlib.rc_context({"svg.hashsalt": key}):
        for kind in FORMATS:
            buffer = BytesIO()
            figure.savefig(buffer, format=kind, metadata=_METADATA[kind])
            files[kind] = buffer.getvalue()
            # Laid out once: the places are shares of the figure, and half of the time goes there.
            figure.set_layout_engine(None)
    width, height = figure.get_size_inches()
    return Picture(key, caption, files, shown, round(96 * width), round(96 * height))
