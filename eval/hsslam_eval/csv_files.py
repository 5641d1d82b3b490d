"""The tables of a report as CSV, at full precision."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hsslam.io.atomic import atomic_path
from hsslam_eval.comparison import Accuracy, MatcherTrials, Measured, SlamOutcome, Spread, Study


def write_csv_files(study: Study, folder: Path) -> list[Path]:
    """Write ``trials.csv``, ``trials_raw.csv`` and ``slam.csv``; a file without a row is not written.

    A matcher that has no result has a row with its ``status`` and nothing else; ``slam.csv`` has a row for each run.
    Numbers are written with all their digits; what does not exist is an empty cell.
    """
    trials: list[dict[str, Any]] = []
    raw: list[dict[str, Any]] = []
    slam: list[dict[str, Any]] = []
    for comparison in study.comparisons:
        for matcher in comparison.matchers:
            whose = {"dataset": comparison.dataset.name, "matcher": matcher.label}
            failures = {failure.stage: failure.reason for failure in matcher.failures}
            gone = failures.get("unavailable")
            if comparison.config.get("run_trials", False):
                status = gone or failures.get("trials", "done")
                row = trials_figures(matcher.trials) if matcher.trials is not None else {}
                trials.append({**whose, "status": status, **row})
            if matcher.trials is not None:
                raw += ({**whose, **row} for row in _raw(matcher.trials))
            if comparison.config.get("run_slam", True):
                slam += ({**whose, "status": "done", **slam_figures(run)} for run in matcher.runs)
                slam += (
                    {**whose, "status": failure.reason, "seed": failure.seed}
                    for failure in matcher.failures
                    if failure.stage in ("slam", "unavailable")
                )
    files = {"trials.csv": trials, "trials_raw.csv": raw, "slam.csv": slam}
    return [write_rows(folder / name, rows) for name, rows in files.items() if rows]


def trials_figures(trials: MatcherTrials) -> dict[str, Any]:
    """Every figure of a matcher's trials, by its column."""
    row: dict[str, Any] = {
        "protocol": trials.protocol,
        "trials": trials.count,
        "unanswered": sum(trials.unanswered.values()),
    }
    for success in trials.successes:
        row[f"{success.name}_displacement_limit_m"] = success.displacement_limit_m
        row[f"{success.name}_rotation_limit_deg"] = success.rotation_limit_deg
        row[f"{success.name}_successes"] = success.count
        row |= _measured(f"{success.name}_ratio", success.ratio)
        row |= _spread(f"{success.name}_displacement", "m", success.displacement_m)
        row |= _spread(f"{success.name}_rotation", "deg", success.rotation_deg)
    row |= _spread("all_displacement", "m", trials.displacement_all_m)
    row |= _spread("all_rotation", "deg", trials.rotation_all_deg)
    row |= _spread("time", "s", trials.seconds)
    row["evaluations_mean"] = trials.evaluations_mean
    return row


def _raw(trials: MatcherTrials) -> Iterator[dict[str, Any]]:
    data = trials.data
    for trial in range(trials.count):
        yield {
            "seed": data.seed[trial],
            "trial": trial,
            "initial_displacement_m": data.initial_displacement_m[trial],
            "initial_rotation_deg": data.initial_rotation_deg[trial],
            "displacement_m": data.displacement_m[trial],
            "rotation_deg": data.rotation_deg[trial],
            "seconds": data.seconds[trial],
            "evaluations": data.evaluations[trial],
            "score": data.score[trial],
            "failure": data.failure[trial],
        }


def slam_figures(slam: SlamOutcome) -> dict[str, Any]:
    """Every figure of a SLAM run, by its column."""
    return {
        "seed": slam.seed,
        "scans": slam.scans,
        "matched": slam.matched,
        "keyframes": slam.keyframes,
        "loops_tried": slam.loops_tried,
        "loops_accepted": slam.loops_accepted,
        "wall_seconds": slam.wall_seconds,
        "cpu_seconds": slam.cpu_seconds,
        "warm_up_seconds": slam.warm_up_seconds,
        "log_seconds": slam.log_seconds,
        "real_time_factor": slam.real_time_factor,
        "peak_memory_mb": slam.peak_memory_mb,
        **_accuracy("", slam.accuracy),
        **_accuracy("odometry_", slam.odometry_accuracy),
    }


def _accuracy(prefix: str, accuracy: Accuracy) -> dict[str, float]:
    metrics = {"relations": accuracy.relations, "ate": accuracy.ate, "rpe": accuracy.rpe}
    return {
        f"{prefix}{metric}_{key}": value
        for metric, summary in metrics.items()
        if summary is not None
        for key, value in summary.items()
    }


def _measured(name: str, measured: Measured) -> dict[str, float]:
    return {name: measured.value, f"{name}_low": measured.low, f"{name}_high": measured.high}


def _spread(name: str, unit: str, spread: Spread) -> dict[str, float]:
    return {
        **_measured(f"{name}_mean_{unit}", spread.mean),
        **_measured(f"{name}_median_{unit}", spread.median),
    }


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]], first: Sequence[str] = ()) -> Path:
    """Write rows that may have different columns; those named ``first`` come first, the others as they occur."""
    headings = list(dict.fromkeys([*first, *(key for row in rows for key in row)]))
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, headings, restval="")
        writer.writeheader()
        writer.writerows(_plain(row) for row in rows)
    return path


def _plain(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: "" if isinstance(value, float) and math.isnan(value) else value for key, value in row.items()
    }
