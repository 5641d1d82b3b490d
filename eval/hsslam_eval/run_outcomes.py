"""What is known of a run that is there already: a run folder, or a trajectory that another system made."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hsslam.datasets.dataset import Dataset
from hsslam.errors import DataError
from hsslam.io.tum import read_tum
from hsslam.se2 import Pose, Poses
from hsslam.slam.journal import Header, Replay, read_journal
from hsslam.trajectory import Trajectory
from hsslam_eval.accuracy import measure
from hsslam_eval.compare_config import DatasetSpec
from hsslam_eval.comparison import Accuracy, DatasetRecord, Failure, MatcherOutcome, SlamOutcome
from hsslam_eval.outcomes import loop_between, moved, thinned, ways
from hsslam_eval.placement import odometry_of


@dataclass(frozen=True)
class Source:
    """Something that a report is to show: ``[label=]path``."""

    label: str
    path: Path

    @classmethod
    def parse(cls, text: str) -> Source:
        """Read ``label=path`` or ``path``; raises `DataError` where there is no such file or folder."""
        label, equals, rest = text.partition("=")
        if not equals or Path(text).exists():
            label, rest = "", text
        path = Path(rest)
        if not path.exists():
            raise DataError(f"{path}: no such run folder or trajectory")
        return cls(label, path)

    @property
    def is_trajectory(self) -> bool:
        """Whether it is a file, not a run folder."""
        return self.path.is_file()


@dataclass(frozen=True)
class Truth:
    """A dataset with what trajectories on it are judged by."""

    spec: DatasetSpec
    record: DatasetRecord
    odometry: Trajectory
    judge: Dataset

    @classmethod
    def of(cls, spec: DatasetSpec) -> Truth:
        """Open a dataset and read its odometry; raises what opening and reading it raises."""
        log = spec.open()
        info = log.info
        odometry = odometry_of(log)
        record = DatasetRecord(
            info.name, info.kind, info.description, info.attribution, spec.seed, len(odometry)
        )
        return cls(spec, record, odometry, log)

    def accuracy(self, trajectory: Trajectory) -> Accuracy:
        """Errors of a trajectory."""
        return Accuracy(**measure(trajectory, self.odometry, self.judge.truth(), self.judge.relations()))


@dataclass(frozen=True)
class ExistingRun:
    """A run folder: what was run, and what it came to."""

    source: Source
    header: Header
    replay: Replay
    dataset: DatasetSpec
    environment: dict[str, Any]

    @classmethod
    def read(cls, source: Source, data_dir: Path | None) -> ExistingRun:
        """Read what was run; raises `DataError` where the folder is none of a run."""
        path = source.path
        if not (path / "journal.jsonl").is_file():
            raise DataError(
                f"{path}: is no run folder: there is no journal.jsonl in it; give a folder that `hsslam run` left, "
                "or a trajectory"
            )
        replay = read_journal(path / "journal.jsonl")
        header = replay.header
        assert header is not None  # read_journal refuses a journal without
        spec = DatasetSpec(
            name=header.dataset["source"],
            data_dir=data_dir,
            seed=header.config["seed"],
            scans=header.dataset["scans"],
            on_error=header.dataset["on_error"],
        )
        return cls(source, header, replay, spec, _json(path / "environment.json"))

    @property
    def settings(self) -> str:
        """Everything but the seed."""
        return json.dumps({**self.header.config, "seed": 0}, sort_keys=True)

    @property
    def matcher(self) -> str:
        """Name of the matcher."""
        return str(self.header.config["matcher"]["name"])

    def outcome(self, label: str, truth: Truth, out: Path) -> MatcherOutcome:
        """Its row; ``out`` is where the report will be. Raises `DataError` where a file of it cannot be read."""
        parameters = {key: value for key, value in self.header.config["matcher"].items() if key != "name"}
        path = self.source.path
        seed = self.header.config["seed"]
        if not (path / "metrics.json").is_file():
            died = Failure("slam", f"the run in {path} is not complete", f"hsslam run --resume {path}", seed)
            return MatcherOutcome(label, self.matcher, parameters, None, [], [died])
        metrics, timings = _json(path / "metrics.json"), _json(path / "timings.json")
        found = outcome_of(read_tum(path / "trajectory.tum"), truth)
        places = moved(_vertices(path / "graph.g2o"), _motion(path, truth))
        # A run that was resumed has the time of its last part only; that of drawing the map is no part of SLAM.
        stages = timings.get("stages_s", {})
        wall = math.nan if timings.get("resumed") else timings["wall_s"] - stages.get("output", 0.0)
        run = replace(
            found,
            folder=os.path.relpath(path, out),
            matched=metrics["matched"],
            keyframes=metrics["keyframes"],
            loops_tried=metrics["loops_tried"],
            loops_accepted=metrics["loops_accepted"],
            wall_seconds=wall,
            cpu_seconds=math.nan if timings.get("resumed") else timings["cpu_s"],
            peak_memory_mb=timings["peak_memory_mb"],
            stage_seconds=stages,
            seed=seed,
            loops=[loop_between(places, loop) for loop in self.replay.loops.values()],
        )
        return MatcherOutcome(label, self.matcher, parameters, None, [run])


def outcome_of(trajectory: Trajectory, truth: Truth) -> SlamOutcome:
    """What is known of a trajectory alone."""
    exact = truth.judge.truth()
    path, reference, _ = ways(trajectory, truth.odometry, exact)
    return SlamOutcome(
        folder="",
        scans=len(trajectory),
        matched=None,
        keyframes=None,
        loops_tried=None,
        loops_accepted=None,
        wall_seconds=math.nan,
        cpu_seconds=math.nan,
        warm_up_seconds=math.nan,
        log_seconds=float(np.ptp(truth.odometry.stamps)),
        peak_memory_mb=math.nan,
        stage_seconds={},
        accuracy=truth.accuracy(trajectory),
        odometry_accuracy=truth.accuracy(truth.odometry),
        path=thinned(path),
        reference_path=thinned(reference),
        reference_kind="odometry" if exact is None else "truth",
    )


def _motion(path: Path, truth: Truth) -> Pose:
    return ways(read_tum(path / "trajectory.tum"), truth.odometry, truth.judge.truth())[2]


def _vertices(path: Path) -> Poses:
    """Poses of the keyframes in a graph that `hsslam.io.g2o` wrote."""
    try:
        lines = path.read_text(encoding="ascii").splitlines()
        rows = [
            [float(value) for value in line.split()[2:5]] for line in lines if line.startswith("VERTEX_SE2 ")
        ]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read as the graph of a run: {error}") from error


def _json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read: {error}") from error
    if not isinstance(data, dict):
        raise DataError(f"{path}: expected a JSON object")
    return data
