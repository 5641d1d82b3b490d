"""Several matchers on one dataset: the same trials and the same SLAM settings for each, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from hsslam.environment import environment
from hsslam.errors import DataError
from hsslam_eval.compare_config import CompareConfig, Contestant, DatasetSpec
from hsslam_eval.comparison import (
    Comparison,
    DatasetRecord,
    Failure,
    MatcherOutcome,
    MatcherTrials,
    SlamOutcome,
    read_record,
)
from hsslam_eval.supervise import supervise
from hsslam_eval.workspace import Workspace

__all__ = ["CompareConfig", "DatasetSpec", "Progress", "compare"]


class Progress(Protocol):
    """What `compare` tells while it runs."""

    def __call__(self, stage: str, matcher: str, done: int, total: int) -> None:
        """Take a step.

        Parameters
        ----------
        stage : str
            ``prepare`` (opening the dataset, loading, compiling), ``trials``, ``slam``, ``optimise``, ``map``,
            and at the end of a matcher's part ``done`` or ``failed``.
        matcher : str
            Its label.
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
    """Run trials and SLAM for each matcher, each part in a process of its own.

    What is complete in ``out`` from an earlier call with the same settings is taken as it is; what failed or is
    missing is done. A matcher that is unavailable, raises, crashes or hangs (``config.limits``) costs its own row
    only. The outcome is also written to ``out/comparison.json``.

    Parameters
    ----------
    config : CompareConfig
        What to compare.
    dataset : DatasetSpec
        On what.
    out : path
        A new folder, or that of the same comparison.
    progress : Progress, optional
        Called all the while.
    command : str
        The command line that makes this comparison, for its report.

    Returns
    -------
    Comparison

    Raises
    ------
    ConfigError
        A matcher or a setting is unknown, or ``out`` holds another comparison.
    DataError
        The dataset cannot be opened, or ``out`` holds something else.
    """
    info = dataset.open().info
    workspace = Workspace.prepare(Path(out), config, dataset)
    tell = progress if progress is not None else _silent
    outcomes = [_matcher(workspace, contestant, tell) for contestant in config.contestants]
    comparison = Comparison(
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
        created=datetime.now().astimezone().isoformat(timespec="seconds"),
        environment=environment(),
        matchers=outcomes,
    )
    comparison.save(workspace.out)
    return comparison


def _silent(stage: str, matcher: str, done: int, total: int) -> None:
    pass


def _matcher(workspace: Workspace, contestant: Contestant, tell: Progress) -> MatcherOutcome:
    label, failures = contestant.label, []
    trials: MatcherTrials | None = None
    slam: SlamOutcome | None = None
    if workspace.config.run_trials:
        done = _Part(workspace, label, "trials").complete(MatcherTrials, tell)
        trials = done if isinstance(done, MatcherTrials) else None
        failures += [done] if isinstance(done, Failure) else []
    unavailable = any(failure.stage == "unavailable" for failure in failures)
    if workspace.config.run_slam and not unavailable:
        done = _Part(workspace, label, "slam").complete(SlamOutcome, tell)
        slam = done if isinstance(done, SlamOutcome) else None
        failures += [done] if isinstance(done, Failure) else []
    return MatcherOutcome(label, contestant.name, contestant.parameters, trials, slam, failures)


@dataclass(frozen=True)
class _Part:
    """One matcher's trials or SLAM run."""

    workspace: Workspace
    label: str
    stage: str

    def complete(self, kind: type[Any], tell: Progress) -> Any:
        """Its record, from the folder or by doing it; or the `Failure`."""
        path = self.workspace.record(self.label, self.stage)
        failure: Failure | None = None
        if not path.is_file():
            failure = self._run(tell)
        if failure is None:
            try:
                record = read_record(path, kind)
            except DataError as error:
                failure = Failure(self.stage, str(error), f"rm {path}")
        tell("failed" if failure is not None else "done", self.label, 0, 0)
        return record if failure is None else failure

    def _run(self, tell: Progress) -> Failure | None:
        failure: Failure | None = None
        last = ("prepare", 0, 0)

        def listen(message: dict[str, Any]) -> None:
            nonlocal failure, last
            if "failure" in message:
                failure = Failure(**message["failure"])
            elif "stage" in message:
                last = (message["stage"], message["done"], message["total"])
            stage, done, total = last
            tell(stage, self.label, done, total)

        workspace = self.workspace
        log = workspace.log(self.label, self.stage)
        arguments = [str(workspace.out), self.label, self.stage]
        reason = supervise("hsslam_eval.worker", arguments, log, workspace.config.limits, listen)
        if workspace.record(self.label, self.stage).is_file():
            return None  # complete, whatever the process did afterwards
        if failure is not None:
            return failure
        return Failure(self.stage, reason or "its process ended of its own accord and left no result")
