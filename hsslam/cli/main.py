"""Entry point of the ``hsslam`` command."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from hsslam.cli import (
    compare,
    config,
    console,
    convert,
    datasets,
    doctor,
    evaluate,
    init,
    interrupt,
    match,
    matchers,
    plugin,
    report,
    reproduce,
    run,
    sweep,
)
from hsslam.errors import HsslamError
from hsslam.version import __version__


class _Errors(TyperGroup):
    """Whatever the user can mend ends in one line and an exit code; anything else is a bug and keeps its trace."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except HsslamError as error:
            console.complain(f"error: {' '.join(str(error).split())}")
            raise typer.Exit(error.exit_code) from error
        except KeyboardInterrupt as error:
            console.complain("; ".join(["interrupted", *map(str, error.args)]))
            raise typer.Exit(interrupt.EXIT_CODE) from error


# Rich help would cost more than everything else that happens before help is printed.
app: typer.Typer = typer.Typer(
    cls=_Errors,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        console.say(f"hsslam {__version__}")
        raise typer.Exit


@app.callback()
def hsslam(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """2D laser scan matchers competing on equal terms and feeding one pose graph."""


app.command("init")(init.init)
app.command("run")(run.run)
app.command("compare", cls=compare.ManyNames)(compare.compare)
app.command("sweep")(sweep.sweep)
app.command("report")(report.report)
app.command("match")(match.match)
app.command("eval")(evaluate.evaluate)
app.command("convert")(convert.convert)
app.command("reproduce")(reproduce.reproduce)
app.command("doctor")(doctor.doctor)
app.add_typer(matchers.app, name="matchers")
app.add_typer(plugin.app, name="plugin")
app.add_typer(datasets.app, name="datasets")
app.add_typer(config.app, name="config")


def main() -> None:
    """Run the command."""
    interrupt.install()
    app()
