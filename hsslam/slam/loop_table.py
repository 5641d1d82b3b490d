"""Every loop that was tried, as a table: what was found, what was thought of it, why it was refused."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

from hsslam.io.atomic import atomic_path
from hsslam.slam.events import LoopChecked

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
