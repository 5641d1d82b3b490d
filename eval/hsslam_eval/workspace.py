"""The folder of a comparison: what is being compared, and the jobs that are done.

::

    compare.yaml         the resolved config, the datasets and the version: another comparison is refused, unless it is
                         the same and more
    jobs/NAME/           a job's folder, see `hsslam_eval.jobs`
    comparison.json      everything put together
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from hsslam import plugin_files
from hsslam.errors import ConfigError, DataError
from hsslam.io.atomic import atomic_path
from hsslam.settings_file import read_yaml
from hsslam.version import __version__
from hsslam_eval.compare_config import CompareConfig, DatasetSpec

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
    datasets : sequence of DatasetSpec
        On what.
    """

    out: Path
    config: CompareConfig
    datasets: Sequence[DatasetSpec]

    @classmethod
    def prepare(
        cls, out: Path, config: CompareConfig, datasets: DatasetSpec | Sequence[DatasetSpec]
    ) -> Workspace:
        """Make the folder, or come back to it, perhaps with more to compare.

        Raises
        ------
        ConfigError
            It holds another comparison, or one that asks for more: says in which settings.
        DataError
            It holds something else, or cannot be made.
        """
        workspace = cls(out, config, [datasets] if isinstance(datasets, DatasetSpec) else list(datasets))
        try:
            out.mkdir(parents=True, exist_ok=True)
            held = sorted(item.name for item in out.iterdir())
        except OSError as error:
            raise DataError(f"{out}: the folder cannot be made: {error.strerror}") from error
        if _FILE in held:
            was, now = read_yaml(out / _FILE), workspace._identity()
            _check_same(out, was, _without_growth(was, now))
        elif held:
            raise DataError(
                f"{out}: holds something else than a comparison ({held[0]}); choose another folder"
            )
        with atomic_path(out / _FILE) as temporary:
            temporary.write_text(yaml.safe_dump(workspace._identity(), sort_keys=False), encoding="utf-8")
        return workspace

    @property
    def jobs_folder(self) -> Path:
        """Where the jobs' folders are."""
        return self.out / "jobs"

    def _identity(self) -> dict[str, Any]:
        """What decides the results: where the data lie and how long a matcher may take do not."""
        config = {key: value for key, value in self.config.resolved().items() if key != "limits"}
        return {
            "version": __version__,
            "datasets": [dataset.model_dump(mode="json", exclude={"data_dir"}) for dataset in self.datasets],
            "config": config,
            "plugins": plugin_files.fingerprints(),
        }


def _without_growth(was: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, Any]:
    """``now``, with what it has beyond ``was`` left out: no job that is done would be another one for it."""
    before, config = was.get("config") or {}, dict(now["config"])
    if before.get("seeds", 0) <= config["seeds"]:
        config["seeds"] = before.get("seeds")
    for switch in ("run_trials", "run_slam"):
        config[switch] = config[switch] and before.get(switch)
    config["matchers"] = _old_part(before.get("matchers"), config["matchers"])
    return {**now, "config": config, "datasets": _old_part(was.get("datasets"), now["datasets"])}


def _old_part(was: Any, now: list[Any]) -> list[Any]:
    """The items that were there before, in their order then, if all of them still are."""
    return was if isinstance(was, list) and all(item in now for item in was) else now


def _check_same(out: Path, was: Mapping[str, Any], now: Mapping[str, Any]) -> None:
    before, after = (_flat(side) for side in (was, now))
    different = [
        f"{key} was {before.get(key, 'unset')}, now {after.get(key, 'unset')}"
        for key in sorted({*before, *after}, key=lambda key: (not key.endswith((".label", ".name")), key))
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
