"""Several matchers on one dataset or more: the same trials and the same SLAM settings for each.

A comparison is a sweep without a grid whose rows are put side by side: its jobs are those of `hsslam_eval.sweep`, done
one after the other so that their times can be compared, or by the same workers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from hsslam.datasets.file import FileDataset
from hsslam.datasets.usable import require_returns
from hsslam.environment import environment
from hsslam_eval.compare_config import CompareConfig, Contestant, DatasetSpec
from hsslam_eval.compare_jobs import (
    ComparisonJobs,
    Hands,
    Progress,
    jobs_of,
    part_name,
    part_names,
)
from hsslam_eval.comparison import (
    Comparison,
    DatasetRecord,
    Failure,
    MatcherOutcome,
    MatcherTrials,
    SlamOutcome,
    Study,
)
from hsslam_eval.jobs import RUN_FOLDER
from hsslam_eval.outcomes import pooled
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
    jobs = ComparisonJobs.of(workspace, hands, progress if progress is not None else _silent)
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


def _silent(stage: str, part: str, done: int, total: int) -> None:
    pass


@dataclass(frozen=True)
class _Row:
    """One matcher on one dataset."""

    jobs: ComparisonJobs
    dataset: DatasetSpec
    contestant: Contestant
    several: bool

    def outcome(self) -> MatcherOutcome:
        workspace = self.jobs.workspace
        config, failures = workspace.config, list[Failure]()
        trials, runs = list[MatcherTrials](), list[SlamOutcome]()
        for job in jobs_of(config, self.dataset, self.contestant):
            done = self.jobs.result(
                job, part_name(config, self.dataset, self.contestant, job.seed, self.several)
            )
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
