"""Several matchers on one dataset or more: the same trials and the same SLAM settings for each.

A comparison is a sweep without a grid whose rows are put side by side: its jobs are those of `hsslam_eval.sweep`, done
one after the other so that their times can be compared, or by the same workers.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Protocol

from hsslam.datasets.file import FileDataset
from hsslam.datasets.usable import require_returns
from hsslam.environment import environment
from hsslam_eval.compare_config import CompareConfig, Contestant, DatasetSpec
from hsslam_eval.comparison import (
    Comparison,
    DatasetRecord,
    Failure,
    MatcherOutcome,
    MatcherTrials,
    SlamOutcome,
    Study,
)
from hsslam_eval.jobs import RUN_FOLDER, Job, Kind, Result, places, run_job
from hsslam_eval.outcomes import pooled
from hsslam_eval.sweep_queue import Status, run_jobs
from hsslam_eval.sweep_worker import told_by
from hsslam_eval.workspace import Workspace

__all__ = [
    "CompareConfig",
    "DatasetSpec",
    "Hands",
    "Progress",
    "compare",
    "compare_datasets",
    "jobs_of",
    "part_names",
]


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


def compare(
    config: CompareConfig,
    dataset: DatasetSpec,
    out: Path | str,
    progress: Progress | None = None,
    *,
    command: str = "",
) -> Comparison:
    """Compare on one dataset; see `compare_datasets`."""
    return compare_datasets(config, [dataset], out, progress, command=command).comparisons[0]


def compare_datasets(
    config: CompareConfig,
    datasets: Sequence[DatasetSpec],
    out: Path | str,
    progress: Progress | None = None,
    *,
    command: str = "",
    hands: Hands | None = None,
) -> Study:
    """Run trials and SLAM for each dataset, matcher and seed, each job in a process of its own.

    What is complete in ``out`` from an earlier call with the same settings is taken as it is; what failed or is
    missing is done. The settings may have grown: more seeds, matchers or datasets, trials or SLAM besides. A matcher
    that is unavailable, raises, crashes or hangs (``config.limits``) costs its own row only. The outcome is also
    written to ``out/comparison.json``.

    Parameters
    ----------
    config : CompareConfig
        What to compare.
    datasets : sequence of DatasetSpec
        On what. A simulated dataset is drawn anew for each seed: its own seed grows with that of the run.
    out : path
        A new folder, or that of the same comparison.
    progress : Progress, optional
        Called all the while.
    command : str
        The command line that makes this comparison, for its report.
    hands : Hands, optional
        Workers that do the jobs side by side, as they do those of a sweep. Where left out, jobs are done one after
        the other, and their times are comparable.

    Returns
    -------
    Study

    Raises
    ------
    ConfigError
        A matcher or a setting is unknown, or ``out`` holds another comparison.
    DataError
        A dataset cannot be opened or holds nothing to match, or ``out`` holds something else.
    SweepError
        There are no workers to be had.
    """
    infos = []
    for dataset in datasets:
        log = dataset.open()
        if isinstance(log, FileDataset):  # a plugin's is read by the jobs only: it may crash
            require_returns(log)
        infos.append(log.info)
    workspace = Workspace.prepare(Path(out), config, datasets)
    jobs = _jobs(workspace, hands, progress if progress is not None else _silent)
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    several = len(datasets) > 1
    comparisons = []
    for dataset, info in zip(datasets, infos, strict=True):
        rows = [_Row(jobs, dataset, contestant, several) for contestant in config.contestants]
        outcomes = [row.outcome() for row in rows]
        own = [job for row in rows for job in jobs_of(config, dataset, row.contestant)]
        at_once, hosts = jobs.conditions(own)
        comparisons.append(
            Comparison(
                dataset=DatasetRecord(
                    info.name,
                    info.kind,
                    info.description,
                    info.attribution,
                    dataset.seed,
                    dataset.scans or info.scan_count,
                ),
                config=config.resolved(),
                command=command,
                created=now,
                environment=environment(),
                matchers=outcomes,
                hands=at_once,
                hosts=hosts,
            )
        )
    study = Study(comparisons)
    study.save(workspace.out)
    return study


def _jobs(workspace: Workspace, hands: Hands | None, tell: Progress) -> _Jobs:
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
        sent = {name: job.model_copy(update={"dataset": job.dataset.located()}) for name, job in jobs.items()}
        done = run_jobs(
            sent,
            folders,
            config.limits,
            workers=hands.workers,
            scheduler=hands.scheduler,
            progress=hands.progress,
        )
    return _Jobs(workspace, jobs, folders, tell, done)


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
        _part(config, dataset, contestant, seed, len(datasets) > 1)
        for dataset in datasets
        for contestant in config.contestants
        for seed in range(config.seed, config.seed + config.seeds)
    ]


def _part(
    config: CompareConfig, dataset: DatasetSpec, contestant: Contestant, seed: int, several: bool
) -> str:
    named = [dataset.stem] if several else []
    named.append(contestant.label)
    named += [f"seed {seed}"] if config.seeds > 1 else []
    return ", ".join(named)


def _silent(stage: str, part: str, done: int, total: int) -> None:
    pass


@dataclass(frozen=True)
class _Jobs:
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


@dataclass(frozen=True)
class _Row:
    """One matcher on one dataset."""

    jobs: _Jobs
    dataset: DatasetSpec
    contestant: Contestant
    several: bool

    def outcome(self) -> MatcherOutcome:
        workspace = self.jobs.workspace
        config, failures = workspace.config, list[Failure]()
        trials, runs = list[MatcherTrials](), list[SlamOutcome]()
        for job in jobs_of(config, self.dataset, self.contestant):
            done = self.jobs.result(job, _part(config, self.dataset, self.contestant, job.seed, self.several))
            match done:
                case MatcherTrials():
                    trials.append(done)
                case SlamOutcome():
                    folder = self.jobs.places[job.name] / RUN_FOLDER
                    runs.append(replace(done, folder=folder.relative_to(workspace.out).as_posix()))
                case Failure():
                    failures.append(done)
                    if done.stage == "unavailable":
                        break
        whole = None
        if trials:
            whole = pooled(trials, config.trials.model_copy(update={"seed": config.seed}))
        label, name = self.contestant.label, self.contestant.name
        return MatcherOutcome(label, name, self.contestant.parameters, whole, runs, failures)
