"""Many jobs over many workers: what is done is taken as it is, what fails is a row with its reason.

A sweep's folder::

    resolved.yaml    every setting
    jobs/NAME/       a job's folder, see `hsslam_eval.jobs`, and ``worker.json``: where it was done
    sweep.csv        a row for each job
    sweep.json       the same
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hsslam import plugin_files
from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.version import __version__
from hsslam_eval.comparison import Failure, MatcherTrials, SlamOutcome
from hsslam_eval.jobs import RESULT_FILE, Job, result_of
from hsslam_eval.sweep_config import Point, SweepConfig, expand
from hsslam_eval.sweep_pool import Ended, open_pool
from hsslam_eval.sweep_table import Row, write_tables
from hsslam_eval.sweep_worker import WORKER_FILE, order, unpack

RESOLVED_FILE, JOBS_FOLDER = "resolved.yaml", "jobs"

_TICK = 0.25
"""How often progress is told where nothing ends (s)."""


@dataclass(frozen=True)
class Status:
    """How far a sweep is.

    Parameters
    ----------
    done, failed, total : int
        Jobs; ``done`` includes what was done before.
    hands : int
        How many jobs the workers there are can do at once.
    """

    done: int
    failed: int
    total: int
    hands: int


Progress = Callable[[Status], None]
"""Called all the while; where it raises, the sweep ends, and what is complete stays."""


def sweep(
    config: SweepConfig,
    out: Path | str,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    data_dir: Path | None = None,
    progress: Progress | None = None,
    source: str = "",
) -> list[Row]:
    """Run every job of a sweep that has no result in ``out`` yet, and write its tables.

    Parameters
    ----------
    config : SweepConfig
        What to go through.
    out : path
        A new folder, or that of an earlier sweep: jobs that both have are not run again.
    workers : int
        Local worker processes; not used with ``scheduler``.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do the jobs.
    data_dir : path, optional
        Where workers look for real logs; each in its own data directory where left out.
    progress : callable, optional
        Takes `Status`.
    source : str
        The file that ``config`` was read from, for errors.

    Returns
    -------
    list of Row
        One for each job, in the order of `expand`.

    Raises
    ------
    ConfigError, DataError
        As `expand`; ``out`` holds something else than a sweep.
    SweepError
        Dask is not installed, or the scheduler does not answer.
    """
    points = expand(config, source, data_dir)
    folder = _prepare(Path(out), config)
    jobs = {point.job.key: point.job for point in points}
    places = _places(folder, jobs)
    found: dict[str, MatcherTrials | SlamOutcome | Failure] = {}
    for key, job in jobs.items():
        result = _held(job, places[key])
        if result is not None:
            found[key] = result
    missing = [key for key in jobs if key not in found]
    tell = progress if progress is not None else _silent
    if missing:
        _run(config, {key: jobs[key] for key in missing}, places, found, workers, scheduler, tell)
    rows = [_row(point, places[point.job.key], folder, found[point.job.key]) for point in points]
    write_tables(rows, folder)
    return rows


def _run(
    config: SweepConfig,
    jobs: Mapping[str, Job],
    places: Mapping[str, Path],
    found: dict[str, MatcherTrials | SlamOutcome | Failure],
    workers: int,
    scheduler: str | None,
    tell: Progress,
) -> None:
    """Do jobs, and add what they come to to ``found``."""
    keys, total = list(jobs), len(found) + len(jobs)
    queue, suspects, running, alone = deque(range(total - len(found))), list[int](), 0, False
    with open_pool(scheduler, min(workers, len(jobs))) as pool:
        while queue or running:
            hands = pool.capacity()
            while queue and running < (min(hands, 1) if alone else hands):
                number, running = queue.popleft(), running + 1
                key = keys[number]
                pool.submit(number, order(jobs[key], places[key].name, config.limits))
            failed = sum(isinstance(result, Failure) for result in found.values())
            tell(Status(len(found) - failed, failed, total, hands))
            ended = pool.next(_TICK)
            if ended is None:
                continue
            running -= 1
            if ended.worker_died and not alone:
                suspects.append(ended.number)
            else:
                key = keys[ended.number]
                found[key] = _received(jobs[key], places[key], ended)
            if not queue and not running and suspects and not alone:
                # Of several jobs that a worker had, one may have taken it down: who does so alone, is guilty.
                queue, alone = deque(suspects), True


def _received(job: Job, place: Path, ended: Ended) -> MatcherTrials | SlamOutcome | Failure:
    if ended.result is None:
        return Failure(job.kind, ended.reason, "", job.seed)
    unpack(ended.result["files"], place)
    if ended.result["failure"] is not None:
        return Failure(**ended.result["failure"])
    result = result_of(job, place)
    assert result is not None
    return result


def _held(job: Job, place: Path) -> MatcherTrials | SlamOutcome | Failure | None:
    try:
        return result_of(job, place)
    except DataError as error:
        return Failure(job.kind, str(error), f"rm {place / RESULT_FILE}", job.seed)


def _prepare(out: Path, config: SweepConfig) -> Path:
    try:
        out.mkdir(parents=True, exist_ok=True)
        held = sorted(item.name for item in out.iterdir())
    except OSError as error:
        raise DataError(f"{out}: the folder cannot be made: {error.strerror}") from error
    if held and RESOLVED_FILE not in held:
        raise DataError(f"{out}: holds something else than a sweep ({held[0]}); choose another folder")
    about = {
        "version": __version__,
        "plugins": plugin_files.fingerprints(),
        "config": config.resolved(),
    }
    with atomic_path(out / RESOLVED_FILE) as temporary:
        temporary.write_text(yaml.safe_dump(about, sort_keys=False), encoding="utf-8")
    return out


def _places(out: Path, jobs: Mapping[str, Job]) -> dict[str, Path]:
    """Each job's folder: the one that it has, whatever its matcher was called then, or a new one."""
    held = {path.name.rpartition("-")[2]: path for path in sorted((out / JOBS_FOLDER).glob("*-*"))}
    return {key: held.get(key[:12], out / JOBS_FOLDER / job.name) for key, job in jobs.items()}


def _row(point: Point, place: Path, out: Path, result: MatcherTrials | SlamOutcome | Failure) -> Row:
    told: dict[str, Any] = {}
    path = place / WORKER_FILE
    if path.is_file():
        told = json.loads(path.read_text(encoding="utf-8"))
    return Row.of(
        point,
        result,
        folder=place.relative_to(out).as_posix(),
        host=told.get("host", ""),
        seconds=told.get("seconds"),
    )


def _silent(status: Status) -> None:
    pass
