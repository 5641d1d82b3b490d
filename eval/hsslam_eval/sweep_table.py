"""The rows of a sweep, as CSV, as JSON, and as two tables to read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hsslam.io.atomic import atomic_path
from hsslam_eval.comparison import Failure, MatcherTrials, SlamOutcome
from hsslam_eval.csv_files import slam_figures, trials_figures, write_rows
from hsslam_eval.jobs import Kind
from hsslam_eval.sweep_config import Point

CSV_FILE, JSON_FILE = "sweep.csv", "sweep.json"

_COSTS = ("time_", "wall_seconds", "cpu_seconds", "warm_up_seconds", "real_time_factor", "peak_memory_mb")
"""Figures that begin like these depend on the machine; all others are the same wherever a job is done."""


@dataclass(frozen=True)
class Row:
    """One job of a sweep.

    Parameters
    ----------
    kind, dataset, dataset_seed, scans, matcher, seed
        What was done; see `hsslam_eval.jobs.Job`. ``matcher`` is its label.
    parameters, settings : dict
        The point of the grids; see `Point`.
    status : str
        ``done``, ``failed``, or ``unavailable`` where the matcher is.
    reason, remedy : str
        Why it failed, and the line that mends it where one is known; empty where it is done.
    metrics : dict
        What the matcher achieved: the columns of ``trials.csv`` or ``slam.csv``.
    costs : dict
        What that took; depends on the machine.
    seconds : float or None
        How long the worker had the job in all, loading included.
    host : str
        Name of the worker's machine.
    key, folder : str
        The job's key, and its folder within the sweep's.
    """

    kind: Kind
    dataset: str
    dataset_seed: int
    scans: int | None
    matcher: str
    parameters: dict[str, Any]
    settings: dict[str, Any]
    seed: int
    status: str
    reason: str
    remedy: str
    metrics: dict[str, Any]
    costs: dict[str, Any]
    seconds: float | None
    host: str
    key: str
    folder: str

    @classmethod
    def of(
        cls,
        point: Point,
        result: MatcherTrials | SlamOutcome | Failure,
        *,
        folder: str,
        host: str,
        seconds: float | None,
    ) -> Row:
        """Put a job and what came of it into a row."""
        job = point.job
        status, reason, remedy = "done", "", ""
        figures: dict[str, Any] = {}
        match result:
            case MatcherTrials():
                figures = trials_figures(result)
            case SlamOutcome():
                figures = {key: value for key, value in slam_figures(result).items() if key != "seed"}
            case Failure():
                status = "unavailable" if result.stage == "unavailable" else "failed"
                reason, remedy = " ".join(result.reason.split()), result.remedy
        costs = {key: value for key, value in figures.items() if key.startswith(_COSTS)}
        return cls(
            kind=job.kind,
            dataset=job.dataset.stem,
            dataset_seed=job.dataset.seed,
            scans=job.dataset.scans,
            matcher=job.matcher.label,
            parameters=point.parameters,
            settings=point.settings,
            seed=job.seed,
            status=status,
            reason=reason,
            remedy=remedy,
            metrics={key: value for key, value in figures.items() if key not in costs},
            costs=costs,
            seconds=seconds,
            host=host,
            key=job.key,
            folder=folder,
        )

    def flat(self) -> dict[str, Any]:
        """As columns: a parameter is ``matcher.NAME``, figures come last."""
        data = asdict(self)
        parameters, settings, metrics, costs = (
            data.pop(name) for name in ("parameters", "settings", "metrics", "costs")
        )
        apart = {f"matcher.{name}": _cell(value) for name, value in parameters.items()}
        apart |= {name: _cell(value) for name, value in settings.items()}
        what = {name: data.pop(name) for name in ("kind", "dataset", "dataset_seed", "scans", "matcher")}
        own = {name: data.pop(name) for name in ("seed", "status", "reason", "remedy", "seconds")}
        empty = {name: "" if value is None else value for name, value in {**what, **own}.items()}
        return {
            **{name: empty[name] for name in what},
            **apart,
            **{name: empty[name] for name in own},
            **metrics,
            **costs,
            **data,
        }


def write_tables(rows: Sequence[Row], out: Path) -> None:
    """Write ``sweep.csv`` and ``sweep.json``."""
    flat = [row.flat() for row in rows]
    # Columns of a row stay together, whichever row has them first.
    first = list(dict.fromkeys(key for row in flat for key in _before_figures(row)))
    write_rows(out / CSV_FILE, flat, first)
    with atomic_path(out / JSON_FILE) as temporary:
        plain = [_without_nan(asdict(row)) for row in rows]
        temporary.write_text(json.dumps(plain, indent=1) + "\n", encoding="utf-8")


def read_tables(rows: Sequence[Row]) -> list[tuple[str, list[str], list[list[str]]]]:
    """Make the tables for people: title, headings, cells; one for trials, one for SLAM, where there are such jobs."""
    tables = []
    for kind, title, columns in (("trials", "Trials", _TRIALS), ("slam", "SLAM", _SLAM)):
        mine = [row for row in rows if row.kind == kind]
        if not mine:
            continue
        parameters = list(dict.fromkeys(name for row in mine for name in row.parameters))
        settings = list(dict.fromkeys(name for row in mine for name in row.settings))
        shown = [
            column for column in columns if any(column[1] in {**row.metrics, **row.costs} for row in mine)
        ]
        headings = ["dataset", "matcher", *parameters, *settings, "seed", *(name for name, *_ in shown)]
        cells = [
            [
                row.dataset,
                row.matcher,
                *(_shown(row.parameters, name) for name in parameters),
                *(_shown(row.settings, name) for name in settings),
                str(row.seed),
                *(_figure({**row.metrics, **row.costs}.get(key), form) for _, key, form in shown),
                "" if row.seconds is None else f"{row.seconds:.1f}",
                row.status if row.status == "done" else f"{row.status}: {row.reason}",
            ]
            for row in mine
        ]
        tables.append((title, [*headings, "seconds", "status"], cells))
    return tables


_TRIALS = (
    ("success", "10cm_2deg_ratio", "{:.1%}"),
    ("glasm success", "glasm_ratio", "{:.1%}"),
    ("no answer", "unanswered", "{:d}"),
    ("median error (m)", "all_displacement_median_m", "{:.4f}"),
    ("(deg)", "all_rotation_median_deg", "{:.3f}"),
    ("match (s)", "time_median_s", "{:.5f}"),
)
_SLAM = (
    ("ATE (m)", "ate_translation_rmse_m", "{:.4f}"),
    ("ATE (deg)", "ate_rotation_rmse_deg", "{:.3f}"),
    ("relations (m)", "relations_translation_mean_m", "{:.4f}"),
    ("relations (deg)", "relations_rotation_mean_deg", "{:.3f}"),
    ("loops", "loops_accepted", "{:d}"),
    ("SLAM (s)", "wall_seconds", "{:.1f}"),
)


def _before_figures(flat: Mapping[str, Any]) -> list[str]:
    names = list(flat)
    return names[: names.index("seconds") + 1]


def _shown(values: Mapping[str, Any], name: str) -> str:
    return str(_cell(values[name])) if name in values else ""


def _figure(value: Any, form: str) -> str:
    return "" if value is None or (isinstance(value, float) and math.isnan(value)) else form.format(value)


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, dict | list) else value


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value
