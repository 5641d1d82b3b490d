"""The jobs of a comparison: which they are, and who does them."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hsslam_eval.compare_config import CompareConfig, Contestant, DatasetSpec
from hsslam_eval.comparison import Failure
from hsslam_eval.jobs import Job, Kind, Result, places, run_job
from hsslam_eval.sweep_queue import Status, run_jobs
from hsslam_eval.sweep_worker import told_by
from hsslam_eval.workspace import Workspace


@dataclass(frozen=True)
class Hands:
    """Who does the jobs of a comparison where not this process, one after the other; see `run_jobs`.

    Parameters
    ----------
    workers : int
        Local worker processes; not used with ``scheduler``.
    scheduler : str, optional
        Address of a Dask scheduler.
    progress : callable, optional
        Takes `Status` while they work.
    """

    workers: int = 1
    scheduler: str | None = None
    progress: Callable[[Status], None] | None = None


class Progress(Protocol):
    """What `compare` tells while it runs."""

    def __call__(self, stage: str, part: str, done: int, total: int) -> None:
        """Take a step.

        Parameters
        ----------
        stage : str
            ``prepare`` (opening the dataset, loading, compiling), ``trials``, ``slam``, ``optimise``, ``map``,
            and at the end of a job ``done`` or ``failed``.
        part : str
            One of `part_names`: the matcher's label, with the dataset and the seed where there are several.
        done, total : int
            Trials or scans; ``total`` is 0 where it is not known.
        """


def jobs_of(config: CompareConfig, dataset: DatasetSpec, contestant: Contestant) -> list[Job]:
    """The jobs of one matcher on one dataset: for each seed its trials and its SLAM run, where wanted."""
    kinds: list[Kind] = []
    if config.run_trials:
        kinds.append("trials")
    if config.run_slam:
        kinds.append("slam")
    return [
        Job(
            kind=kind,
            dataset=dataset.model_copy(update={"seed": dataset.seed + step}),
            matcher=contestant,
            seed=config.seed + step,
            trials=config.trials,
            slam=config.slam,
        )
        for step in range(config.seeds)
        for kind in kinds
    ]


def part_names(config: CompareConfig, datasets: Sequence[DatasetSpec]) -> list[str]:
    """What `Progress` calls the parts of a comparison, in their order."""
    return [
        part_name(config, dataset, contestant, seed, len(datasets) > 1)
        for dataset in datasets
        for contestant in config.contestants
        for seed in range(config.seed, config.seed + config.seeds)
    ]


def part_name(
    config: CompareConfig, dataset: DatasetSpec, contestant: Contestant, seed: int, several: bool
) -> str:
    """What `Progress` calls one matcher on one dataset with one seed; ``several``: there are other datasets."""
    named = [dataset.stem] if several else []
    named.append(contestant.label)
    named += [f"seed {seed}"] if config.seeds > 1 else []
    return ", ".join(named)


@dataclass(frozen=True)
class ComparisonJobs:
    """The jobs of a comparison: done here one after the other as they are asked for, or all at once by workers.

    Parameters
    ----------
    workspace : Workspace
        Where their folders are.
    jobs : dict
        All of them, by their names.
    places : dict
        Their folders, by the same names.
    tell : Progress
        Told how far one is that is done here.
    done : dict
        What workers made of them; empty where they are done here.
    """

    workspace: Workspace
    jobs: Mapping[str, Job]
    places: Mapping[str, Path]
    tell: Progress
    done: Mapping[str, Result]

    @classmethod
    def of(cls, workspace: Workspace, hands: Hands | None, tell: Progress) -> ComparisonJobs:
        """List the jobs of a workspace, and have them done where there are ``hands`` for it."""
        config = workspace.config
        jobs = {
            job.name: job
            for dataset in workspace.datasets
            for contestant in config.contestants
            for job in jobs_of(config, dataset, contestant)
        }
        folders = places(workspace.jobs_folder, jobs)
        done: dict[str, Result] = {}
        if hands is not None:
            # A log by its full path: workers start in other folders.
            sent = {
                name: job.model_copy(update={"dataset": job.dataset.located()}) for name, job in jobs.items()
            }
            done = run_jobs(
                sent,
                folders,
                config.limits,
                workers=hands.workers,
                scheduler=hands.scheduler,
                progress=hands.progress,
            )
        return cls(workspace, jobs, folders, tell, done)

    def result(self, job: Job, part: str) -> Result:
        """What a job comes to."""
        found = self.done.get(job.name)
        if found is None:
            found = run_job(
                job,
                self.places[job.name],
                self.workspace.config.limits,
                lambda stage, done, total: self.tell(stage, part, done, total),
            )
        self.tell("failed" if isinstance(found, Failure) else "done", part, 0, 0)
        return found

    def conditions(self, jobs: Iterable[Job]) -> tuple[int, list[str]]:
        """How many jobs were done at once at most, and the names of other machines that did some."""
        told = [told_by(self.places[job.name]) for job in jobs]
        hosts = {one["host"] for one in told if one} - {platform.node()}
        return max((one.get("hands", 1) for one in told), default=1), sorted(hosts)
