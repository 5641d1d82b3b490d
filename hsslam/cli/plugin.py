"""``hsslam plugin``: begin a matcher of your own, and see whether it keeps its promises."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsslam.cli import complete, console
from hsslam.cli.options import Plugin, Quiet, Seed
from hsslam.cli.progress import Progress, progress
from hsslam.cli.settings import split
from hsslam.errors import ConfigError

if TYPE_CHECKING:
    from hsslam_eval.conformance import CheckOutcome

app: typer.Typer = typer.Typer(
    help="Begin and check matchers of your own.", rich_markup_mode=None, no_args_is_help=True
)

CHECK_FAILED = 1
"""Exit code where a promise is broken."""


@app.command()
def new(
    name: Annotated[str, typer.Argument(help="The matcher's name, like my_matcher.")],
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="A new folder; NAME if left out.")
    ] = None,
) -> None:
    """Write a package with a matcher that works, and its test.

    Its pyproject.toml has the line that makes the matcher known once it is installed.
    """
    from hsslam.scaffold import new_matcher

    place = folder if folder is not None else Path(name)
    files = new_matcher(name, place)
    for file in files:
        console.say(f"{place / file}")
    console.say("")
    console.pairs(
        [
            ("check it", f"hsslam plugin check {name} --plugin {place / name}.py"),
            ("install it", f"pip install -e '{place}[test]'"),
            ("test it", f"pytest {place}"),
            ("race it", f"hsslam compare office --matchers hide {name}"),
        ]
    )


@app.command()
def check(
    name: Annotated[
        str,
        typer.Argument(
            help="A matcher that is installed, or that --plugin defines.", autocompletion=complete.matchers
        ),
    ],
    plugin: Plugin = None,
    against: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Built-ins to race; those `hsslam compare` takes if left out. May be repeated.",
        ),
    ] = None,
    trials: Annotated[int, typer.Option(min=1, metavar="N", help="Trials of each in the race.")] = 100,
    no_trials: Annotated[bool, typer.Option("--no-trials", help="Only the promises, no race.")] = False,
    exempt: Annotated[
        list[str] | None,
        typer.Option(metavar="CHECK", help="A promise it is known not to keep; may be repeated."),
    ] = None,
    time_limit: Annotated[
        float, typer.Option(min=1.0, metavar="SECONDS", help="A check that takes longer has failed.")
    ] = 120.0,
    seed: Seed = None,
    quiet: Quiet = False,
) -> None:
    """Check a matcher's promises, then race it on the office.

    Exit code 1 where it breaks a promise, or raises, crashes or hangs in the race.
    """
    from hsslam.matching.conformance import conformance_checks
    from hsslam_eval.conformance import conformance

    left_out = split(exempt or ())
    _known(name, left_out, [check_name for check_name, _ in conformance_checks()])
    with progress(quiet) as shown:
        shown.stage(f"checking {name}")
        outcomes = conformance(name, exempt=left_out, time_limit=time_limit, progress=_interruptible)
    broken = [outcome for outcome in outcomes if outcome.fault]
    if not quiet:
        _tell(outcomes, left_out, len(conformance_checks()))
    made = [outcome.name for outcome in outcomes] != ["making it"]
    failed = bool(broken)
    if made and not no_trials:
        with progress(quiet) as shown:
            failed |= not _race(name, split(against or ()), trials, seed or 0, time_limit, shown, quiet)
    if failed:
        raise typer.Exit(CHECK_FAILED)


def _known(name: str, exempt: list[str], checks: list[str]) -> None:
    from hsslam.matching import registry

    if name not in registry.names():
        registry.load(name)  # says what is known, and what was probably meant
    if unknown := sorted(set(exempt) - set(checks)):
        raise ConfigError(f"--exempt {unknown[0]}: no such check (there are: {', '.join(checks)})")


def _interruptible(check_name: str) -> None:
    from hsslam.cli import interrupt

    interrupt.check()


def _tell(outcomes: list[CheckOutcome], exempt: list[str], count: int) -> None:
    console.table(
        ("promise", "kept"),
        [
            *((outcome.name.replace("_", " "), outcome.fault or "yes") for outcome in outcomes),
            *((check_name.replace("_", " "), "exempt") for check_name in exempt),
        ],
    )
    kept = sum(not outcome.fault for outcome in outcomes)
    ended = count - len(exempt) - len(outcomes)
    rest = f"; {ended} were not reached" if ended > 0 else ""
    console.say(f"\n{kept} of {count} promises kept{rest}")


def _race(
    name: str, against: list[str], trials: int, seed: int, time_limit: float, shown: Progress, quiet: bool
) -> bool:
    """Trials on the office, in a folder that goes afterwards; whether the matcher came through."""
    import tempfile
    from dataclasses import replace

    from hsslam.cli.compare import Tell, tables
    from hsslam.config import validate
    from hsslam.matching.interface import LEFT_WINDOW
    from hsslam_eval.compare import CompareConfig, DatasetSpec, compare
    from hsslam_eval.compare_config import DEFAULT_MATCHERS

    rivals = [rival for rival in against or DEFAULT_MATCHERS if rival != name]
    config = validate(
        CompareConfig,
        {
            "matchers": [*rivals, name],
            "seed": seed,
            "run_slam": False,
            "trials": {"count": trials},
            "limits": {"step": time_limit},
        },
    )
    with tempfile.TemporaryDirectory() as folder:
        spec = DatasetSpec(name="office", seed=seed)
        labels = [contestant.label for contestant in config.contestants]
        found = compare(config, spec, folder, Tell(shown, labels))
    mine = next(matcher for matcher in found.matchers if matcher.label == name)
    # A rival that is not installed here tells nothing about the matcher that is checked.
    there = [m for m in found.matchers if m is mine or all(f.stage != "unavailable" for f in m.failures)]
    if not quiet:
        tables(replace(found, matchers=there))
    return mine.trials is not None and set(mine.trials.unanswered) <= {LEFT_WINDOW}
