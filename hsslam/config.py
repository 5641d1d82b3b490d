"""Every setting of a SLAM run in one typed place: YAML in, validated; resolved YAML out.

A matcher is chosen by its name alone (``matcher: hide``) or with parameters
(``matcher: {name: hide, memory_size: 40}``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_serializer, model_validator

from hsslam import presets as preset_files
from hsslam.errors import ConfigError
from hsslam.matching import registry
from hsslam.matching.interface import Matcher, MatcherConfig
from hsslam.settings_file import blamed, read_yaml
from hsslam.validation import explain


class Section(BaseModel):
    """Base of every section: unknown keys are errors, values do not change after validation."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, data: Any) -> Any:
        """Keep the rest of a default section that is given in part: two windows have different defaults."""
        if not isinstance(data, dict):
            return data
        out = dict(data)
        for name, field in cls.model_fields.items():
            if isinstance(field.default, Section) and isinstance(out.get(name), dict):
                out[name] = {**field.default.model_dump(), **out[name]}
        return out


class MatcherSection(BaseModel):
    """A matcher by name, with its parameters beside the name; resolved against the matcher's own model."""

    model_config: ClassVar[ConfigDict] = ConfigDict(frozen=True, extra="allow")

    name: str = Field(description="a name that `hsslam matchers` lists")

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"name": value} if isinstance(value, str) else value

    @model_validator(mode="after")
    def _resolve(self) -> MatcherSection:
        self.parameters  # noqa: B018  (validates, so that a bad parameter is found when the config is read)
        return self

    @property
    def parameters(self) -> MatcherConfig:
        """The matcher's validated parameters.

        Raises
        ------
        ConfigError
            Unknown matcher, unknown parameter, or a value out of its range.
        MatcherUnavailableError
            The matcher's module cannot be imported.
        """
        return registry.configure(self.name, self.__pydantic_extra__)

    def create(self) -> Matcher[Any]:
        """Make the matcher; raises what `hsslam.matching.create` does."""
        return registry.create(self.name, self.__pydantic_extra__ or {})

    @model_serializer
    def _resolved(self) -> dict[str, Any]:
        return {"name": self.name, **self.parameters.model_dump()}


class WindowSection(Section):
    """How far the truth may be from the prediction."""

    half_x: float = Field(gt=0.0, description="half side of the search window along x (m)")
    half_y: float = Field(gt=0.0, description="half side of the search window along y (m)")
    half_theta_deg: float = Field(gt=0.0, le=180.0, description="half its extent in heading (deg)")


class TrackerSection(Section):
    """Front end: every scan against the local submap."""

    window: WindowSection = WindowSection(half_x=0.2, half_y=0.2, half_theta_deg=10.0)
    min_score: float = Field(
        default=0.5, ge=0.0, le=1.0, description="below this score odometry is trusted instead"
    )
    recovery_score: float = Field(
        default=0.75,
        ge=0.0,
        le=1.0,
        description="below this score odometry is doubted and a wide window searched",
    )
    fuse_odometry: bool = Field(
        default=True,
        description="weigh the match and odometry's prediction by their covariances (a Kalman update)",
    )
    recovery_window: WindowSection = WindowSection(half_x=0.75, half_y=0.75, half_theta_deg=60.0)
    deskew: bool = Field(
        default=True, description="undo the robot's motion during a scan, if the log tells how long that took"
    )
    own_parts: bool = Field(default=True, description="leave out what the laser sees of the robot itself")


class KeyframeSection(Section):
    """When a scan becomes a keyframe, and how many make a submap."""

    distance: float = Field(default=0.5, gt=0.0, description="a keyframe after this much travel (m)")
    angle_deg: float = Field(default=10.0, gt=0.0, description="or after this much turning (deg)")
    min_score: float = Field(
        default=0.8,
        ge=0.0,
        le=1.0,
        description="or after a third of these, where the submap explains less than this share of the scan",
    )
    submap_size: int = Field(
        default=30, ge=1, description="keyframes in a full local submap; half as many in a young one"
    )


