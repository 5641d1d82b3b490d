"""Several matchers on one dataset or more: the same trials and the same SLAM settings for each, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
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
from hsslam_eval.jobs import RUN_FOLDER, Job, Kind, run_job
from hsslam_eval.outcomes import pooled
from hsslam_eval.workspace import Workspace

__all__ = ["CompareConfig", "DatasetSpec", "Progress", "compare", "compare_datasets", "jobs_of", "part_names"]


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
) -> Study:
    """Run trials and SLAM for each dataset, matcher and seed, each job in a process of its own.

    What is complete in ``out`` from an earlier call with the same settings is taken as it is; what failed or is
    missing is done. A matcher that is unavailable, raises, crashes or hangs (``config.limits``) costs its own row
    only. The outcome is also written to ``out/comparison.json``.

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

    Returns
    -------
    Study

    Raises
    ------
    ConfigError
        A matcher or a setting is unknown, or ``out`` holds another comparison.
    DataError
        A dataset cannot be opened or holds nothing to match, or ``out`` holds something else.
    """
    infos = []
    for dataset in datasets:
        log = dataset.open()
        if isinstance(log, FileDataset):  # a plugin's is read by the jobs only: it may crash
            require_returns(log)
        infos.append(log.info)
    workspace = Workspace.prepare(Path(out), config, datasets)
    tell = progress if progress is not None else _silent
    now = datetime.now().astimezone().isoformat(timespec="seconds")
    several = len(datasets) > 1
    study = Study(
        [
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
                matchers=[
                    _Row(workspace, dataset, contestant, several, tell).outcome()
                    for contestant in config.contestants
                ],
            )
            for dataset, info in zip(datasets, infos, strict=True)
        ]
    )
    study.save(workspace.out)
    return study


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
class _Row:
    """One matcher on one dataset."""

    workspace: Workspace
    dataset: DatasetSpec
    contestant: Contestant
    several: bool
    tell: Progress

    def outcome(self) -> MatcherOutcome:
        config, failures = self.workspace.config, list[Failure]()
        trials, runs = list[MatcherTrials](), list[SlamOutcome]()
        for job in jobs_of(config, self.dataset, self.contestant):
            done = self._run(job)
            match done:
                case MatcherTrials():
                    trials.append(done)
                case SlamOutcome():
                    folder = self.workspace.folder(job) / RUN_FOLDER
                    runs.append(replace(done, folder=folder.relative_to(self.workspace.out).as_posix()))
                case Failure():
                    failures.append(done)
                    if done.stage == "unavailable":
                        break
        whole = None
        if trials:
            whole = pooled(trials, config.trials.model_copy(update={"seed": config.seed}))
        label, name = self.contestant.label, self.contestant.name
        return MatcherOutcome(label, name, self.contestant.parameters, whole, runs, failures)

    def _run(self, job: Job) -> MatcherTrials | SlamOutcome | Failure:
        part = _part(self.workspace.config, self.dataset, self.contestant, job.seed, self.several)
        done = run_job(
            job,
            self.workspace.folder(job),
            self.workspace.config.limits,
            lambda stage, done, total: self.tell(stage, part, done, total),
        )
        self.tell("failed" if isinstance(done, Failure) else "done", part, 0, 0)
        return done
