"""``hsslam reproduce``: the paper's experiments, its figures beside ours."""

from __future__ import annotations

import shlex
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsslam.cli import console
from hsslam.cli.options import DataDir, Quiet, Seed
from hsslam.cli.progress import Progress, progress, watch_compiler
from hsslam.errors import ConfigError

if TYPE_CHECKING:
    from hsslam_eval.reproduce.experiment import Experiment

_ALL = "all"


def reproduce(
    what: Annotated[
        str,
        typer.Argument(
            metavar="EXPERIMENT", help="table1, table2, fig7, fig8, fig9, fig10, maps, benchmarks or all."
        ),
    ],
    dataset: Annotated[
        str | None,
        typer.Option(
            metavar="NAME|PATH",
            help="intel or another log; simulated URG-04LX scans in the office, with exact truth, if left out.",
        ),
    ] = None,
    trials: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Trials of each method; what suits if left out.")
    ] = None,
    seed: Seed = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="As few trials as show that it works; the figures mean little.")
    ] = False,
    data_dir: DataDir = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where to; runs/<time>-reproduce if left out.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Redo the paper's experiments, its figures beside ours.

    A folder for each, with table, figure and result, and a report in HTML and Markdown that says in plain words
    which claims hold.
    """
    from hsslam_eval.reproduce import NAMES, run_experiment
    from hsslam_eval.reproduce.experiment import Request
    from hsslam_eval.reproduce.files import new_folder, write_experiment
    from hsslam_eval.reproduce.page import write_page

    if what not in (*NAMES, _ALL):
        raise ConfigError(f"no experiment is named {what!r}; there are {', '.join(NAMES)} and {_ALL}")
    chosen = NAMES if what == _ALL else (what,)
    request = Request(dataset, data_dir, trials, seed or 0, quick)
    folder = new_folder(
        out if out is not None else Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-reproduce", chosen
    )
    done = []
    with progress(quiet) as shown, watch_compiler(shown):
        for place, name in enumerate(chosen, start=1):
            experiment = run_experiment(name, request, Tell(shown, f"[{place}/{len(chosen)}] {name}"))
            write_experiment(experiment, folder)
            done.append(experiment)
        shown.stage("writing the report")
        page = write_page(done, folder, shlex.join(["hsslam", *sys.argv[1:]]))
    if not quiet:
        for experiment in done:
            report(experiment)
        console.say(f"\nreport: {page}")
        for line in dict.fromkeys(experiment.attribution for experiment in done if experiment.attribution):
            console.say(f"\n{line}")


class Tell:
    """Turns what an experiment tells into stages of progress."""

    def __init__(self, shown: Progress, prefix: str) -> None:
        self._shown = shown
        self._prefix = prefix
        self._at: tuple[str, int] | None = None

    def __call__(self, what: str, done: int, total: int) -> None:
        """Take a step."""
        if (what, total) != self._at:
            self._at = (what, total)
            self._shown.stage(f"{self._prefix}: {what}", total or None)
        self._shown.update(done)


def report(experiment: Experiment) -> None:
    """Print an experiment's tables and verdicts."""
    from hsslam_eval.reproduce.files import interval, ours, paper
    from hsslam_eval.reproduce.judge import tally

    console.say(f"\n{experiment.title}")
    for table in experiment.tables:
        console.say(f"\n{table.title}")
        rows = []
        for row in table.rows:
            cells = [
                " ".join(
                    filter(None, (ours(cell), f"({interval(cell)})" if interval(cell) else "", paper(cell)))
                )
                for cell in row.cells
            ]
            rows.append((row.label, *cells))
        console.table((table.corner, *table.headings), rows)
    console.say("")
    for claim in experiment.claims:
        console.say(
            f"- {'(Our addition.) ' if claim.added else ''}{claim.statement} {claim.verdict.upper()}. {claim.why}"
        )
    console.say(tally(experiment.claims))
