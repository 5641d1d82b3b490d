"""``hsslam eval``: an existing trajectory against whatever truth there is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsslam.cli import accuracy, console
from hsslam.cli.options import AsJson, DataDir, OdomTopic, Quiet, Scans, ScanTopic, Seed
from hsslam.cli.progress import Progress, progress
from hsslam.errors import DataError

if TYPE_CHECKING:
    from hsslam.datasets.dataset import Dataset
    from hsslam.trajectory import Trajectory

_SAME_STAMP = 5e-6
"""Stamps this close are one, written with fewer digits (s)."""


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
    from hsslam.io.trajectory_csv import read_trajectory_csv
    from hsslam.io.tum import read_tum
    from hsslam_eval.accuracy import measure

    read = read_trajectory_csv if trajectory.suffix == ".csv" else read_tum
    found = read(trajectory)
    source = join_source(dataset, scan_topic=scan_topic, odom_topic=odom_topic)
    log = open_dataset(source, data_dir=data_dir, seed=seed or 0, scans=scans)
    with progress(quiet or as_json) as shown:
        shown.stage(f"reading {log.info.name}", log.info.scan_count or scans, "scans")
        odometry = _odometry(log, shown)
    found = found if trajectory.suffix == ".csv" else place(found, odometry, trajectory)
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


def _odometry(log: Dataset, shown: Progress) -> Trajectory:
    import numpy as np

    from hsslam.trajectory import Trajectory

    stamps, poses, indices = [], [], []
    for done, scan in enumerate(log.scans(), start=1):
        stamps.append(scan.stamp)
        poses.append(scan.odometry)
        indices.append(scan.index)
        shown.update(done)
    if not poses:
        raise DataError(f"{log.info.name}: holds no scan")
    return Trajectory(np.array(stamps), np.array(poses), np.array(indices, dtype=np.int64))


def place(trajectory: Trajectory, odometry: Trajectory, source: Path | str) -> Trajectory:
    """Find the scan that each pose of a TUM file belongs to.

    A file with a line per scan is taken in the log's order. A shorter one goes by stamps, each line to the
    next scan with that very stamp: stamps repeat and step back, so the nearest in time may be another scan.

    Raises
    ------
    DataError
        A stamp is not in what is left of the log.
    """
    import numpy as np

    from hsslam.trajectory import Trajectory

    if len(trajectory) == len(odometry):
        return Trajectory(odometry.stamps, trajectory.poses, odometry.indices)
    indices = []
    at = 0
    for number, stamp in enumerate(trajectory.stamps, start=1):
        same = np.flatnonzero(np.abs(odometry.stamps[at:] - stamp) < _SAME_STAMP)
        if len(same) == 0:
            raise DataError(
                f"{source}: pose {number}: no scan of the log after those before it has the stamp {stamp:.6f}; "
                f"expected stamps as recorded, or a pose for each of the {len(odometry):,} scans"
            )
        at += int(same[0]) + 1
        indices.append(int(odometry.indices[at - 1]))
    return Trajectory(trajectory.stamps, trajectory.poses, np.array(indices, dtype=np.int64))
