"""A study made of what is there already: run folders, and trajectories that other systems made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from hsslam.environment import environment
from hsslam.errors import ConfigError
from hsslam_eval.compare_config import DatasetSpec
from hsslam_eval.comparison import Comparison, MatcherOutcome, Study
from hsslam_eval.placement import read_trajectory
from hsslam_eval.run_outcomes import ExistingRun, Source, Truth, outcome_of


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
    runs = [ExistingRun.read(source, data_dir) for source in sources if not source.is_trajectory]
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
                found = outcome_of(
                    read_trajectory(source.path, truth(of_place[0]).odometry), truth(of_place[0])
                )
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


def _labels(runs: Sequence[ExistingRun]) -> list[str]:
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


def _notes(runs: Sequence[ExistingRun], rows: Mapping[str, MatcherOutcome], others: bool) -> list[str]:
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
            "Times are those in the runs' own folders: hsslam run counts compiling, where there was any, "
            "hsslam compare does not."
        )
    if others:
        told.append(
            "Trajectories given as files are judged by the same metric; scans that they lack are filled in with "
            "odometry. Their times, settings and loops are not known here."
        )
    return told
