"""Which figures a report shows, drawn and encoded."""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from matplotlib.figure import Figure

from hsslam.mapping.rosmap import read_rosmap
from hsslam_eval import plots
from hsslam_eval.comparison import Comparison
from hsslam_eval.style import Style, styles


@dataclass(frozen=True)
class Picture:
    """A figure as PNG.

    Parameters
    ----------
    key : str
        Its file's stem.
    caption : str
        What it shows.
    png : bytes
        The image.
    width, height : int
        Its size in CSS pixels.
    """

    key: str
    caption: str
    png: bytes
    width: int
    height: int

    @property
    def base64(self) -> str:
        """The image as a data URL wants it."""
        return base64.b64encode(self.png).decode("ascii")


def trial_pictures(comparison: Comparison) -> list[Picture]:
    """Success ratios, distributions of both errors, time per match."""
    trials = {m.label: m.trials for m in comparison.matchers if m.trials is not None}
    if not trials:
        return []
    looks = _looks(comparison)
    displacement, rotation = plots.trial_errors(comparison.matchers)
    success = next(iter(trials.values())).successes[0]
    confidence = float(comparison.config["trials"]["confidence"])
    both = f"{100.0 * success.displacement_limit_m:.3g} cm and {success.rotation_limit_deg:.3g}°"
    return [
        _picture(
            "success",
            f"Success ratio: share of trials with errors below {both}, and its {100.0 * confidence:.3g} % interval.",
            plots.success_ratios(trials, looks, confidence),
        ),
        _picture(
            "time",
            "Time per match: line at the median, box from the 25th to the 75th percentile, whiskers from the 5th "
            "to the 95th. Log scale.",
            plots.match_times(trials, looks),
        ),
        _picture(
            "displacement",
            "Displacement error: share of all trials whose error is below a value. Further up and left is better.",
            plots.error_distribution(
                displacement,
                looks,
                quantity="displacement",
                unit="cm",
                threshold=100.0 * success.displacement_limit_m,
            ),
        ),
        _picture(
            "rotation",
            "Rotation error: share of all trials whose error is below a value. Further up and left is better.",
            plots.error_distribution(
                rotation, looks, quantity="rotation", unit="°", threshold=success.rotation_limit_deg
            ),
        ),
    ]


def trajectory_pictures(comparison: Comparison) -> list[Picture]:
    """One panel a matcher, all of the same place at the same scale."""
    runs = {m.label: m.slam for m in comparison.matchers if m.slam is not None}
    looks = _looks(comparison)
    limits = plots.trajectory_limits(list(runs.values()))
    return [
        _picture(
            f"trajectory-{label}",
            f"{label}: estimated trajectory over {_reference(slam.reference_kind)}{_astray(slam.path, limits)}.",
            plots.trajectory(label, slam, looks[label], limits),
        )
        for label, slam in runs.items()
    ]


def map_pictures(comparison: Comparison, folder: Path) -> list[Picture]:
    """One panel a matcher whose run folder holds a map, all of the same place at the same scale."""
    maps = {}
    for matcher in comparison.matchers:
        # A report written away from the run folders goes without their maps.
        if matcher.slam is not None and (folder / matcher.slam.folder / "map.yaml").is_file():
            maps[matcher.label] = read_rosmap(folder / matcher.slam.folder / "map.yaml")
    if not maps:
        return []
    limits = plots.common_limits([plots.occupied_box(grid) for grid in maps.values()])
    return [
        _picture(
            f"map-{label}",
            f"{label}: map, cells of {100.0 * grid.resolution:.3g} cm.",
            plots.grid_map(grid, limits),
        )
        for label, grid in maps.items()
    ]


def _looks(comparison: Comparison) -> dict[str, Style]:
    return styles([matcher.label for matcher in comparison.matchers])


def _reference(kind: str) -> str:
    return "the true one" if kind == "truth" else "odometry alone"


def _astray(path: list[tuple[float, float]], limits: plots.Limits) -> str:
    x0, y0, x1, y1 = limits
    outside = sum(not (x0 <= x <= x1 and y0 <= y <= y1) for x, y in path)
    if not outside:
        return ""
    return f"; {math.ceil(100.0 * outside / len(path))} % of it lies outside the picture"


def _picture(key: str, caption: str, figure: Figure) -> Picture:
    buffer = BytesIO()
    # No date or version inside: the same comparison gives the same bytes.
    figure.savefig(buffer, format="png", metadata={"Software": None})
    width, height = figure.get_size_inches()
    return Picture(key, caption, buffer.getvalue(), round(96 * width), round(96 * height))
