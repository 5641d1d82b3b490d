"""The folder of a comparison: what is being compared, and the records of what is done.

::

    compare.yaml             the resolved config, the dataset and the version: another comparison is refused
    records/LABEL.trials.json, records/LABEL.slam.json    there once that part is complete
    runs/LABEL/              the run folder
    logs/LABEL.STAGE.txt     whatever the matcher printed
    comparison.json          everything put together
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hsslam import plugin_files
from hsslam.config import read_yaml, validate
from hsslam.datasets.dataset import Dataset
from hsslam.errors import ConfigError, DataError
from hsslam.io.atomic import atomic_path
from hsslam.version import __version__
from hsslam_eval.compare_config import CompareConfig, Contestant, DatasetSpec

_FILE = "compare.yaml"


@dataclass(frozen=True)
class Workspace:
    """A comparison's folder with what is compared in it.

    Parameters
    ----------
    out : Path
        The folder.
    config : CompareConfig
        Everything that decides what is done.
    dataset : DatasetSpec
        On what.
    """

    out: Path
    config: CompareConfig
    dataset: DatasetSpec

    @classmethod
    def prepare(cls, out: Path, config: CompareConfig, dataset: DatasetSpec) -> Workspace:
        """Make the folder, or come back to it.

        Raises
        ------
        ConfigError
            It holds another comparison: says in which settings.
        DataError
            It holds something else, or cannot be made.
        """
        workspace = cls(out, config, dataset)
        try:
            out.mkdir(parents=True, exist_ok=True)
            held = sorted(item.name for item in out.iterdir())
        except OSError as error:
            raise DataError(f"{out}: the folder cannot be made: {error.strerror}") from error
        if _FILE in held:
            _check_same(out, read_yaml(out / _FILE), workspace._identity())
        elif held:
            raise DataError(
                f"{out}: holds something else than a comparison ({held[0]}); choose another folder"
            )
        for name in ("records", "runs", "logs"):
            (out / name).mkdir(exist_ok=True)
        data_dir = None if dataset.data_dir is None else str(dataset.data_dir)
        apart = {"data_dir": data_dir, "limits": config.limits.model_dump()}
        with atomic_path(out / _FILE) as temporary:
            temporary.write_text(
                yaml.safe_dump({**workspace._identity(), **apart}, sort_keys=False),
                encoding="utf-8",
            )
        return workspace

    @classmethod
    def open(cls, out: Path) -> Workspace:
        """Read what `prepare` wrote; raises what it raises."""
        data = read_yaml(out / _FILE)
        spec = {**data["dataset"], "data_dir": data["data_dir"]}
        return cls(
            out,
            validate(CompareConfig, {**data["config"], "limits": data["limits"]}, source=str(out / _FILE)),
            validate(DatasetSpec, spec, source=str(out / _FILE)),
        )

    def record(self, label: str, stage: str) -> Path:
        """Where the record of a stage goes."""
        return self.out / "records" / f"{label}.{stage}.json"

    def run_folder(self, label: str) -> Path:
        """Where the SLAM run goes."""
        return self.out / "runs" / label

    def log(self, label: str, stage: str) -> Path:
        """Where the output of a stage's process goes."""
        return self.out / "logs" / f"{label}.{stage}.txt"

    @property
    def source(self) -> dict[str, Any]:
        """The dataset as a journal's header names it."""
        spec = self.dataset
        return {"source": spec.name, "scans": spec.scans, "on_error": spec.on_error}

    def contestant(self, label: str) -> Contestant:
        """The matcher of that label."""
        return next(contestant for contestant in self.config.contestants if contestant.label == label)

    def scan_count(self, dataset: Dataset) -> int:
        """How many scans there will be, 0 where that is not known without reading them."""
        known = dataset.info.scan_count
        wanted = self.dataset.scans
        if known is None:
            return wanted or 0
        return min(known, wanted) if wanted is not None else known

    def _identity(self) -> dict[str, Any]:
        """What decides the results: where the data lie and how long a matcher may take do not."""
        config = {key: value for key, value in self.config.resolved().items() if key != "limits"}
        return {
            "version": __version__,
            "dataset": self.dataset.model_dump(mode="json", exclude={"data_dir"}),
            "config": config,
            "plugins": plugin_files.fingerprints(),
        }


def _check_same(out: Path, was: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    before, after = (_flat({**side, "data_dir": None, "limits": None}) for side in (was, now))
    different = [
        f"{key} was {before.get(key, 'unset')}, now {after.get(key, 'unset')}"
        for key in sorted({*before, *after})
        if before.get(key) != after.get(key)
    ]
    if different:
        more = f" and {len(different) - 3} more" if len(different) > 3 else ""
        raise ConfigError(
            f"{out}: holds another comparison ({'; '.join(different[:3])}{more}); "
            "use the same settings to go on with it, or choose another --out"
        )


def _flat(value: Any, prefix: str = "") -> dict[str, str]:
    if isinstance(value, Mapping):
        items = [(str(key), inner) for key, inner in value.items()]
    elif isinstance(value, list | tuple):
        items = [(str(place), inner) for place, inner in enumerate(value)]
    else:
        return {prefix: json.dumps(value)}
    return {
        key: text
        for part, inner in items
        for key, text in _flat(inner, f"{prefix}.{part}" if prefix else part).items()
    }