class LoopSection(Section):
    """Loop closure: candidates near by, matched over a window as wide as the graph is unsure, verified."""

    enabled: bool = Field(default=True, description="look for loops at all")
    radius: float = Field(
        default=3.0,
        gt=0.0,
        description="candidates within this distance of the estimate, and two of its standard deviations (m)",
    )
    min_gap: int = Field(default=20, ge=1, description="keyframes between the two ends of a loop, at least")
    submap_size: int = Field(default=12, ge=1, description="keyframes in the submap around a candidate")
    every: int = Field(default=1, ge=1, description="look for a loop at every n-th keyframe")
    candidates: int = Field(default=2, ge=1, description="candidates tried per keyframe, nearest first")
    window: WindowSection = WindowSection(half_x=1.0, half_y=1.0, half_theta_deg=20.0)
    far_window: WindowSection = WindowSection(half_x=8.0, half_y=8.0, half_theta_deg=40.0)
    min_score: float = Field(default=0.6, ge=0.0, le=1.0, description="share of points a loop must explain")
    max_std: float = Field(
        default=0.2, gt=0.0, description="largest standard deviation of an accepted loop (m)"
    )
    expected_std: float = Field(
        default=0.15,
        ge=0.0,
        description="a loop that the graph foresees this well (m) and that is where it is foreseen needs no others",
    )
    agreeing: int = Field(
        default=2, ge=0, description="other loops that must agree with a loop that the graph does not foresee"
    )
    patience: int = Field(
        default=30, ge=1, description="keyframes that such a loop waits for others to agree"
    )
    max_ambiguity: float = Field(
        default=0.95,
        gt=0.0,
        description="refuse it where an answer elsewhere scores more than this share of its own score",
    )


class GraphSection(Section):
    """Back end: the GTSAM pose graph."""

    robust: Literal["cauchy", "gnc", "none"] = Field(
        default="cauchy", description="loss on loop factors at the end"
    )
    robust_scale: float = Field(
        default=1.0, gt=0.0, description="scale of the robust loss (standard deviations)"
    )
    odometry_std_xy: float = Field(
        default=0.1,
        gt=0.0,
        description="standard deviation per metre where odometry stands in for a match (m/m)",
    )
    odometry_std_theta_deg: float = Field(
        default=20.0,
        gt=0.0,
        description="its standard deviation of heading per radian turned or metre driven (deg)",
    )
    refine_rounds: int = Field(
        default=1,
        ge=0,
        description="rounds of matching overlapping keyframes again at the end, at most: they end when nothing moves",
    )
    marginals: bool = Field(
        default=False,
        description="work out at the end how well every keyframe's pose is known (covariances.csv)",
    )
    overlap_radius: float = Field(
        default=5.0, gt=0.0, description="keyframes within this distance may overlap (m)"
    )
    overlap_neighbours: int = Field(
        default=8, ge=1, description="overlapping keyframes matched with each, at most"
    )
    overlap_half_xy: float = Field(
        default=0.15, gt=0.0, description="half side of the window of such a match (m)"
    )
    overlap_half_theta_deg: float = Field(default=5.0, gt=0.0, description="half its extent in heading (deg)")
    rescan_keyframes: int = Field(
        default=10,
        ge=0,
        description="keyframes every scan is matched against once more at the very end (0: not at all)",
    )
    rescan_neighbours: int = Field(
        default=1,
        ge=0,
        description="then, keyframes before it, and as many after it, that every scan is matched against one by one",
    )
    overlap_min_score: float = Field(
        default=0.35, ge=0.0, le=1.0, description="share of points such a match must explain"
    )
    threads: int = Field(
        default=0,
        ge=0,
        description="threads that match side by side at the end, where the matcher can; what they find does not "
        "depend on it (0: one for each core, 4 at most)",
    )


class MapSection(Section):
    """The occupancy grid."""

    resolution: float = Field(default=0.05, gt=0.0, description="side of a cell (m)")
    max_range: float = Field(default=30.0, gt=0.0, description="beams are cut at this range (m)")


class Config(Section):
    """Everything that decides what a SLAM run does."""

    seed: int = Field(default=0, ge=0, description="every random choice follows from it")
    matcher: MatcherSection = Field(
        default_factory=lambda: MatcherSection(name="hide"), description="tracks every scan"
    )
    loop_matcher: MatcherSection | None = Field(
        default=None, description="closes loops; the tracker's where left out"
    )
    tracker: TrackerSection = TrackerSection()
    keyframes: KeyframeSection = KeyframeSection()
    loops: LoopSection = LoopSection()
    graph: GraphSection = GraphSection()
    map: MapSection = MapSection()

    @model_validator(mode="before")
    @classmethod
    def _presets(cls, data: Any) -> Any:
        return expand(data) if isinstance(data, dict) and "preset" in data else data


