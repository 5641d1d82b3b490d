"""A job in a process of its own: ``python -m hsslam_eval.worker FOLDER FD``.

`hsslam_eval.jobs` starts it. It reads the job from its folder, writes its record there, and tells how far it is on the
open file descriptor ``FD``, one JSON object a line. A process of its own makes the peak memory that matcher's, and a
crash costs that job only.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import sys
import traceback
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from time import perf_counter
from typing import Any

from hsslam.config import Config
from hsslam.datasets.dataset import Dataset
from hsslam.errors import DataError, HsslamError, MatcherUnavailableError
from hsslam.jit import watch_compiler
from hsslam_eval.comparison import Failure, MatcherTrials, SlamOutcome
from hsslam_eval.jobs import RESULT_FILE, RUN_FOLDER, Job
from hsslam_eval.orphans import end_with_parent
from hsslam_eval.record_files import write_record

_REPORT_EVERY = 0.1
_WARM_UP_SCANS, _WARM_UP_STEP = 40, 5


class Reporter:
    """Writes progress to the parent, not more often than it can be seen."""

    def __init__(self, descriptor: int) -> None:
        self._file = os.fdopen(descriptor, "w", encoding="utf-8")
        self._last = 0.0

    def progress(self, stage: str, done: int, total: int) -> None:
        """Say how far a stage is; ``total`` 0 where it is not known."""
        now = perf_counter()
        if now - self._last >= _REPORT_EVERY or done in (0, total):
            self._last = now
            self._line({"stage": stage, "done": done, "total": total})

    def compiling(self, begins: bool) -> None:
        """Say that numba begins or ends to compile, which is no step of the matcher's."""
        self._line({"compiling": begins})

    def failure(self, failure: Failure) -> None:
        """Say why there will be no result."""
        self._line({"failure": asdict(failure)})

    def _line(self, values: dict[str, Any]) -> None:
        self._file.write(json.dumps(values) + "\n")
        self._file.flush()


def run_trials_job(job: Job, reporter: Reporter) -> MatcherTrials:
    """Run the trials of a job."""
    from hsslam.matching import registry
    from hsslam_eval.outcomes import trials_record
    from hsslam_eval.trials import make_pairs, run_trials

    reporter.progress("prepare", 0, 0)
    matcher = registry.create(job.matcher.name, job.matcher.parameters)
    config = job.trial_config
    pairs = make_pairs(job.dataset.open(), config)
    result = run_trials(
        job.matcher.label,
        matcher,
        pairs,
        config,
        lambda done, total: reporter.progress("trials", done, total),
    )
    return trials_record(result)


def run_slam_job(job: Job, place: Path, reporter: Reporter) -> SlamOutcome:
    """Run the SLAM of a job and leave its run folder at ``place``."""
    from hsslam.environment import peak_memory_mb
    from hsslam.slam.folder import RunFolder
    from hsslam.slam.journal import Header
    from hsslam.slam.pipeline import Slam
    from hsslam_eval.outcomes import cpu_seconds, slam_record

    reporter.progress("prepare", 0, 0)
    config = job.slam_config
    config.matcher.create()
    dataset = job.dataset.open()
    began = perf_counter()
    _warm_up(config, dataset, reporter)
    warm_up_seconds = perf_counter() - began

    if place.exists():
        # What a failed attempt left; its matches must not shorten the time of this one.
        shutil.rmtree(place)
    folder = RunFolder.create(place, dataset.info.name, job.matcher.label)
    header = Header(job.source, config.model_dump(mode="json"))
    total = _scan_count(job, dataset)
    with folder.begin(header, config) as journal:
        began, cpu_began = perf_counter(), cpu_seconds()
        slam = Slam(config)
        for done, scan in enumerate(dataset.scans(), start=1):
            for event in slam.process(scan):
                journal.write(event)
            reporter.progress("slam", done, max(total, done) if total else 0)
        reporter.progress("optimise", 0, 0)
        for done, event in enumerate(slam.finish(last=True), start=1):
            journal.write(event)
            reporter.progress("optimise", done, 0)
        result = slam.result()
        wall, cpu = perf_counter() - began, cpu_seconds() - cpu_began
    peak = peak_memory_mb()
    reporter.progress("map", 0, 0)
    note = ""
    try:
        folder.write_result(result, config, title=f"{dataset.info.name}, {job.matcher.label}")
    except DataError as error:  # a trajectory that ran away asks for too large a map; its errors still count
        note = str(error)
    record = slam_record(
        result,
        folder=place.name,
        seed=job.seed,
        relations=dataset.relations(),
        truth=dataset.truth(),
        wall_seconds=wall,
        cpu_seconds=cpu,
        warm_up_seconds=warm_up_seconds,
        peak_memory_mb=peak,
        note=note,
    )
    folder.write_json("metrics.json", _metrics(record, config, dataset))
    folder.write_json("timings.json", _timings(record))
    return record


