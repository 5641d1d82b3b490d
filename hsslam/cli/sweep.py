"""``hsslam sweep``: many jobs over many processes or machines, and a table."""

from __future__ import annotations

import shlex
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsslam.cli import console
from hsslam.cli.options import DataDir, Plugin, Quiet
from hsslam.cli.progress import progress
from hsslam.cli.workers import Scheduler, Tell, check

if TYPE_CHECKING:
    from hsslam_eval.sweep_config import SweepConfig


def sweep(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="YAML with matchers, datasets, seeds and grids.")
    ],
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Local worker processes; one for each core if left out."),
    ] = None,
    scheduler: Scheduler = None,
    plugin: Plugin = None,
    data_dir: DataDir = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="For the tables and every job's files; runs/<time>-<file>-sweep if left out."
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run matchers over datasets, seeds and grids of parameters.

    Every combination is a job of its own, on local processes or on a cluster: a row of sweep.csv, sweep.json and the
    tables here, with its reason where it failed. Given the folder of an earlier sweep, does what is missing in it.
    """
    from hsslam.environment import environment
    from hsslam_eval.sweep import sweep as run_sweep
    from hsslam_eval.sweep_table import CSV_FILE, read_tables

    check(scheduler, workers, data_dir)
    config = read(file)
    folder = out if out is not None else Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-{file.stem}-sweep"
    try:
        with progress(quiet) as shown:
            rows = run_sweep(
                config,
                folder,
                workers=workers if workers is not None else int(environment()["cores"]),
                scheduler=scheduler,
                data_dir=data_dir,
                progress=Tell(shown, "sweep"),
                source=str(file),
            )
    except KeyboardInterrupt as error:
        command = shlex.join(["hsslam", *sys.argv[1:]])
        again = command if out is not None else f"{command} --out {shlex.quote(str(folder))}"
        raise KeyboardInterrupt(f"what is done is kept; go on with: {again}") from error
    if quiet:
        return
    for title, headings, cells in read_tables(rows):
        console.say(f"\n{title}")
        console.table(headings, cells)
    failed = sum(row.status != "done" for row in rows)
    console.say(f"\n{len(rows) - failed} of {len(rows)} jobs done, {failed} failed: {folder / CSV_FILE}")


def read(file: Path) -> SweepConfig:
    """Read a sweep's file; raises `ConfigError`."""
    from hsslam.config import validate
    from hsslam.matching import registry
    from hsslam.settings_file import read_yaml
    from hsslam_eval.sweep_config import SweepConfig

    data = read_yaml(file)
    listed = data.get("matchers")
    items = listed if isinstance(listed, list) else []
    registry.quarantine(str(item.get("name") if isinstance(item, dict) else item) for item in items)
    return validate(SweepConfig, data, source=str(file))
