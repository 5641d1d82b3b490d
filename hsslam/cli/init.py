"""``hsslam init``: a file of settings to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hsslam.cli import console
from hsslam.cli.options import MatcherName, Presets, Seed, Settings
from hsslam.cli.settings import resolve, split
from hsslam.errors import DataError


def init(
    file: Annotated[Path, typer.Argument(metavar="[FILE]", help="The file to make.")] = Path("hsslam.yaml"),
    preset: Presets = None,
    matcher: MatcherName = None,
    seed: Seed = None,
    settings: Settings = None,
) -> None:
    """Write a file of all settings, each with a comment.

    A file that is there is never overwritten. `hsslam config presets` lists the presets.
    """
    from hsslam.config_template import commented
    from hsslam.io.atomic import atomic_path

    if file.exists():
        raise DataError(f"{file}: is there already and is not overwritten; choose another name")
    config = resolve(matcher=matcher, seed=seed, presets=preset or (), settings=settings or ())
    text = commented(config, split(preset or ()))
    with atomic_path(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    console.say(f"{file}: edit it, then: hsslam run DATASET --config {file}")
