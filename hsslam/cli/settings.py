"""From options to a config: the command line wins over the file, ``--set`` over the other options."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hsslam.config import Config


def resolve(
    *,
    file: Path | None = None,
    matcher: str | None = None,
    loop_matcher: str | None = None,
    seed: int | None = None,
    presets: Sequence[str] = (),
    settings: Sequence[str] = (),
    base: Mapping[str, Any] | None = None,
) -> Config:
    """Make the config of a run; see `hsslam.config.load_config` for what is raised."""
    from hsslam.config import load_config

    options = {"matcher": matcher, "loop_matcher": loop_matcher, "seed": seed}
    chosen = {key: value for key, value in options.items() if value is not None}
    return load_config(file, settings, base=base, chosen=chosen, presets=split(presets))


def split(names: Sequence[str]) -> list[str]:
    """Names given one by one or with commas between them, as a list without repeats."""
    return list(dict.fromkeys(name for text in names for name in text.split(",") if name))
