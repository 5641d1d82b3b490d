"""Settings for a sensor or a place: small YAML files that override what they must, and say why.

A preset changes defaults: whatever a config file or an option says wins over it.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from importlib.resources import files
from typing import Any, Literal

from hsslam.errors import ConfigError

Kind = Literal["sensor", "place"]
_KINDS: tuple[Kind, ...] = ("sensor", "place")


@dataclass(frozen=True)
class Preset:
    """A preset: its name, whether it is of a sensor or a place, its first line, and its whole text."""

    name: str
    kind: Kind
    summary: str
    text: str


def names(kind: Kind | None = None) -> list[str]:
    """Names of all presets, or of one kind, sensors first."""
    folder = files(__name__)
    return [
        entry.name.removesuffix(".yaml")
        for one in _KINDS
        if kind in (None, one)
        for entry in sorted(folder.joinpath(one).iterdir(), key=lambda entry: entry.name)
        if entry.name.endswith(".yaml")
    ]


def load(name: str) -> Preset:
    """Read a preset.

    Raises
    ------
    ConfigError
        No preset has this name.
    """
    for kind in _KINDS:
        if name in names(kind):
            text = files(__name__).joinpath(kind, f"{name}.yaml").read_text(encoding="utf-8")
            return Preset(name, kind, text.splitlines()[0].lstrip("# "), text)
    close = difflib.get_close_matches(name, names(), n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    raise ConfigError(
        f"no preset is named {name!r}{hint} (there are: {', '.join(names())})", ("preset",), name
    )


def settings(name: str) -> dict[str, Any]:
    """What a preset overrides; raises what `load` does."""
    import yaml

    return dict(yaml.safe_load(load(name).text) or {})
