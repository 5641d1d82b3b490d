"""What a sweep goes through: matchers x datasets x seeds x grids of parameters, as a list of independent jobs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import Field, field_validator, model_serializer, model_validator

from hsslam.config import merge, validate
from hsslam.errors import ConfigError
from hsslam_eval.compare_config import CompareConfig, Contestant, DatasetSpec
from hsslam_eval.compare_jobs import jobs_of
from hsslam_eval.jobs import Job, Kind

Grid: TypeAlias = Annotated[dict[str, Annotated[list[Any], Field(min_length=1)]], Field(min_length=1)]
"""Values to go through, by the name of the setting."""


class Entrant(Contestant):
    """A matcher with parameters beside its name, and a grid of others: every combination is one entry."""

    grid: Grid = Field(default={}, description="parameters with the list of values to go through")

    @model_validator(mode="after")
    def _one_place(self) -> Entrant:
        _no_repeats(self.grid)
        for name in self.grid:
            if name in (self.__pydantic_extra__ or {}):
                raise ValueError(f"grid.{name}: is given a value beside the grid too; keep one of the two")
        return self

    @model_serializer
    def _resolved(self) -> dict[str, Any]:
        fixed = {name: value for name, value in self.parameters.items() if name not in self.grid}
        return {"name": self.name, "label": self.label, **fixed, **({"grid": self.grid} if self.grid else {})}


class SweepConfig(CompareConfig):
    """Everything that decides what a sweep does: a comparison's settings, datasets and grids."""

    matchers: tuple[Entrant, ...] = Field(
        min_length=1,
        description="matchers by name, or {name: ..., parameter: value, grid: {parameter: [...]}}",
    )
    datasets: tuple[DatasetSpec, ...] = Field(
        min_length=1, description="by name or path, or {name: ..., scans: ..., seed: ..., on_error: ...}"
    )
    grid: Grid = Field(
        default={},
        description="settings for all matchers, slam.... or trials...., with the list of values to go through",
    )

    @field_validator("datasets", mode="before")
    @classmethod
    def _names_alone(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            return value
        for item in value:
            if isinstance(item, dict) and "data_dir" in item:
                raise ValueError(
                    "data_dir: every machine has its own; give --data-dir, or set HSSLAM_DATA where the worker starts"
                )
        return [{"name": item} if isinstance(item, str) else item for item in value]

    @model_validator(mode="after")
    def _grid_is_used(self) -> SweepConfig:
        _no_repeats(self.grid)
        for key in self.grid:
            kind = key.partition(".")[0]
            if kind not in ("slam", "trials") or not key.partition(".")[2]:
                raise ValueError(
                    f"grid.{key}: expected a setting of slam or of trials, e.g. slam.tracker.min_score; "
                    "a matcher's parameters go into its own grid"
                )
            if not (self.run_slam if kind == "slam" else self.run_trials):
                raise ValueError(f"grid.{key}: would change nothing, as run_{kind} is off")
        return self

    def resolved(self) -> dict[str, Any]:
        """Every setting as plain data; what has its place elsewhere left out."""
        data = super().resolved()
        for item, spec in zip(data["datasets"], self.datasets, strict=True):
            item["seed"] = _seed_of(spec, self.seed)
            item.pop("data_dir")
        if not self.grid:
            data.pop("grid")
        return data


@dataclass(frozen=True)
class Point:
    """One job of a sweep, and where in the grids it is.

    Parameters
    ----------
    job : Job
        What is done there.
    parameters : dict
        Of the matcher: those that its grid goes through.
    settings : dict
        Of trials or SLAM, by their dotted name: those that the sweep's grid goes through.
    """

    job: Job
    parameters: dict[str, Any]
    settings: dict[str, Any]


def expand(config: SweepConfig, source: str = "", data_dir: Path | None = None) -> list[Point]:
    """List the jobs of a sweep: dataset by dataset, matcher by matcher, grid point by grid point, seed by seed.

    Parameters
    ----------
    config : SweepConfig
        The sweep.
    source : str
        The file that it was read from, for errors.
    data_dir : path, optional
        Where real logs are looked for by the one that does the job; it does not change the job's key.

    Returns
    -------
    list of Point
        Jobs are those of `hsslam_eval.compare` with the same settings, with the same keys.

    Raises
    ------
    ConfigError
        A value of a grid is out of its range, or its name is no setting.
    DataError
        A dataset's name is no dataset, or a log cannot be read.
    """
    points = []
    datasets = [_located(spec, config.seed, data_dir) for spec in config.datasets]
    for dataset in datasets:
        for entrant in config.contestants:
            assert isinstance(entrant, Entrant)
            for parameters in _combinations(entrant.grid):
                for kind in _kinds(config):
                    own = {key: values for key, values in config.grid.items() if key.startswith(f"{kind}.")}
                    for settings in _combinations(own):
                        single = _single(config, entrant, parameters, kind, settings, source)
                        points += [
                            Point(job, parameters, settings)
                            for job in jobs_of(single, dataset, single.contestants[0])
                        ]
    return points


def _kinds(config: CompareConfig) -> Iterator[Kind]:
    if config.run_trials:
        yield "trials"
    if config.run_slam:
        yield "slam"


def _located(spec: DatasetSpec, seed: int, data_dir: Path | None) -> DatasetSpec:
    """A dataset with its own seed or that of the sweep, a log by its full path: workers start in other folders."""
    from hsslam.datasets.catalogue import names

    if spec.name not in names():
        spec.open()
    return spec.located().model_copy(update={"seed": _seed_of(spec, seed), "data_dir": data_dir})


def _seed_of(spec: DatasetSpec, seed: int) -> int:
    return spec.seed if "seed" in spec.model_fields_set else seed


def _single(
    config: SweepConfig,
    entrant: Entrant,
    parameters: Mapping[str, Any],
    kind: Kind,
    settings: Mapping[str, Any],
    source: str,
) -> CompareConfig:
    """The comparison that one point of the grids is, of one matcher and one kind of job."""
    data: dict[str, Any] = {
        "matchers": [
            {
                "name": entrant.name,
                "label": entrant.label,
                **(entrant.__pydantic_extra__ or {}),
                **parameters,
            }
        ],
        "seed": config.seed,
        "seeds": config.seeds,
        "run_trials": kind == "trials",
        "run_slam": kind == "slam",
        "trials": config.trials.model_dump(mode="json", exclude={"seed"}),
        "slam": config.slam.model_dump(mode="json", exclude={"seed", "matcher"}),
        "limits": config.limits.model_dump(mode="json"),
    }
    for key, value in settings.items():
        nested = value
        for part in reversed(key.split(".")):
            nested = {part: nested}
        data[kind] = merge(data[kind], nested[kind])
    try:
        return validate(CompareConfig, data)
    except ConfigError as error:
        where = f"{source}: " if source else ""
        raise ConfigError(f"{where}grid: {error}") from error


def _combinations(grid: Mapping[str, list[Any]]) -> Iterator[dict[str, Any]]:
    """Every choice of one value for each name; one empty choice where there is no grid."""
    for values in product(*grid.values()):
        yield dict(zip(grid, values, strict=True))


def _no_repeats(grid: Mapping[str, list[Any]]) -> None:
    for name, values in grid.items():
        seen = [repr(value) for value in values]
        for value in seen:
            if seen.count(value) > 1:
                raise ValueError(f"grid.{name}: has {value} more than once")
