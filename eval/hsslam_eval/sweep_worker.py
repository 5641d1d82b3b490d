"""A job on whatever machine a worker runs: done in a folder of its own there, its files sent back.

Workers share no disk with whoever started the sweep, nor their data: a job names its dataset, and the worker finds it
in its own data directory.
"""

from __future__ import annotations

import json
import platform
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from io import BytesIO
from pathlib import Path
from time import perf_counter
from typing import Any

from hsslam import plugin_files
from hsslam.config import validate
from hsslam.environment import environment
from hsslam.errors import HsslamError
from hsslam.io.atomic import atomic_path
from hsslam.version import __version__
from hsslam_eval.compare_config import LimitSection
from hsslam_eval.comparison import Failure
from hsslam_eval.jobs import WORKER_FILE, Job, run_job


@dataclass(frozen=True)
class Order:
    """A job as it is sent to a worker; plain data only, so that any version of hsslam can read and refuse it.

    Parameters
    ----------
    folder : str
        Name of the job's folder.
    job, limits : str
        `Job` and `LimitSection` as JSON.
    terms : dict
        What must be the same here as where the sweep was started; see `terms_of`.
    hands : int
        How many jobs the workers could do at once when it was handed out.
    """

    folder: str
    job: str
    limits: str
    terms: dict[str, Any]
    hands: int


def order(job: Job, folder: str, limits: LimitSection, hands: int) -> Order:
    """Make the order of a job; raises `DataError` where its log cannot be read."""
    return Order(folder, job.model_dump_json(), limits.model_dump_json(), terms_of(job), hands)


def terms_of(job: Job) -> dict[str, Any]:
    """What decides a job's result beside its own settings: hsslam's version, plugin files, the log's content.

    Raises
    ------
    DataError
        The log cannot be read.
    """
    return {
        "version": __version__,
        "plugins": plugin_files.fingerprints(),
        "log": job.dataset.fingerprint(),
    }


def do(order: Mapping[str, Any]) -> dict[str, Any]:
    """Do a job here.

    Parameters
    ----------
    order : mapping
        An `Order`'s fields.

    Returns
    -------
    dict
        ``files``: the job's folder, zipped; ``failure``: a `Failure`'s fields, or None. Nothing that a job does
        raises.
    """
    kind, seed = "job", None
    began = perf_counter()
    with tempfile.TemporaryDirectory(prefix="hsslam-", dir=_local_directory()) as scratch:
        folder = Path(scratch) / str(order["folder"])
        folder.mkdir()
        try:
            job = validate(Job, json.loads(order["job"]))
            kind, seed = job.kind, job.seed
            _check_terms(order["terms"], terms_of(job))
            limits = validate(LimitSection, json.loads(order["limits"]))
            done = run_job(job, folder, limits)
        except HsslamError as error:
            done = Failure(kind, str(error), "", seed)
        seconds = perf_counter() - began
        told = {
            "host": platform.node(),
            "seconds": seconds,
            "hands": order.get("hands", 1),
            "environment": environment(),
        }
        (folder / WORKER_FILE).write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
        return {
            "files": _packed(folder),
            "failure": asdict(done) if isinstance(done, Failure) else None,
        }


def told_by(folder: Path) -> dict[str, Any]:
    """What a worker said of a job that it did: ``host``, ``seconds`` in all, ``hands``, ``environment``.

    Empty where the job was done without workers.
    """
    path = folder / WORKER_FILE
    told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return told


def unpack(files: bytes, folder: Path) -> None:
    """Put what `do` sent into a job's folder, the result last; what an earlier attempt left is overwritten."""
    with zipfile.ZipFile(BytesIO(files)) as archive:
        names = sorted(archive.namelist(), key=lambda name: name == "result.json")
        for name in names:
            target = folder / name
            if not target.resolve().is_relative_to(folder.resolve()):
                raise HsslamError(f"{name}: a worker sent a file that does not belong into {folder}")
            with atomic_path(target) as temporary:
                temporary.write_bytes(archive.read(name))


def _local_directory() -> str | None:
    """The worker's own folder, which Dask clears away after a worker that was killed; None outside of a worker."""
    from distributed import get_worker

    try:
        return str(get_worker().local_directory)
    except ValueError:
        return None


def _packed(folder: Path) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                archive.write(path, path.relative_to(folder).as_posix())
    return buffer.getvalue()


def _check_terms(wanted: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    if wanted["version"] != here["version"]:
        raise HsslamError(
            f"worker {platform.node()} has hsslam {here['version']}, the sweep {wanted['version']}; install the same"
        )
    if wanted["plugins"] != here["plugins"]:
        raise HsslamError(
            f"worker {platform.node()} has plugin files {_named(here['plugins'])}, the sweep "
            f"{_named(wanted['plugins'])}; start it with the same files in {plugin_files.VARIABLE}"
        )
    if wanted["log"] != here["log"]:
        raise HsslamError(f"worker {platform.node()} has another log under this path: its content differs")


def _named(plugins: Mapping[str, str]) -> str:
    return ", ".join(f"{name} ({digest[:8]})" for name, digest in plugins.items()) or "none"
