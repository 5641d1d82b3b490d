"""A study made of what is there already: run folders, and trajectories that other systems made."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from hsslam.datasets.dataset import Dataset
from hsslam.environment import environment
from hsslam.errors import ConfigError, DataError
from hsslam.io.tum import read_tum
from hsslam.se2 import Pose, Poses
from hsslam.slam.journal import Header, Replay, read_journal
from hsslam.trajectory import Trajectory
from hsslam_eval.accuracy import measure
from hsslam_eval.compare_config import DatasetSpec
from hsslam_eval.comparison import (
    Accuracy,
    Comparison,
    DatasetRecord,
    Failure,
    MatcherOutcome,
    SlamOutcome,
    Study,
)
from hsslam_eval.outcomes import loop_between, moved, thinned, ways
from hsslam_eval.placement import odometry_of, read_trajectory


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


def study_of_runs(
    sources: Sequence[Source],
    out: Path,
    *,
    dataset: DatasetSpec | None = None,
    data_dir: Path | None = None,
    command: str = "",
) -> Study:
    """Put existing runs side by side, a part for each dataset; every error is worked out anew.

    Runs of one label on one dataset are the seeds of one row. A label that is not given is the matcher's name, or the
    folder's where runs of that matcher have different settings.

    Parameters
    ----------
    sources : sequence of Source
        Run folders that ``hsslam run`` or ``hsslam compare`` left, and files with trajectories.
    out : path
        Where the report will be: run folders are named from there.
    dataset : DatasetSpec, optional
        The log that the trajectories were made from; where left out, that of the run folders if they share one.
    data_dir : path, optional
        Where real logs are looked for.
    command : str
        The command line, for the report.

    Raises
    ------
    DataError
        A file or folder is not what it should be, or a log cannot be opened.
    ConfigError
        It cannot be told which log a trajectory belongs to.
    """
    runs = [_Run.read(source, data_dir) for source in sources if not source.is_trajectory]
    labels = _labels(runs)
    truths: dict[str, Truth] = {}
    specs: dict[str, list[DatasetSpec]] = {}
    for spec in [*([dataset] if dataset is not None else []), *(run.dataset for run in runs)]:
        specs.setdefault(_place(spec), []).append(spec)
    trajectories = [source for source in sources if source.is_trajectory]
    if trajectories and dataset is None and len(specs) != 1:
        raise ConfigError(
            f"{trajectories[0].path}: which log is this trajectory of? name it with --dataset NAME|PATH"
        )

    def truth(spec: DatasetSpec) -> Truth:
        key = spec.model_dump_json()
        if key not in truths:
            truths[key] = Truth.of(spec)
        return truths[key]

    comparisons = []
    for number, (place, of_place) in enumerate(specs.items()):
        rows: dict[str, MatcherOutcome] = {}
        for run, label in zip(runs, labels, strict=True):
            if _place(run.dataset) == place:
                _add(rows, label, run.outcome(label, truth(run.dataset), out))
        if number == 0:
            for source in trajectories:
                label = source.label or source.path.stem
                found = _other(read_trajectory(source.path, truth(of_place[0]).odometry), truth(of_place[0]))
                _add(rows, label, MatcherOutcome(label, label, {}, None, [found]))
        shown = [run for run in runs if _place(run.dataset) == place]
        comparisons.append(
            Comparison(
                dataset=truth(of_place[0]).record,
                config={"run_trials": False, "run_slam": True},
                command=command,
                created=datetime.now().astimezone().isoformat(timespec="seconds"),
                environment=shown[0].environment if shown else environment(),
                matchers=list(rows.values()),
                notes=_notes(shown, rows, bool(trajectories) and number == 0),
            )
        )
    return Study(comparisons)


@dataclass(frozen=True)
class _Run:
    source: Source
    header: Header
    replay: Replay
    dataset: DatasetSpec
    environment: dict[str, Any]

    @classmethod
    def read(cls, source: Source, data_dir: Path | None) -> _Run:
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
        return str(self.header.config["matcher"]["name"])

    def outcome(self, label: str, truth: Truth, out: Path) -> MatcherOutcome:
        parameters = {key: value for key, value in self.header.config["matcher"].items() if key != "name"}
        path = self.source.path
        seed = self.header.config["seed"]
        if not (path / "metrics.json").is_file():
            died = Failure("slam", f"the run in {path} is not complete", f"hsslam run --resume {path}", seed)
            return MatcherOutcome(label, self.matcher, parameters, None, [], [died])
        metrics, timings = _json(path / "metrics.json"), _json(path / "timings.json")
        found = _other(read_tum(path / "trajectory.tum"), truth)
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


def _labels(runs: Sequence[_Run]) -> list[str]:
    settings: dict[str, set[str]] = {}
    for run in runs:
        settings.setdefault(run.matcher, set()).add(run.settings)
    return [
        run.source.label
        or (run.matcher if len(settings[run.matcher]) == 1 else run.source.path.resolve().name)
        for run in runs
    ]


def _place(spec: DatasetSpec) -> str:
    """What tells datasets apart: not the seed, by which a simulated one is drawn anew."""
    return f"{spec.fingerprint()} {spec.scans}"


def _add(rows: dict[str, MatcherOutcome], label: str, row: MatcherOutcome) -> None:
    before = rows.get(label)
    if before is not None:
        row = replace(before, runs=before.runs + row.runs, failures=before.failures + row.failures)
    rows[label] = row


def _other(trajectory: Trajectory, truth: Truth) -> SlamOutcome:
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


def _notes(runs: Sequence[_Run], rows: Mapping[str, MatcherOutcome], others: bool) -> list[str]:
    """On what terms these runs can be compared, and on which not."""
    shared = [{**run.header.config, "seed": 0, "matcher": None} for run in runs]
    told = []
    if len(runs) > 1:
        different = sorted({key for config in shared for key in config if config[key] != shared[0].get(key)})
        told.append(
            f"These runs differ in more than the matcher: {', '.join(different)}."
            if different
            else "Equal for these runs: the log and every setting but the matcher and the seed, by their journals."
        )
        machines = {(run.environment.get("cpu"), run.environment.get("hsslam")) for run in runs}
        if len(machines) > 1:
            told.append(
                "They were made on different machines or with different versions: times do not compare ("
                + "; ".join(sorted(f"{cpu}, hsslam {version}" for cpu, version in machines))
                + ")."
            )
    seeds = {
        label: sorted({run.seed for run in row.runs if run.seed is not None}) for label, row in rows.items()
    }
    if len({tuple(of) for of in seeds.values() if of}) > 1:
        listed = "; ".join(f"{label}: {', '.join(map(str, of))}" for label, of in seeds.items() if of)
        told.append(
            f"The rows have different seeds ({listed}): of a simulated log, every seed is another one."
        )
    if runs:
        told.append(
            "Times are those in the runs' own folders: `hsslam run` counts compiling, where there was any, "
            "`hsslam compare` does not."
        )
    if others:
        told.append(
            "Trajectories given as files are judged by the same metric; scans that they lack are filled in with "
            "odometry. Their times, settings and loops are not known here."
        )
    return told
