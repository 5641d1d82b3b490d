"""A job: one matcher on one dataset with one seed, its trials or its SLAM run.

What a job is, decides its key; a job with a result in its folder is done. So a list of jobs may be run in any order,
in any process, be interrupted and run again, and what comes out is the same. `hsslam_eval.compare` and
`hsslam_eval.sweep` are such lists.

A job's folder::

    job.json      the job
    result.json   its record, there once it is complete
    log.txt       whatever the matcher printed
    worker.json   where it was done, if by a worker of `hsslam_eval.sweep_pool`
    run/          the run folder of SLAM
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import Field, model_validator

from hsslam import plugin_files
from hsslam.config import Config, MatcherSection, Section, validate
from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.version import __version__
from hsslam_eval.compare_config import Contestant, DatasetSpec, LimitSection
from hsslam_eval.comparison import Failure, MatcherTrials, SlamOutcome
from hsslam_eval.record_files import read_record
from hsslam_eval.supervise import supervise
from hsslam_eval.trial_config import TrialConfig

JOB_FILE, RESULT_FILE, LOG_FILE, RUN_FOLDER = "job.json", "result.json", "log.txt", "run"
WORKER_FILE = "worker.json"

Kind = Literal["trials", "slam"]
Result: TypeAlias = MatcherTrials | SlamOutcome | Failure
Listener = Callable[[str, int, int], None]
"""Takes the stage that a job is at, and how far it is: done, total (0 where that is not known)."""


class Job(Section):
    """Everything that decides what one job does."""

    kind: Kind = Field(description="trials with known truth, or a SLAM run")
    dataset: DatasetSpec = Field(description="on what")
    matcher: Contestant = Field(description="by which matcher")
    seed: int = Field(default=0, ge=0, description="every random choice follows from it")
    trials: TrialConfig = Field(default_factory=TrialConfig, description="what the trials are")
    slam: Config = Field(default_factory=Config, description="settings of SLAM; the matcher is the job's")

    @model_validator(mode="before")
    @classmethod
    def _one_seed(cls, data: Any) -> Any:
        # The part that a job does not use must not change its key.
        unused = (
            {"trials": "slam", "slam": "trials"}.get(str(data.get("kind")))
            if isinstance(data, dict)
            else None
        )
        return {key: value for key, value in data.items() if key != unused} if unused else data

    @property
    def trial_config(self) -> TrialConfig:
        """The trials' settings with the job's seed."""
        return self.trials.model_copy(update={"seed": self.seed})

    @property
    def slam_config(self) -> Config:
        """The settings of the SLAM run.

        Raises
        ------
        ConfigError, MatcherUnavailableError
            The matcher cannot be configured.
        """
        matcher = MatcherSection.model_validate({"name": self.matcher.name, **self.matcher.parameters})
        return self.slam.model_copy(update={"seed": self.seed, "matcher": matcher})

    @property
    def source(self) -> dict[str, Any]:
        """The dataset as a journal's header names it."""
        return {
            "source": self.dataset.name,
            "scans": self.dataset.scans,
            "on_error": self.dataset.on_error,
        }

    @cached_property
    def key(self) -> str:
        """Sha256 of everything that decides the result: labels, and where the data lie, do not.

        Raises
        ------
        DataError
            The log is a file that cannot be read.
        """
        settings: dict[str, Any] = {
            "version": __version__,
            "plugins": plugin_files.fingerprints(),
            "kind": self.kind,
            "dataset": self.dataset.model_dump(mode="json", exclude={"data_dir", "name"}),
            "log": self.dataset.fingerprint(),
            "matcher": [self.matcher.name, self.matcher.parameters],
            "seed": self.seed,
        }
        if self.kind == "trials":
            settings["settings"] = self.trials.model_dump(mode="json", exclude={"seed"})
        else:
            settings["settings"] = self.slam.model_dump(mode="json", exclude={"seed", "matcher"})
        return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()

    @property
    def name(self) -> str:
        """What its folder is called: readable, and different for different jobs."""
        return f"{self.dataset.stem}-{self.matcher.label}-seed{self.seed}-{self.kind}-{self.key[:12]}"

    def save(self, folder: Path) -> Path:
        """Write ``job.json`` into the job's folder."""
        with atomic_path(folder / JOB_FILE) as temporary:
            temporary.write_text(self.model_dump_json(indent=1) + "\n", encoding="utf-8")
        return folder / JOB_FILE

    @staticmethod
    def load(folder: Path) -> Job:
        """Read what `save` wrote; raises `DataError` or `ConfigError`."""
        path = folder / JOB_FILE
        try:
            data = json.loads(path.read_text(encoding="utf-8"))
        except OSError as error:
            raise DataError(f"{path}: cannot be read: {error.strerror}") from error
        except ValueError as error:
            raise DataError(f"{path}: is no job: {error}") from error
        return validate(Job, data, source=str(path))


