"""Many jobs over many workers: what is done is taken as it is, what fails is a row with its reason.

A sweep's folder::

    resolved.yaml    every setting
    jobs/NAME/       a job's folder, see `hsslam_eval.jobs`, and ``worker.json``: where it was done
    sweep.csv        a row for each job
    sweep.json       the same
"""

from __future__ import annotations

from pathlib import Path

import yaml

from hsslam import plugin_files
from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.version import __version__
from hsslam_eval.jobs import Result, places
from hsslam_eval.sweep_config import Point, SweepConfig, expand
from hsslam_eval.sweep_queue import Progress, Status, run_jobs
from hsslam_eval.sweep_table import Row, write_tables
from hsslam_eval.sweep_worker import told_by

__all__ = ["Progress", "Status", "sweep"]

RESOLVED_FILE, JOBS_FOLDER = "resolved.yaml", "jobs"


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
    folders = places(folder / JOBS_FOLDER, jobs)
    found = run_jobs(jobs, folders, config.limits, workers=workers, scheduler=scheduler, progress=progress)
    rows = [_row(point, folders[point.job.key], folder, found[point.job.key]) for point in points]
    write_tables(rows, folder)
    return rows


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


def _row(point: Point, place: Path, out: Path, result: Result) -> Row:
    told = told_by(place)
    return Row.of(
        point,
        result,
        folder=place.relative_to(out).as_posix(),
        host=told.get("host", ""),
        seconds=told.get("seconds"),
    )
