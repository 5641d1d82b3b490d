"""Figures 11 to 14: maps by odometry alone, by HSL and by HIDE."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config, validate
from hsslam.datasets.dataset import Dataset
from hsslam.mapping.occupancy import OccupancyGrid, build_grid
from hsslam.mapping.picture import draw_map
from hsslam.slam.events import SlamResult
from hsslam.slam.pipeline import Slam
from hsslam.trajectory import Trajectory
from hsslam_eval.accuracy import measure
from hsslam_eval.map_plots import common_limits, occupied_box
from hsslam_eval.reproduce import drawing, methods
from hsslam_eval.reproduce.data import attribution, describe, is_simulated, open_data
from hsslam_eval.reproduce.experiment import Claim, Drawing, Experiment, Request, Row, Table, Tell, Value
from hsslam_eval.reproduce.judge import no_worse, paired

BUDGET = 250
"""Evaluations of either method after its memory is filled: the paper gives both the same."""

QUICK_SCANS = 150

MARGIN = 0.1
"""Two maps whose errors differ by less than this share of HSL's are as good as one another."""

_TRACKING_ONLY: dict[str, Any] = {
    # The paper's way: each scan against the map so far, within its window; no loops, no optimisation.
    "tracker": {
        "window": {"half_x": 0.15, "half_y": 0.15, "half_theta_deg": 10.0},
        "min_score": 0.0,
        "recovery_score": 0.0,
    },
    "loops": {"enabled": False},
    "graph": {"refine_rounds": 0},
}


_TITLES = {
    "odometry": "odometry alone",
    "HSL": "HSL as published, no loop closure",
    "HIDE": "HIDE as published, no loop closure",
    "hide, full SLAM": "hide, hsslam's defaults: full SLAM",
}


@dataclass(frozen=True, eq=False)
class Mapped:
    """A log mapped one way."""

    label: str
    trajectory: Trajectory
    grid: OccupancyGrid
    errors: dict[str, dict[str, float]]
    seconds: float


def run(request: Request, tell: Tell) -> Experiment:
    """Draw the maps; see `hsslam_eval.reproduce`."""
    log = open_data(request, scans=QUICK_SCANS if request.quick else None)
    ways = {
        "HSL": _config(request, methods.published("hsl", improvisations=BUDGET), _TRACKING_ONLY),
        "HIDE": _config(request, methods.published("hide", evaluations=BUDGET), _TRACKING_ONLY),
        "hide, full SLAM": _config(request, methods.ours("hide"), {}),
    }
    repeats = request.count(5 if is_simulated(request) else 1, 1)
    seeds = tuple(range(request.seed, request.seed + repeats))
    found: list[list[Mapped]] = []
    for label, config in ways.items():
        runs = [_map(label, config.model_copy(update={"seed": seed}), log, tell) for seed in seeds]
        if not found:
            found.append([_by_odometry(runs[0][1], log)])
        found.append([run for run, _ in runs])
    scans = len(found[0][0].trajectory)
    return Experiment(
        name="maps",
        title="Figures 11 to 14: maps",
        summary="The whole log, mapped by odometry alone; by HSL and by HIDE as published, with equal budgets, each "
        "scan against the map so far within 15 cm and 10° of odometry's prediction, without loop closure or "
        "optimisation; and by hsslam's defaults (hide, loops, pose graph).",
        claims=_claims(found),
        tables=(_table(found),),
        drawings=(_draw([runs[0] for runs in found], request),),
        data=f"{describe(request)}, {scans} scans",
        attribution=attribution(request),
        seeds=seeds,
        counts={"scans": scans, "runs of each method": repeats},
        config={label: config.model_dump(mode="json") for label, config in ways.items()},
        notes=(
            "The paper's own maps are of its laboratory, whose data are not published; Figure 14 is the Intel "
            "Research Lab, which `--dataset intel` maps. The paper judges by eye; we add the error against "
            "the truth there is.",
            "The map that a scan is matched with holds the newest ten keyframes; the paper does not say how much of "
            "its map it keeps.",
        ),
    )


def _config(request: Request, method: methods.Method, changed: Mapping[str, Any]) -> Config:
    matcher = {"name": method.name, **method.parameters}
    return validate(Config, {"seed": request.seed, "matcher": matcher, **changed})


def _map(label: str, config: Config, log: Dataset, tell: Tell) -> tuple[Mapped, SlamResult]:
    slam = Slam(config)
    started = time.perf_counter()
    for done, scan in enumerate(log.scans(), start=1):
        for _ in slam.process(scan):
            pass
        tell(f"{label}: tracking", done, log.info.scan_count or 0)
    tell(f"{label}: optimising", 0, 0)
    for _ in slam.finish():
        pass
    result = slam.result()
    seconds = time.perf_counter() - started
    grid = build_grid(result.keyframes, result.keyframe_poses)
    errors = measure(result.trajectory, result.odometry, log.truth(), log.relations())
    return Mapped(label, result.trajectory, grid, errors, seconds), result