def result_of(job: Job, folder: Path) -> MatcherTrials | SlamOutcome | None:
    """Read a job's result; None where it is not complete.

    Raises
    ------
    DataError
        There is one that cannot be read.
    """
    path = folder / RESULT_FILE
    if not path.is_file():
        return None
    return read_record(path, MatcherTrials) if job.kind == "trials" else read_record(path, SlamOutcome)


def held(job: Job, folder: Path) -> Result | None:
    """Read a job's result as `result_of` does; one that cannot be read is a failure."""
    try:
        return result_of(job, folder)
    except DataError as error:
        return Failure(job.kind, str(error), f"rm {folder / RESULT_FILE}", job.seed)


def places(folder: Path, jobs: Mapping[str, Job]) -> dict[str, Path]:
    """Each job's folder within ``folder``: the one that it has, whatever its matcher was called then, or a new one.

    Parameters
    ----------
    folder : path
        Where folders of jobs are.
    jobs : mapping
        Jobs by names of the caller's.

    Returns
    -------
    dict
        Folders by the same names; one for each job.
    """
    own = {name: folder / job.name for name, job in jobs.items()}
    taken = {path.name for path in own.values()}
    others = {
        path.name.rpartition("-")[2]: path for path in sorted(folder.glob("*-*")) if path.name not in taken
    }
    return {
        name: path if path.exists() else others.pop(jobs[name].key[:12], path) for name, path in own.items()
    }


def run_job(
    job: Job, folder: Path, limits: LimitSection | None = None, listener: Listener | None = None
) -> Result:
    """Do a job in a process of its own, or take its result from its folder where there is one.

    A process of its own makes the peak memory that matcher's; one that raises, crashes or hangs costs this job only.

    Parameters
    ----------
    job : Job
        What to do.
    folder : path
        The job's own, by custom ``job.name``; made where it is missing.
    limits : LimitSection, optional
        When it is given up.
    listener : callable, optional
        Told how far it is. Where it raises, the process ends, and what is complete stays.

    Returns
    -------
    MatcherTrials, SlamOutcome or Failure
        A failed job is done anew by the next call.
    """
    found = held(job, folder)
    if found is not None:
        return found
    folder.mkdir(parents=True, exist_ok=True)
    (folder / WORKER_FILE).unlink(missing_ok=True)  # of an earlier attempt, elsewhere
    job.save(folder)
    failure: Failure | None = None
    last = ("prepare", 0, 0)

    def listen(message: dict[str, Any]) -> None:
        nonlocal failure, last
        if "failure" in message:
            failure = Failure(**message["failure"])
        elif "stage" in message:
            last = (message["stage"], message["done"], message["total"])
        if listener is not None:
            listener(*last)

    reason = supervise(
        "hsslam_eval.worker", [str(folder)], folder / LOG_FILE, limits or LimitSection(), listen
    )
    found = result_of(job, folder)
    if found is not None:
        return found  # complete, whatever the process did afterwards
    if failure is not None:
        return failure
    return Failure(job.kind, reason or "its process ended of its own accord and left no result", "", job.seed)
