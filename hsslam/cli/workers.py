"""What verbs that hand out jobs have in common: their options, and how far the workers are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from hsslam.cli.progress import Progress
from hsslam.errors import ConfigError

if TYPE_CHECKING:
    from hsslam_eval.sweep_queue import Status

Scheduler: TypeAlias = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", help="Hand the jobs to a Dask cluster that runs already: tcp://host:8786."
    ),
]


def check(scheduler: str | None, workers: int | None, data_dir: Path | None) -> None:
    """Refuse options of local workers beside a scheduler; raises `ConfigError`."""
    if scheduler is not None and workers is not None:
        raise ConfigError("--workers starts local ones, --scheduler has its own; give one of the two")
    if scheduler is not None and data_dir is not None:
        raise ConfigError(
            "--data-dir is for local workers; those of a scheduler look in their own data directory "
            "(set HSSLAM_DATA where they start)"
        )


class Tell:
    """Turns what `hsslam_eval.sweep_queue.run_jobs` tells into progress.

    Parameters
    ----------
    shown : Progress
        Where it is shown.
    what : str
        What the jobs are, together.
    """

    def __init__(self, shown: Progress, what: str) -> None:
        self._shown = shown
        self._what = what
        self._began = False

    def __call__(self, status: Status) -> None:
        """Take a step."""
        if not self._began:
            self._began = True
            self._shown.stage(self._what, status.total, "jobs")
        notes = [f"{status.failed} failed"] if status.failed else []
        notes.append(f"{status.hands} at once" if status.hands else "waiting for a worker")
        self._shown.update(status.done + status.failed, ", ".join(notes))
