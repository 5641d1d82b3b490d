"""``hsslam convert``: logs, trajectories and what is in run folders, from one format to another."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hsslam.cli import complete, console
from hsslam.cli.options import DataDir, OdomTopic, OnError, Quiet, Scans, ScanTopic, Seed, policy
from hsslam.cli.progress import Progress, progress
from hsslam.errors import ConfigError, DataError

if TYPE_CHECKING:
    from hsslam.datasets.dataset import Dataset
    from hsslam.scan import LaserScan
    from hsslam.trajectory import Trajectory

_LOGS = ("carmen", "ros1", "ros2", "mcap", "csv", "npz")
_TRAJECTORIES = ("tum", "kitti", "csv")
_OF_RUN = {".g2o": "g2o", ".ply": "ply", ".png": "png", ".pgm": "map", ".yaml": "map"}
_TARGETS = tuple(dict.fromkeys((*_LOGS, *_TRAJECTORIES, *_OF_RUN.values(), "slam-toolbox")))

_NO_POSEGRAPH = (
    "slam_toolbox's own map.posegraph and map.data are not written, their layout is not documented: the folder "
    "serves map_server, AMCL and planning, but slam_toolbox cannot go on mapping from it"
)


def convert(
    source: Annotated[
        str,
        typer.Argument(
            metavar="IN",
            help="A dataset's name, a log, a trajectory (TUM, KITTI, CSV), or a run folder.",
            autocompletion=complete.datasets,
        ),
    ],
    out: Annotated[
        Path,
        typer.Argument(metavar="OUT", help="What to make; its suffix tells the format. Never overwritten."),
    ],
    to: Annotated[
        str | None,
        typer.Option(metavar="FORMAT", help=f"Where the suffix does not tell: {', '.join(_TARGETS)}."),
    ] = None,
    scans: Scans = None,
    stamps: Annotated[
        str | None,
        typer.Option(metavar="NAME|PATH", help="The log of a trajectory whose format has no stamps."),
    ] = None,
    seed: Seed = None,
    data_dir: DataDir = None,
    scan_topic: ScanTopic = None,
    odom_topic: OdomTopic = None,
    on_error: OnError = None,
    quiet: Quiet = False,
) -> None:
    """Convert logs, trajectories and what is in run folders.

    Logs: CARMEN (.clf, .log), ROS bags (.bag, .db3, .mcap, or a folder with --to ros2 or mcap), ranges (.csv, .npz).
    A log to .tum or .kitti gives its odometry. Trajectories: .tum, .kitti, .csv.
    From a run folder: its trajectory, .g2o, .ply (points of the map), .png, .pgm with .yaml, --to slam-toolbox.
    """
    from hsslam.datasets.catalogue import join_source, names, open_dataset
    from hsslam.io.trajectories import detect_trajectory
    from hsslam.slam.export import is_run_folder

    if out.exists():
        raise DataError(f"{out}: is there already and is not overwritten; delete it or choose another name")
    path = Path(source).expanduser()
    if source not in names() and is_run_folder(path):
        made = _from_run(path, out, _target(out, to), data_dir)
    elif source not in names() and detect_trajectory(path) is not None:
        target = _target(out, to)
        made = _write_trajectory(_stamped(path, stamps, seed or 0, data_dir), out, target, str(path))
    else:
        joined = join_source(source, scan_topic=scan_topic, odom_topic=odom_topic)
        log = open_dataset(joined, data_dir=data_dir, seed=seed or 0, scans=scans, on_error=policy(on_error))
        with progress(quiet) as shown:
            made = _from_log(log, out, _target(out, to, of_log=True), shown)
    if not quiet:
        for line in made:
            console.say(line)


def _target(out: Path, to: str | None, *, of_log: bool = False) -> str:
    """The format asked for by the option, else by the suffix, which may mean one thing of a log and another else."""
    from hsslam.io.logs import by_suffix
    from hsslam.io.trajectories import SUFFIXES

    if to is not None:
        if to not in _TARGETS:
            raise ConfigError(f"--to is one of {', '.join(_TARGETS)}, found {to!r}")
        return to
    suffix = out.suffix.lower()
    told = [SUFFIXES.get(suffix), _OF_RUN.get(suffix)]
    if (log := by_suffix(out.name)) is not None:
        told.insert(0 if of_log else len(told), log.name)
    found = next((name for name in told if name), None)
    if found is None or found == "txt":
        raise ConfigError(f"{out}: the name does not tell the format; give --to: {', '.join(_TARGETS)}")
    return found


def _from_log(log: Dataset, out: Path, target: str, shown: Progress) -> list[str]:
    from hsslam.io.logs import write_log

    if target in ("tum", "kitti"):
        shown.stage(f"reading {log.info.name}", log.info.scan_count, "scans")
        return _write_trajectory(_odometry(log, shown), out, target, f"odometry of {log.info.name}")
    if target == "gfs":
        raise ConfigError(
            "a .gfs file is what GMapping leaves of a run; hsslam reads it and does not write it"
        )
    if target not in _LOGS:
        raise ConfigError(
            f"a log is not converted to {target}; run it first: hsslam run, then convert the run folder"
        )
    stamps: list[float] = []
    shown.stage(f"converting {log.info.name}", log.info.scan_count, "scans")

    def told() -> Iterator[LaserScan]:
        for scan in log.scans():
            stamps.append(scan.stamp)
            yield scan
            shown.update(len(stamps))

    count = write_log(out, told(), target)
    return [f"{out}: {count:,} scans", *_truth(log, out, stamps)]


def _truth(log: Dataset, out: Path, stamps: list[float]) -> list[str]:
    """Write what is known of the truth beside a converted log, where hsslam looks for it."""
    import numpy as np

    from hsslam.io.logs import log_stem
    from hsslam.io.relations import write_relations
    from hsslam.io.tum import write_tum

    stem = log_stem(out.name)
    made = []
    truth, relations = log.truth(), log.relations()
    beside = out.with_name(f"{stem}.truth.tum")
    if truth is not None and not beside.exists():
        write_tum(beside, truth)
        made.append(f"{beside}: exact poses")
    beside = out.with_name(f"{stem}.relations")
    if relations is not None and len(relations) and not beside.exists():
        write_relations(beside, relations, np.array(stamps), beside.with_name(f"{beside.name}.index.csv"))
        made.append(f"{beside}: {len(relations):,} relations")
    return made


def _from_run(run: Path, out: Path, target: str, data_dir: Path | None) -> list[str]:
    from hsslam.io.ply import write_ply
    from hsslam.io.trajectories import read_trajectory
    from hsslam.slam import export

    if target in _TRAJECTORIES:
        return _write_trajectory(read_trajectory(run / "trajectory.tum"), out, target, str(run))
    if target in ("g2o", "png"):
        export.copy(export.run_file(run, "graph.g2o" if target == "g2o" else "map.png"), out)
        return [f"{out}: from {run}"]
    if target == "ply":
        points, scans = export.point_map(run, data_dir)
        write_ply(out, points, scans)
        return [f"{out}: {len(points):,} points"]
    if target == "map":
        stem = out.with_suffix("") if out.suffix.lower() in (".pgm", ".yaml") else out
        for suffix in (".pgm", ".yaml"):
            if stem.with_name(stem.name + suffix).exists():
                raise DataError(
                    f"{stem.with_name(stem.name + suffix)}: is there already and is not overwritten"
                )
        return [f"{made}" for made in export.copy_map(run, stem)]
    if target == "slam-toolbox":
        return [*(f"{made}" for made in export.copy_map(run, out / "map")), _NO_POSEGRAPH]
    raise ConfigError(
        f"a run folder holds no log, so it is not converted to {target}; convert the log that was run"
    )


def _stamped(path: Path, stamps: str | None, seed: int, data_dir: Path | None) -> Trajectory:
    import numpy as np

    from hsslam.datasets.catalogue import open_dataset
    from hsslam.io.trajectories import read_trajectory, with_stamps

    trajectory = read_trajectory(path)
    if stamps is None:
        return trajectory
    log = open_dataset(stamps, data_dir=data_dir, seed=seed)
    try:
        return with_stamps(trajectory, np.array([scan.stamp for scan in log.scans()]))
    except DataError as error:
        raise DataError(f"{path}: {error}") from error


def _write_trajectory(trajectory: Trajectory, out: Path, target: str, what: str) -> list[str]:
    from hsslam.io.trajectories import write_trajectory

    if target not in _TRAJECTORIES:
        raise ConfigError(f"{what}: a trajectory is converted to {', '.join(_TRAJECTORIES)}, not to {target}")
    write_trajectory(out, trajectory, target)
    return [f"{out}: {len(trajectory):,} poses"]


def _odometry(log: Dataset, shown: Progress) -> Trajectory:
    import numpy as np

    from hsslam.trajectory import Trajectory

    stamps, poses = [], []
    for scan in log.scans():
        stamps.append(scan.stamp)
        poses.append(scan.odometry)
        shown.update(len(poses))
    return Trajectory(np.array(stamps), np.array(poses), np.arange(len(poses), dtype=np.int64))
