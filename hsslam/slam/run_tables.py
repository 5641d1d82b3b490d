"""Tables of a run: every loop that was tried and what was thought of it; how well every keyframe is known."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from hsslam.io.atomic import atomic_path
from hsslam.slam.events import LoopChecked, SlamResult

COLUMNS = (
    "first",
    "second",
    "accepted",
    "reason",
    "x",
    "y",
    "theta",
    "std_x",
    "std_y",
    "std_theta",
    "score",
    "expected_std",
    "surprise",
    "agreeing",
    "ambiguity",
    "evaluations",
)
"""Of a loop's row; `hsslam.slam.events.LoopChecked` says what they mean (m, rad)."""


def write_loops(path: Path | str, loops: Sequence[LoopChecked]) -> None:
    """Write loops, accepted and refused, into a CSV file, one per row, in the order of their verdicts."""
    with (
        atomic_path(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        table = csv.writer(file, lineterminator="\n")
        table.writerow(COLUMNS)
        for loop in loops:
            stds = (math.sqrt(max(float(loop.covariance[k, k]), 0.0)) for k in range(3))
            table.writerow(
                (
                    loop.first,
                    loop.second,
                    int(loop.accepted),
                    loop.reason,
                    *(f"{value:.6f}" for value in (*loop.relative, *stds)),
                    f"{loop.score:.4f}",
                    f"{loop.expected_std:.4f}",
                    f"{loop.surprise:.3f}",
                    loop.agreeing,
                    f"{loop.ambiguity:.4f}",
                    loop.evaluations,
                )
            )


def write_covariances(path: Path | str, result: SlamResult) -> None:
    """Write the covariances of the keyframes' poses, upper triangles in the axes of the map, into a CSV file."""
    assert result.covariances is not None
    with (
        atomic_path(path) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("keyframe", "scan", "xx", "xy", "xtheta", "yy", "ytheta", "thetatheta"))
        rows = zip(result.keyframes, result.covariances, strict=True)
        for keyframe, (scan, c) in enumerate(rows):
            triangle = (c[0, 0], c[0, 1], c[0, 2], c[1, 1], c[1, 2], c[2, 2])
            table.writerow((keyframe, scan.index, *(f"{value:.6e}" for value in triangle)))
