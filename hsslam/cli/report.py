"""``hsslam report``: the page of a comparison from runs that are there already."""

from __future__ import annotations

import shlex
import sys
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from hsslam.cli import console
from hsslam.cli.compare import tables
from hsslam.cli.options import DataDir, OnError, Quiet, Scans, Seed, policy
from hsslam.cli.progress import progress
from hsslam.errors import ConfigError


def report(
    runs: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN",
            help="Run folders; trajectories of other systems (.tum, or .csv with scan,x,y,theta), NAME=PATH to name "
            "them; or the folder of one comparison.",
        ),
    ],
    dataset: Annotated[
        str | None,
        typer.Option(metavar="NAME|PATH", help="The log of the trajectories; that of the runs if left out."),
    ] = None,
    seed: Seed = None,
    scans: Scans = None,
    data_dir: DataDir = None,
    on_error: OnError = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="For the report; runs/<time>-report if left out.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Report on existing runs.

    The page that `hsslam compare` makes, from run folders and from trajectories of other systems. Given the folder of a
    comparison, writes its page anew.
    """
    from hsslam_eval.compare_config import DatasetSpec
    from hsslam_eval.comparison import COMPARISON_FILE, Study
    from hsslam_eval.existing_runs import study_of_runs
    from hsslam_eval.report import write_report
    from hsslam_eval.run_outcomes import Source

    comparison = Path(runs[0]) if (Path(runs[0]) / COMPARISON_FILE).is_file() else None
    if comparison is not None and (len(runs) > 1 or out is not None):
        raise ConfigError(
            f"{comparison}: is a comparison: its page goes into its own folder, without other runs; "
            f"to mix, give its run folders ({comparison}/jobs/*-slam-*/run)"
        )
    with progress(quiet) as shown:
        if comparison is not None:
            folder, study = comparison, Study.load(comparison)
        else:
            folder = out if out is not None else Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-report"
            shown.stage("reading the runs")
            study = study_of_runs(
                [Source.parse(text) for text in runs],
                folder,
                dataset=None
                if dataset is None
                else DatasetSpec(
                    name=dataset, data_dir=data_dir, seed=seed or 0, scans=scans, on_error=policy(on_error)
                ),
                data_dir=data_dir,
                command=shlex.join(["hsslam", *sys.argv[1:]]),
            )
            study.save(folder)
        shown.stage("writing the report")
        page = write_report(study, folder)
    if not quiet:
        for found in study.comparisons:
            tables(found)
        console.say(f"\nreport: {page}")
        for attribution in dict.fromkeys(c.dataset.attribution for c in study.comparisons):
            if attribution:
                console.say(f"\n{attribution}")
