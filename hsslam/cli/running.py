"""A SLAM run from the first scan to the last file."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from hsslam.cli import accuracy, console
from hsslam.cli.progress import Progress, Silence, watch_compiler
from hsslam.config import Config
from hsslam.datasets.dataset import Dataset
from hsslam.datasets.file import FileDataset
from hsslam.environment import peak_memory_mb
from hsslam.live import LiveMap
from hsslam.memory import give_back
from hsslam.slam.events import LoopChecked, SlamResult
from hsslam.slam.folder import RECORDING, RunFolder
from hsslam.slam.journal import Header
from hsslam.slam.pipeline import Slam
from hsslam_eval.accuracy import measure


def run_log(
    folder: RunFolder,
    header: Header,
    config: Config,
    log: Dataset,
    shown: Progress,
    viewer: str | None = None,
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Run, judge, and write everything; returns what went into metrics.json and timings.json.

    ``viewer`` shows the map while it grows; None shows nothing.
    """
    title = f"{log.info.name}, {config.matcher.name}"
    total = log.info.scan_count or header.dataset["scans"] or _count(log, shown)
    wall, cpu = time.perf_counter(), time.process_time()
    with watch_compiler(shown, ahead=True), folder.begin(header, config) as journal:
        slam = Slam(config, replay=folder.replay)
        recording = folder.path / RECORDING
        loops = 0
        with LiveMap(slam, viewer, recording=recording, title=title, say=console.complain) as live:
            shown.stage("tracking", total, "scans")
            for done, scan in enumerate(log.scans(), start=1):
                events = slam.process(scan)
                for event in events:
                    journal.write(event)
                    loops += isinstance(event, LoopChecked) and event.accepted
                live.update(events, scan)
                shown.update(done, f"{loops} loops")
            tracked, live_online = time.perf_counter(), live.seconds
            shown.stage("optimising the graph")
            for event in slam.finish(last=True):
                journal.write(event)
                live.update([event])
            result = slam.result()
            solved = time.perf_counter()
        del slam  # the scans that it keeps would lie beside the picture of the map
        give_back()
        shown.stage("drawing the map")
        drawing = time.perf_counter()
        folder.write_result(result, config, title=title)
        written = time.perf_counter()
    metrics = _metrics(result, config, log)
    timings = _timings(result, folder, cpu, (wall, tracked, solved), written - drawing)
    if viewer is not None:
        timings["stages_s"]["live map"] = live.seconds
        timings["stages_s"][_REST] = max(timings["stages_s"][_REST] - live_online, 0.0)
    folder.write_json("metrics.json", metrics)
    folder.write_json("timings.json", timings)
    return metrics, timings


def summary(
    folder: RunFolder, log: Dataset, metrics: dict[str, Any], timings: dict[str, Any]
) -> list[tuple[str, str]]:
    """The lines that ``hsslam run`` prints at its end."""
    duration = metrics["duration_s"]
    return [
        ("dataset", f"{log.info.name}: {metrics['scans']:,} scans, {duration:,.0f} s of driving"),
        ("matcher", f"{metrics['matcher']}: {metrics['matched']:,} of {metrics['scans']:,} scans matched"),
        *([("lost", lost)] if (lost := _lost(metrics)) else []),
        *([("sessions", sessions)] if (sessions := _sessions(metrics)) else []),
        *([("own parts", own)] if (own := _own_parts(metrics)) else []),
        ("wall time", _wall_time(timings)),
        ("keyframes", f"{metrics['keyframes']:,}"),
        ("loops", f"{metrics['loops_accepted']:,} accepted of {metrics['loops_tried']:,} tried"),
        *([("skipped", f"{skipped:,} malformed lines")] if (skipped := metrics["skipped_lines"]) else []),
        *(("log", note) for note in metrics["notes"]),
        *accuracy.rows(metrics),
        ("output", f"{folder.path}/"),
    ]


def _wall_time(timings: dict[str, Any]) -> str:
    """Seconds, and how many times faster than the robot drove where the log tells how long that took."""
    wall = f"{timings['wall_s']:.1f} s"
    factor = timings["real_time_factor"]
    if not factor:
        return wall
    return f"{wall} ({f'{factor:.0f}' if factor >= 10.0 else f'{factor:.2g}'} times real time)"


def _lost(metrics: dict[str, Any]) -> str:
    """What is to be said of scans whose pose is a guess; nothing where there is none."""
    told = metrics["statistics"]
    if not told["guessed"]:
        return ""
    return (
        f"{told['guessed']:,} scans (the first: {told['first_guessed']:,}) neither matched nor told of by "
        "odometry: the last motion was taken to go on, which is a guess"
    )


