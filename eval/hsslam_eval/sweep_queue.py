"""A list of jobs over many workers: what is done is taken as it is, what is missing is handed out."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from hsslam_eval.compare_config import LimitSection
from hsslam_eval.comparison import Failure
from hsslam_eval.jobs import Job, Result, held, result_of
from hsslam_eval.sweep_pool import Ended, open_pool
from hsslam_eval.sweep_worker import order, unpack

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


def run_jobs(
    jobs: Mapping[str, Job],
    places: Mapping[str, Path],
    limits: LimitSection,
    *,
    workers: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> dict[str, Result]:
    """Do the jobs that have no result yet, in any order.

    Parameters
    ----------
    jobs : mapping
        By names of the caller's.
    places : mapping
        The jobs' folders by the same names; see `hsslam_eval.jobs.places`.
    limits : LimitSection
        When a job is given up.
    workers : int
        Local worker processes; not used with ``scheduler``.
    scheduler : str, optional
        Address of a Dask scheduler whose workers do the jobs.
    progress : callable, optional
        Takes `Status`.

    Returns
    -------
    dict
        What each job came to, by the same names. One that fails, or takes its workers down, is a `Failure`.

    Raises
    ------
    SweepError
        Dask is not installed, or the scheduler does not answer.
    """
    found: dict[str, Result] = {}
    for name, job in jobs.items():
        result = held(job, places[name])
        if result is not None:
            found[name] = result
    missing = {name: job for name, job in jobs.items() if name not in found}
    if missing:
        tell = progress if progress is not None else _silent
        _hand_out(missing, places, found, limits, workers, scheduler, tell)
    return found


def _hand_out(
    jobs: Mapping[str, Job],
    places: Mapping[str, Path],
    found: dict[str, Result],
    limits: LimitSection,
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
                pool.submit(number, order(jobs[key], places[key].name, limits, hands))
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


def _received(job: Job, place: Path, ended: Ended) -> Result:
    if ended.result is None:
        return Failure(job.kind, ended.reason, "", job.seed)
    unpack(ended.result["files"], place)
    if ended.result["failure"] is not None:
        return Failure(**ended.result["failure"])
    result = result_of(job, place)
    assert result is not None
    return result


def _silent(status: Status) -> None:
    pass
