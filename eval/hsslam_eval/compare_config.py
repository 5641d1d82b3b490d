"""What is compared: matchers, trials, SLAM settings shared by all."""

from __future__ import annotations

import glob
import hashlib
import re
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, model_serializer, model_validator

from hsslam.config import Config, Section
from hsslam.datasets.dataset import Dataset
from hsslam.errors import DataError, MatcherUnavailableError
from hsslam.matching import registry
from hsslam_eval.trial_config import TrialConfig

DEFAULT_MATCHERS = ("hsl", "hide", "glasm", "icp", "kiss_icp")
"""Compared where none are named: the paper's two, the one it beats, and the two most used."""


class Contestant(BaseModel):
    """A matcher by name, with its parameters beside the name and, where two share a name, a label.

    Unlike `hsslam.config.MatcherSection` it may name a matcher that cannot run here: that costs its row only.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="allow")

    name: str = Field(description="a name that `hsslam matchers` lists")
    label: str = Field(default="", description="what reports call it; its name where left out")

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"name": value} if isinstance(value, str) else value

    @property
    def parameters(self) -> dict[str, Any]:
        """Resolved parameters, or those given where the matcher's module cannot be loaded.

        Raises
        ------
        ConfigError
            Unknown matcher, unknown parameter, or a value out of its range.
        """
        given = dict(self.__pydantic_extra__ or {})
        try:
            return registry.configure(self.name, given, self.label).model_dump(mode="json")
        except MatcherUnavailableError:
            return given

    @model_serializer
    def _resolved(self) -> dict[str, Any]:
        return {"name": self.name, "label": self.label, **self.parameters}


class LimitSection(Section):
    """When a matcher's part of a comparison, its trials or its SLAM run, is given up."""

    step: float = Field(
        default=300.0,
        ge=0.0,
        description="it took no step (a trial, a scan, a stage) for this long (s; 0: never)",
    )
    total: float = Field(default=0.0, ge=0.0, description="it took longer than this in all (s; 0: never)")


class CompareConfig(Section):
    """Everything that decides what a comparison does."""

    matchers: tuple[Contestant, ...] = Field(
        min_length=1, description="matchers by name, or {name: ..., label: ..., parameter: value}"
    )
    seed: int = Field(
        default=0, ge=0, description="of trials and SLAM alike: every random choice follows from it"
    )
    seeds: int = Field(default=1, ge=1, description="how often everything is run: with seed, seed + 1, ...")
    run_trials: bool = Field(default=True, description="whether to run trials")
    run_slam: bool = Field(default=True, description="whether to run SLAM")
    trials: TrialConfig = Field(default_factory=TrialConfig, description="the same trials for every matcher")
    slam: Config = Field(
        default_factory=Config, description="settings of SLAM shared by all; its matcher is each one in turn"
    )
    limits: LimitSection = Field(
        default=LimitSection(), description="when a matcher is given up; the others go on"
    )

    @model_validator(mode="before")
    @classmethod
    def _one_place(cls, data: Any) -> Any:
        for section, key in (("slam", "matcher"), ("slam", "seed"), ("trials", "seed")):
            given = data.get(section) if isinstance(data, dict) else None
            if isinstance(given, dict) and key in given:
                there = "matchers" if key == "matcher" else key
                raise ValueError(
                    f"{section}.{key}: a comparison has one place for that: {there}, not {section}.{key}"
                )
        return data

    @model_validator(mode="after")
    def _check(self) -> CompareConfig:
        if not (self.run_trials or self.run_slam):
            raise ValueError("nothing to do: both run_trials and run_slam are off")
        labels = [contestant.label for contestant in self.contestants]
        if len({label.casefold() for label in labels}) < len(labels):
            raise ValueError(f"two matchers would have the same label: {', '.join(labels)}; give one another")
        for label in labels:
            if not label or not set(label) <= _LABEL_CHARACTERS or label.startswith("."):
                raise ValueError(
                    f"a label names files, so it is made of letters, digits, - _ . +, found {label!r}"
                )
        for contestant in self.contestants:
            contestant.parameters  # noqa: B018  (validates: a bad parameter is found before anything runs)
        return self

    @property
    def contestants(self) -> list[Contestant]:
        """The matchers, each with a label of its own: its name, numbered from the second of that name on."""
        taken: dict[str, int] = {}
        out = []
        for contestant in self.matchers:
            wanted = contestant.label or contestant.name
            taken[wanted] = taken.get(wanted, 0) + 1
            label = wanted if taken[wanted] == 1 else f"{wanted}-{taken[wanted]}"
            out.append(contestant.model_copy(update={"label": label}))
        return out

    def resolved(self) -> dict[str, Any]:
        """Every setting as plain data; what has its place elsewhere left out."""
        data = self.model_dump(mode="json")
        data["matchers"] = [contestant.model_dump(mode="json") for contestant in self.contestants]
        data["slam"].pop("matcher")
        data["slam"].pop("seed")
        data["trials"].pop("seed")
        return data


_LABEL_CHARACTERS = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_.+")


class DatasetSpec(Section):
    """How to open the dataset, in any process: the arguments of `hsslam.datasets.catalogue.open_dataset`."""

    name: str = Field(description="a dataset's name, or the path of a log")
    data_dir: Path | None = Field(default=None, description="where real logs are looked for")
    seed: int = Field(default=0, ge=0, description="of a simulated dataset")
    scans: int | None = Field(default=None, ge=1, description="how many scans of it; all where left out")
    on_error: Literal["stop", "skip"] = Field(
        default="stop", description="what a malformed line of a log does"
    )

    @property
    def stem(self) -> str:
        """What files made from it are called."""
        stem = Path(self.name).name.partition(".")[0]
        return re.sub(r"[^0-9A-Za-z_+-]", "_", stem) or "log"

    def fingerprint(self) -> str:
        """What tells its data from others': a built-in dataset's name, or the sha256 of a log and its relations.

        Raises
        ------
        DataError
            The log cannot be read.
        """
        from hsslam.datasets.catalogue import names

        if self.name in names():
            return self.name
        path = Path(self.name)
        digest = hashlib.sha256()
        beside = sorted(path.parent.glob(f"{glob.escape(path.name.partition('.')[0])}.relations*"))
        try:
            for file in (path, *beside):
                digest.update(file.read_bytes())
        except OSError as error:
            raise DataError(f"{file}: cannot be read: {error.strerror}") from error
        return digest.hexdigest()

    def located(self) -> DatasetSpec:
        """The same, a log by its full path: for workers, which start in other folders."""
        from hsslam.datasets.catalogue import join_source

        return self.model_copy(update={"name": join_source(self.name)})

    def open(self) -> Dataset:
        """Open it; raises what `open_dataset` raises."""
        from hsslam.datasets.catalogue import open_dataset

        return open_dataset(
            self.name, data_dir=self.data_dir, seed=self.seed, scans=self.scans, on_error=self.on_error
        )