def _sessions(metrics: dict[str, Any]) -> str:
    """What is to be said of a log in which the robot was elsewhere all at once; nothing where it was not."""
    told = metrics["statistics"]
    scans, sessions = told["paused_before"], told["sessions"]
    if not scans:
        return ""
    first = ", ".join(f"{scan:,}" for scan in scans[:3]) + (", ..." if len(scans) > 3 else "")
    where = f"{len(scans)} begun by a pause or by getting lost, the robot being elsewhere (scan {first}); "
    if sessions == 1:
        return where + "it was found again in each"
    return where + f"{sessions} parts of the log could not be tied together: how they lie is odometry's guess"


def _own_parts(metrics: dict[str, Any]) -> str:
    """How much of the view parts of the robot hide; nothing where there are none."""
    degrees = metrics["statistics"]["own_parts_deg"]
    return f"of the robot hide {degrees:.0f} degrees of the laser's view and were left out" if degrees else ""


def _count(log: Dataset, shown: Progress) -> int | None:
    """Scans in a log that does not say; without progress nobody needs to know."""
    if isinstance(shown, Silence):
        return None
    shown.stage("counting the scans", unit="scans")
    done = 0
    for done, _ in enumerate(log.scans(), start=1):
        shown.update(done)
    return done


def _metrics(result: SlamResult, config: Config, log: Dataset) -> dict[str, Any]:
    stamps = result.odometry.stamps
    errors = measure(result.trajectory, result.odometry, log.truth(), log.relations())
    return {
        "dataset": log.info.name,
        "attribution": log.info.attribution,
        "matcher": config.matcher.name,
        "loop_matcher": (config.loop_matcher or config.matcher).name,
        "seed": config.seed,
        "scans": len(result.trajectory),
        "duration_s": float(np.ptp(stamps)) if len(stamps) else 0.0,
        "skipped_lines": log.statistics.skipped if isinstance(log, FileDataset) else 0,
        "notes": log.statistics.notes if isinstance(log, FileDataset) else [],
        "matched": result.matched,
        "keyframes": len(result.keyframes),
        "loops_tried": len(result.loops),
        "loops_accepted": sum(loop.accepted for loop in result.loops),
        **errors,
        "online": measure(result.online, result.odometry, log.truth(), log.relations()),
        "statistics": result.statistics,
    }


def _timings(
    result: SlamResult, folder: RunFolder, cpu: float, moments: tuple[float, float, float], output: float
) -> dict[str, Any]:
    """Times of a run; ``moments`` are its start, the end of the log, and the end of the last optimisation."""
    wall, tracked, solved = moments
    now = time.perf_counter()
    stamps = result.odometry.stamps
    duration = float(np.ptp(stamps)) if len(stamps) else 0.0
    return {
        "wall_s": now - wall,
        "cpu_s": time.process_time() - cpu,
        "online_s": tracked - wall,
        "final_s": solved - tracked,
        "output_s": output,
        "stages_s": {**_online_stages(result, tracked - wall), "output": output},
        "real_time_factor": duration / (now - wall),
        "scans_per_s": len(result.trajectory) / (now - wall),
        "peak_memory_mb": peak_memory_mb(),
        "resumed": folder.replay is not None,
    }


_REST = "reading and bookkeeping"
_AT_THE_END = ("final", "rescan")


def _online_stages(result: SlamResult, online: float) -> dict[str, float]:
    """Seconds by stage; what no stage of the online pass counts is reading, bookkeeping and the journal."""
    stages = dict(result.seconds)
    counted = sum(seconds for stage, seconds in stages.items() if stage not in _AT_THE_END)
    return {**stages, _REST: max(online - counted, 0.0)}


def profile(timings: dict[str, Any]) -> list[tuple[str, str]]:
    """The lines that ``hsslam run --profile`` adds: where the time went, longest first."""
    wall = timings["wall_s"]
    stages = sorted(timings["stages_s"].items(), key=lambda stage: -stage[1])
    return [
        ("time", f"online {timings['online_s']:.2f} s, final {timings['final_s']:.2f} s"),
        *((f"  {stage}", f"{seconds:8.2f} s  {seconds / wall:6.1%}") for stage, seconds in stages),
        ("peak memory", f"{timings['peak_memory_mb']:.0f} MB"),
    ]
