"""The folder a run leaves behind; every file in it opens in the usual tools as it is."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from hsslam.config import Config, dump
from hsslam.environment import environment
from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.g2o import write_g2o
from hsslam.io.tum import write_tum
from hsslam.mapping.occupancy import build_grid
from hsslam.mapping.picture import write_map_png
from hsslam.mapping.rosmap import write_rosmap
from hsslam.slam.events import SlamResult
from hsslam.slam.journal import Header, Journal, Replay, read_journal
from hsslam.slam.run_tables import write_covariances, write_loops

JOURNAL = "journal.jsonl"
FILES = (
    "config.yaml",
    "trajectory.tum",
    "odometry.tum",
    "online.tum",
    "graph.g2o",
    "loops.csv",
    "map.pgm",
    "map.yaml",
    "map.png",
    "metrics.json",
    "timings.json",
    "environment.json",
    JOURNAL,
)
"""Everything a finished run leaves; one that died leaves the config, the environment and the journal."""

RECORDING = "live.rrd"
"""What a run leaves besides where its growing map was recorded (`hsslam.live`)."""


class RunFolder:
    """A run's folder; make one with `create`, come back to one with `resume`.

    Parameters
    ----------
    path : path
        The folder.
    replay : Replay, optional
        What the journal in it remembers.
    """

    def __init__(self, path: Path, replay: Replay | None = None) -> None:
        self.path = path
        self.replay = replay

    @classmethod
    def create(
        cls, out: Path | str | None, dataset: str, matcher: str, *, root: Path | str = "runs"
    ) -> RunFolder:
        """Make a folder for a new run.

        Parameters
        ----------
        out : path or None
            Where; None makes ``<root>/<time>-<dataset>-<matcher>``.
        dataset, matcher : str
            Their names.
        root : path
            Where folders are made whose place was not chosen.

        Raises
        ------
        DataError
            ``out`` holds a run already, or cannot be made.
        """
        if out is not None:
            path = Path(out)
            held = [name for name in FILES if (path / name).exists()]
            if held:
                raise DataError(
                    f"{path}: holds a run already ({held[0]}); go on with it (--resume {path}) "
                    "or choose another folder"
                )
            _make(path, exist_ok=True)
            return cls(path)
        stem = f"{datetime.now():%Y%m%d-%H%M%S}-{dataset}-{matcher}"
        for number in count(1):
            path = Path(root) / (stem if number == 1 else f"{stem}-{number}")
            try:
                _make(path, exist_ok=False)
            except FileExistsError:
                continue
            return cls(path)
        raise AssertionError("unreachable: the numbers do not end")

    @classmethod
    def resume(cls, path: Path | str) -> RunFolder:
        """Come back to the folder of a run that died.

        Raises
        ------
        DataError
            There is no journal, or none that can be read.
        """
        path = Path(path)
        if not (path / JOURNAL).is_file():
            raise DataError(f"{path}: holds no run to resume: there is no {JOURNAL} in it")
        return cls(path, read_journal(path / JOURNAL))

    def begin(self, header: Header, config: Config) -> Journal:
        """Write what says what is being run, and open the journal.

        Raises
        ------
        ConfigError
            The folder's run is another one than ``header`` says.
        """
        journal = Journal(self.path / JOURNAL, header, self.replay)
        with atomic_path(self.path / "config.yaml") as temporary:
            temporary.write_text(dump(config), encoding="utf-8")
        self.write_json("environment.json", environment())
        return journal

    def write_result(self, result: SlamResult, config: Config, *, title: str) -> None:
        """Write the trajectories, the graph and the map; each appears when it is complete.

        Parameters
        ----------
        result : SlamResult
            Of the run.
        config : Config
            Its ``map`` section says how the grid is made.
        title : str
            Over the picture of the map.

        Raises
        ------
        OSError
            The disk is full, or the like.
        """
        write_tum(self.path / "trajectory.tum", result.trajectory)
        write_tum(self.path / "odometry.tum", result.odometry)
        write_tum(self.path / "online.tum", result.online)
        write_loops(self.path / "loops.csv", result.loops)
        if result.covariances is not None:
            write_covariances(self.path / "covariances.csv", result)
        write_g2o(
            self.path / "graph.g2o",
            result.keyframe_poses,
            [(edge.first, edge.second, edge.relative, edge.covariance) for edge in result.edges],
        )
        grid = build_grid(
            result.keyframes, result.keyframe_poses, config.map.resolution, config.map.max_range
        )
        write_rosmap(self.path / "map", grid)
        places = result.keyframe_poses
        accepted, contested = (
            [
                (*places[loop.first, :2], *places[loop.second, :2])
                for loop in result.loops
                if (loop.accepted if wanted else loop.contested)
            ]
            for wanted in (True, False)
        )
        write_map_png(self.path / "map.png", grid, result.trajectory, accepted, title, refused=contested)

    def write_json(self, name: str, values: Mapping[str, Any]) -> None:
        """Write a file of JSON into the folder."""
        with atomic_path(self.path / name) as temporary:
            temporary.write_text(json.dumps(values, indent=2) + "\n", encoding="utf-8")


def _make(path: Path, *, exist_ok: bool) -> None:
    try:
        path.mkdir(parents=True, exist_ok=exist_ok)
    except FileExistsError:
        if exist_ok:
            raise DataError(f"{path}: is a file; a run needs a folder") from None
        raise
    except OSError as error:
        raise DataError(f"{path}: the folder cannot be made: {error.strerror}") from error
