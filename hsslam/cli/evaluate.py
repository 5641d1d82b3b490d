"""``hsslam eval``: an existing trajectory against whatever truth there is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hsslam.cli import accuracy, console
from hsslam.cli.options import AsJson, DataDir, OdomTopic, Quiet, Scans, ScanTopic, Seed
from hsslam.cli.progress import progress
from hsslam.errors import DataError


def evaluate(
    trajectory: Annotated[
        Path, typer.Argument(metavar="TRAJECTORY", help="A TUM file, or CSV with scan,x,y,theta.")
    ],
    dataset: Annotated[str, typer.Option(metavar="NAME|PATH", help="The log it was made from.")],
    relations: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Relations, if they are not beside the log.")
    ] = None,
    seed: Seed = None,
    scans: Scans = None,
    data_dir: DataDir = None,
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Judge a trajectory against the truth or relations.

    Relations error where the log has relations; ATE and RPE where its exact poses are known.
    """
    from hsslam.datasets.catalogue import join_source, open_dataset
    from hsslam.io.relations import read_relations
    from hsslam_eval.accuracy import measure
    from hsslam_eval.placement import odometry_of, read_trajectory

    source = join_source(dataset, scan_topic=scan_topic, odom_topic=odom_topic)
    log = open_dataset(source, data_dir=data_dir, seed=seed or 0, scans=scans)
    with progress(quiet or as_json) as shown:
        shown.stage(f"reading {log.info.name}", log.info.scan_count or scans, "scans")
        odometry = odometry_of(log, shown.update)
    found = read_trajectory(trajectory, odometry)
    known = read_relations(relations, stamps=odometry.stamps) if relations is not None else log.relations()
    errors = measure(found, odometry, log.truth(), known)
    if not errors:
        raise DataError(
            f"{log.info.name}: nothing to judge by: no truth, no relations; give --relations FILE"
        )
    if as_json:
        console.print_json(
            {
                "trajectory": str(trajectory),
                "dataset": log.info.name,
                "attribution": log.info.attribution,
                "poses": len(found),
                "scans": len(odometry),
                **errors,
            }
        )
        return
    console.pairs(
        [
            ("trajectory", f"{trajectory}: {len(found):,} poses for {len(odometry):,} scans"),
            *accuracy.rows(errors),
        ]
    )
    if log.info.attribution:
        console.say(f"\n{log.info.attribution}")