def expand(data: dict[str, Any]) -> dict[str, Any]:
    """Settings with the presets that their key ``preset`` names laid under them, and without the key.

    Raises
    ------
    ConfigError
        No preset has the name.
    """
    named = data.get("preset") or ()
    names = [named] if isinstance(named, str) else named
    if not (isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)):
        raise ConfigError(f"preset: expected a name or a list of names, found {named!r}", ("preset",), named)
    under: dict[str, Any] = {}
    for name in names:
        under = merge(under, preset_files.settings(name))
    return merge(under, {key: value for key, value in data.items() if key != "preset"})


def load_config(
    path: Path | str | None = None,
    overrides: Iterable[str] = (),
    base: Mapping[str, Any] | None = None,
    chosen: Mapping[str, Any] | None = None,
    presets: Sequence[str] = (),
) -> Config:
    """Read a config.

    Parameters
    ----------
    path : path, optional
        A YAML file; the defaults where left out.
    overrides : iterable of str
        ``dotted.key=value`` pairs that win over the file; values are YAML.
    base : mapping, optional
        Settings under the file's.
    chosen : mapping, optional
        Settings over the file's and under the overrides, e.g. a matcher chosen on the command line.
    presets : sequence of str
        Names of presets, in place of those that the file's key ``preset`` names. Presets are over ``base`` and
        under the file's other settings; a later one is over an earlier one.

    Raises
    ------
    ConfigError
        One line: the file, the key, what was expected and what was found; unknown keys with a suggestion.
    """
    told = read_yaml(path) if path is not None else {}
    if presets:
        told["preset"] = list(presets)
    try:
        under = expand(told)
    except ConfigError as error:
        raise error if path is None or presets else blamed(error, path) from error
    data = merge(deepcopy(dict(base or {})), under)
    data = merge(data, deepcopy(dict(chosen or {})))
    for override in overrides:
        apply_override(data, override)
    return validate(Config, data, source=str(path) if path is not None else "")


_Model = TypeVar("_Model", bound=BaseModel)


def validate(model: type[_Model], data: Mapping[str, Any], source: str = "") -> _Model:
    """Validate plain data against a model; ``source`` is the file it was made from.

    See `load_config` for what is raised.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        problem = explain(error, model)
        raise blamed(problem, source) if source else problem from error
    except ConfigError as error:
        raise blamed(error, source) if source else error from error


def apply_override(data: dict[str, Any], override: str) -> None:
    """Put one ``dotted.key=value`` into nested settings, in place.

    A matcher given by its bare name becomes a mapping when one of its parameters is set.

    Raises
    ------
    ConfigError
        If the text is not of that form.
    """
    key, equals, text = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise ConfigError(f"--set takes key=value, e.g. matcher.memory_size=40, found {override!r}")
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"--set {key}: not a YAML value: {text!r}") from error
    node = data
    for part in parts[:-1]:
        inner = node.get(part)
        if isinstance(inner, str):
            inner = {"name": inner}
        elif inner is None:
            inner = {"name": _implied_matcher(part, data)} if part in _MATCHERS and node is data else {}
        elif not isinstance(inner, dict):
            raise ConfigError(f"--set {key}: {part} holds {inner!r}, which has no settings of its own")
        node[part] = inner
        node = inner
    node[parts[-1]] = value


def merge(under: dict[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Nested settings ``over`` laid on ``under``; a new dict.

    The parameters of a matcher stay as long as its name does: another matcher starts from its own defaults.
    """
    out = dict(under)
    for key, value in over.items():
        below = out.get(key)
        if key in _MATCHERS:
            below, value = _by_name(below), _by_name(value)
        if (
            isinstance(below, dict)
            and isinstance(value, dict)
            and value.get("name") in (None, below.get("name"))
        ):
            out[key] = merge(below, value)
        else:
            out[key] = value
    return out


_MATCHERS = ("matcher", "loop_matcher")


def _by_name(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


def _implied_matcher(key: str, data: Mapping[str, Any]) -> str:
    """The matcher that ``key`` stands for where nothing names one: loops are closed by the tracker's."""
    tracker = _by_name(data.get("matcher")) if key == "loop_matcher" else None
    return str((tracker or {}).get("name") or Config().matcher.name)


def dump(config: BaseModel) -> str:
    """The resolved config as YAML, every value in it."""
    return yaml.safe_dump(config.model_dump(mode="json"), sort_keys=False)
