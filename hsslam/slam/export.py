"""What a run folder holds, for other tools: points of the map, and the map under another name."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from hsslam.config import Config, load_config
from hsslam.datasets.catalogue import open_dataset
from hsslam.datasets.dataset import Dataset
from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.tum import read_tum
from hsslam.se2 import Points, transform
from hsslam.slam.folder import JOURNAL
from hsslam.slam.journal import Header


def is_run_folder(path: Path | str) -> bool:
    """Whether a folder holds a finished run."""
    return (Path(path) / "trajectory.tum").is_file() and (Path(path) / JOURNAL).is_file()


def run_file(run: Path, name: str) -> Path:
    """Path of a file of a run.

    Raises
    ------
    DataError
        It is not there.
    """
    path = run / name
    if not path.is_file():
        raise DataError(f"{run}: there is no {name} in it; a run that died is finished with --resume {run}")
    return path


def point_map(run: Path, data_dir: Path | None = None) -> tuple[Points, NDArray[np.int64]]:
    """The returns of every keyframe at its final pose.

    A run folder does not hold the scans; they are read again from the log that was run.

    Parameters
    ----------
    run : path
        The run folder.
    data_dir : path, optional
        Where real datasets lie.

    Returns
    -------
    points : Points
        (N, 2) m in the frame of the map, keyframe after keyframe.
    scans : int64 (N,)
        Number of the scan that each is from.

    Raises
    ------
    DataError
        The run is not finished; its log is no longer there, or another one.
    """
    header, keyframes = _journal(run_file(run, JOURNAL))
    config = load_config(run_file(run, "config.yaml"))
    poses = read_tum(run_file(run, "trajectory.tum")).poses
    wanted = set(keyframes)
    points: list[Points] = []
    scans: list[NDArray[np.int64]] = []
    for scan in _log(run, header, config, data_dir).scans():
        if scan.index in wanted:
            if scan.index >= len(poses):
                break
            returns = transform(poses[scan.index], scan.robot_points)
            points.append(returns)
            scans.append(np.full(len(returns), scan.index, dtype=np.int64))
            wanted.discard(scan.index)
        if not wanted:
            break
    if wanted:
        raise DataError(
            f"{run}: the log {header.dataset['source']} has changed: it has no scan {min(wanted)}, a keyframe then"
        )
    return np.concatenate(points), np.concatenate(scans)


def copy_map(run: Path, stem: Path) -> list[Path]:
    """Copy a run's map to ``<stem>.pgm`` and ``<stem>.yaml``, as map_saver names them; the two paths.

    Raises
    ------
    DataError
        The run is not finished; the files cannot be written.
    """
    picture, description = stem.with_name(f"{stem.name}.pgm"), stem.with_name(f"{stem.name}.yaml")
    copy(run_file(run, "map.pgm"), picture)
    settings = yaml.safe_load(run_file(run, "map.yaml").read_text(encoding="utf-8"))
    with atomic_path(description) as temporary:
        text = yaml.safe_dump({**settings, "image": picture.name}, sort_keys=False, default_flow_style=None)
        temporary.write_text(text, encoding="utf-8")
    return [picture, description]


def copy(source: Path, target: Path) -> None:
    """Copy a file so that its target is there as a whole or not at all."""
    with atomic_path(target) as temporary:
        shutil.copyfile(source, temporary)


def _journal(path: Path) -> tuple[Header, list[int]]:
    """What was run, and the scans that became keyframes."""
    header: Header | None = None
    scans = []
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            values = json.loads(line)
            if header is None:
                header = Header(values["dataset"], values["config"], values["version"])
            elif values["event"] == "keyframe":
                scans.append(int(values["scan"]))
    if header is None:
        raise DataError(f"{path}: the run died before its first line")
    return header, scans


def _log(run: Path, header: Header, config: Config, data_dir: Path | None) -> Dataset:
    told = header.dataset
    try:
        return open_dataset(
            told["source"],
            data_dir=data_dir,
            seed=config.seed,
            scans=told["scans"],
            on_error=told["on_error"],
        )
    except DataError as error:
        raise DataError(
            f"{run}: the points are in the log that was run, and it is not to be found: {error}"
        ) from error
