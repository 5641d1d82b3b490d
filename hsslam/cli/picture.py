"""The picture of a match: the two scans as they were guessed to lie, and as they were found to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hsslam.io.atomic import atomic_path
from hsslam.se2 import Points, Pose, transform


def write_match_picture(
    path: Path, reference: Points, points: Points, guess: Pose, found: Pose, title: str
) -> None:
    """Draw a match.

    Parameters
    ----------
    path : path
        The file; its suffix says the format (png, svg, pdf).
    reference, points : Points
        (N, 2) and (M, 2) m, each in its own frame.
    guess, found : Pose
        Pose of ``points`` in the frame of ``reference``, before and after.
    title : str
        Over the picture.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 6.4), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    for ax, pose, name in zip(axes, (guess, found), ("guess", "match"), strict=True):
        _draw(ax, reference, transform(pose, points), pose)
        ax.set_title(f"{name}: x {pose[0]:.3f} m, y {pose[1]:.3f} m, {_degrees(pose[2]):.2f}°", fontsize=10)
    axes[0].set_ylabel("y (m)")
    figure.suptitle(title)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=120)


def free_name(path: Path) -> Path:
    """``path``, or the first of ``stem-2``, ``stem-3``... that is not there yet."""
    free, number = path, 1
    while free.exists():
        number += 1
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return free


def _draw(ax: Any, reference: Points, moved: Points, pose: Pose) -> None:
    ax.plot(*reference.T, "s", color="0.65", markersize=4.0, label="reference")
    ax.plot(*moved.T, "o", color="C3", markersize=2.2, label="scan")
    arrow = {"marker": (3, 0, _degrees(pose[2]) - 90.0), "color": "black", "markersize": 9.0}
    ax.plot(pose[0], pose[1], linestyle="", label="pose of the scan", **arrow)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel("x (m)")
    ax.grid(color="0.9")
    ax.set_axisbelow(True)


def _degrees(theta: float) -> float:
    return float(theta) * 57.29577951308232