def main(arguments: list[str]) -> int:
    """Do one job; the exit code is 0 where its record was written."""
    folder, reporter = Path(arguments[0]), Reporter(int(arguments[1]))
    end_with_parent()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))  # a crash is told in a line, not in a core file
    stage, seed = "trials", 0
    try:
        job = Job.load(folder)
        stage, seed = job.kind, job.seed
        record: MatcherTrials | SlamOutcome
        with watch_compiler(reporter.compiling):
            if job.kind == "trials":
                record = run_trials_job(job, reporter)
            else:
                record = run_slam_job(job, folder / RUN_FOLDER, reporter)
        write_record(folder / RESULT_FILE, record)
    except MatcherUnavailableError as error:
        reporter.failure(Failure("unavailable", error.reason, error.remedy, seed))
    except HsslamError as error:
        reporter.failure(Failure(stage, str(error), "", seed))
    except (Exception, SystemExit) as error:  # whatever a matcher may raise: it costs its row only
        traceback.print_exc()
        reporter.failure(Failure(stage, f"{type(error).__name__}: {error}", "", seed))
    else:
        return 0
    return 1


def _scan_count(job: Job, dataset: Dataset) -> int:
    """How many scans there will be, 0 where that is not known without reading them."""
    known, wanted = dataset.info.scan_count, job.dataset.scans
    if known is None:
        return wanted or 0
    return min(known, wanted) if wanted is not None else known


def _warm_up(config: Config, dataset: Dataset, reporter: Reporter) -> None:
    """Run a short log through every stage, so that nothing is compiled or imported on the clock."""
    from hsslam.slam.pipeline import Slam

    eager = config.model_copy(
        update={
            "keyframes": config.keyframes.model_copy(update={"distance": 0.001, "angle_deg": 0.1}),
            "loops": config.loops.model_copy(update={"min_gap": 1, "every": 1}),
        }
    )
    scans = islice(dataset.scans(), 0, _WARM_UP_SCANS * _WARM_UP_STEP, _WARM_UP_STEP)
    for done, _ in enumerate(Slam(eager).run(scans), start=1):
        reporter.progress("prepare", done, 0)


def _metrics(record: SlamOutcome, config: Config, dataset: Dataset) -> dict[str, Any]:
    errors = {name: summary for name, summary in asdict(record.accuracy).items() if summary is not None}
    return {
        "dataset": dataset.info.name,
        "attribution": dataset.info.attribution,
        "matcher": config.matcher.name,
        "loop_matcher": (config.loop_matcher or config.matcher).name,
        "seed": config.seed,
        "scans": record.scans,
        "duration_s": record.log_seconds,
        "matched": record.matched,
        "keyframes": record.keyframes,
        "loops_tried": record.loops_tried,
        "loops_accepted": record.loops_accepted,
        **errors,
    }


def _timings(record: SlamOutcome) -> dict[str, Any]:
    return {
        "wall_s": record.wall_seconds,
        "cpu_s": record.cpu_seconds,
        "warm_up_s": record.warm_up_seconds,
        "stages_s": record.stage_seconds,
        "real_time_factor": record.real_time_factor,
        "scans_per_s": record.scans / record.wall_seconds,
        "peak_memory_mb": record.peak_memory_mb,
        "resumed": False,
    }


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # All is written: a matcher's threads must not keep the process, nor its library crash it, on the way out.
    os._exit(code)
