"""Options that several verbs share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from hsslam.cli import complete
from hsslam.errors import ConfigError

ConfigFile: TypeAlias = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="YAML settings; other options win over it.")
]
Settings: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="One setting, e.g. matcher.memory_size=40; may be repeated."
    ),
]
MatcherName: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--matcher",
        metavar="NAME",
        help="The matcher; `hsslam matchers` lists them.",
        autocompletion=complete.matchers,
    ),
]
Seed: TypeAlias = Annotated[
    int | None, typer.Option("--seed", min=0, help="Every random choice follows from it; 0 where left out.")
]
Scans: TypeAlias = Annotated[
    int | None, typer.Option("--scans", min=1, help="Use the first N scans only.", metavar="N")
]
DataDir: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--data-dir", metavar="DIR", help="Where real logs are; $HSSLAM_DATA or a user folder if left out."
    ),
]
Quiet: TypeAlias = Annotated[bool, typer.Option("--quiet", "-q", help="Print errors and nothing else.")]
AsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
OnError: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--on-error",
        metavar="stop|skip",
        help="A malformed line of the log stops the run (if left out), or is skipped and counted.",
    ),
]
ScanTopic: TypeAlias = Annotated[
    str | None,
    typer.Option("--scan-topic", metavar="TOPIC", help="Of LaserScan in a ROS bag; guessed if left out."),
]
OdomTopic: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--odom-topic",
        metavar="TOPIC|tf|none",
        help="Of Odometry in a ROS bag; tf: the transform from odom; guessed if left out.",
    ),
]
Presets: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--preset",
        metavar="NAME",
        help="Defaults for a sensor or a place, e.g. rplidar-a2 or corridor; may be repeated.",
        autocompletion=complete.presets,
    ),
]


def _use(context: typer.Context, files: list[Path] | None) -> list[Path] | None:
    if files and not context.resilient_parsing:
        from hsslam import plugin_files

        for file in files:
            plugin_files.use(file)
    return files


Plugin: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin",
        metavar="FILE",
        callback=_use,
        is_eager=True,
        help="A Python file with matchers (or other parts) of your own; may be repeated.",
    ),
]
"""Takes effect by itself, before the other options are looked at."""


def policy(text: str | None) -> Literal["stop", "skip"]:
    """Check what ``--on-error`` was given; raises `ConfigError`."""
    match text:
        case None | "stop":
            return "stop"
        case "skip":
            return "skip"
        case _:
            raise ConfigError(f"--on-error is stop or skip, found {text!r}")