def _by_odometry(result: SlamResult, log: Dataset) -> Mapped:
    odometry = result.odometry
    place = np.searchsorted(odometry.indices, [scan.index for scan in result.keyframes])
    grid = build_grid(result.keyframes, odometry.poses[place])
    errors = measure(odometry, odometry, log.truth(), log.relations())
    return Mapped("odometry", odometry, grid, errors, math.nan)


def _claims(found: list[list[Mapped]]) -> tuple[Claim, ...]:
    before = _errors(found[0])
    claims = []
    for runs in found[1:3]:
        after = _errors(runs)
        statement = f"{runs[0].label} turns drifting odometry into a consistent map."
        if after is None or before is None:
            claims.append(Claim(statement, "cannot be compared", "The log has no truth to compare with."))
            continue
        error, alone = 100.0 * float(after[1].mean()), 100.0 * float(before[1].mean())
        claims.append(
            Claim(
                statement,
                "holds" if error < 0.5 * alone else "does not hold",
                f"{after[0]}: {error:.1f} cm, by odometry alone {alone:.1f} cm; we ask for less than half.",
            )
        )
    claims.append(_as_good(found[1], found[2]))
    return tuple(claims)


def _as_good(hsl: list[Mapped], hide: list[Mapped]) -> Claim:
    statement = "At equal evaluations HIDE's map is as good as HSL's."
    first, second = _errors(hsl), _errors(hide)
    if first is None or second is None:
        return Claim(statement, "cannot be compared", "The log has no truth to compare with.")
    margin = MARGIN * float(first[1].mean())
    if len(hsl) > 1:
        return no_worse(
            statement,
            paired(second[1], first[1]),
            margin,
            this="HIDE",
            other="HSL",
            what=f"{first[0][:1].lower()}{first[0][1:]} ({len(hsl)} runs each)",
            unit="cm",
            scale=100.0,
        )
    return Claim(
        statement,
        "holds" if second[1][0] - first[1][0] < margin else "does not hold",
        f"{first[0]}: HIDE {100 * second[1][0]:.2f} cm, HSL {100 * first[1][0]:.2f} cm; one run each, so only a large "
        f"difference would mean something: we allow {100 * margin:.2f} cm.",
    )


_MEASURES = (
    ("relations", "translation_mean_m", "relations, translation mean (cm)", 100.0),
    ("relations", "rotation_mean_deg", "relations, rotation mean (°)", 1.0),
    ("ate", "translation_rmse_m", "ATE rmse (cm)", 100.0),
    ("ate", "rotation_rmse_deg", "ATE heading rmse (°)", 1.0),
    ("rpe", "translation_rmse_m", "RPE rmse (cm per m)", 100.0),
)


def _errors(runs: list[Mapped]) -> tuple[str, NDArray[np.float64]] | None:
    """What the runs are judged by, and the error of each (m)."""
    for kind, key, what in (
        ("relations", "translation_mean_m", "Mean error over the official relations"),
        ("ate", "translation_rmse_m", "Root mean square trajectory error"),
    ):
        if kind in runs[0].errors:
            return what, np.array([run.errors[kind][key] for run in runs])
    return None


def _table(found: list[list[Mapped]]) -> Table:
    present = [measure for measure in _MEASURES if measure[0] in found[0][0].errors]
    rows = []
    for runs in found:
        cells = [_spread([scale * run.errors[kind][key] for run in runs]) for kind, key, _, scale in present]
        times = [run.seconds for run in runs]
        per_scan = [1e3 * run.seconds / len(run.trajectory) for run in runs]
        rows.append(Row(runs[0].label, (*cells, _spread(times), _spread(per_scan))))
    repeats = len(found[1])
    spread = "One run each, so no intervals."
    if repeats > 1:
        spread = f"Mean over {repeats} runs with different seeds; the least and the most of them stand for an interval."
    return Table(
        "Accuracy and time",
        f"{spread} Times are of this machine; those of the first run hold compilation, and all hold reading the log.",
        (*(heading for _, _, heading, _ in present), "wall time (s)", "time per scan (ms)"),
        tuple(rows),
        corner="map",
    )


def _spread(values: list[float]) -> Value:
    if len(values) == 1:
        return Value(values[0])
    return Value(float(np.mean(values)), min(values), max(values))


def _draw(found: list[Mapped], request: Request) -> Drawing:
    limits = common_limits([occupied_box(way.grid) for way in found[1:]])
    x0, y0, x1, y1 = limits
    height = float(np.clip(4.9 * (y1 - y0) / (x1 - x0), 2.0, 7.0)) + 0.75
    figure, axes = drawing.panels(2, 2, width=5.6, height=height)
    for panel, way in zip(axes, found, strict=True):
        draw_map(panel, way.grid)
        panel.grid(False)
        panel.set_facecolor("0.8")
        panel.set_xlim(x0, x1)
        panel.set_ylim(y0, y1)
        panel.set_title(_TITLES.get(way.label, way.label))
    for panel in axes[:2]:
        panel.set_xlabel("")
    return Drawing(
        "figure",
        f"Maps of {describe(request)}, all at one scale: black is occupied, white free, grey unknown.",
        figure,
    )
