"""What a comparison found: plain data, written to and read from one JSON file.

Lengths are in metres, angles in degrees, times in seconds unless a name says otherwise. A number that could not
be had (the mean error of no success) is NaN here and ``null`` in the file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator

from hsslam_eval.record_files import read_record, write_record
from hsslam_eval.statistics import Interval

COMPARISON_FILE = "comparison.json"


def _nan_for_none(value: Any) -> Any:
    return math.nan if value is None else value


Number: TypeAlias = Annotated[float, BeforeValidator(_nan_for_none)]
"""A float whose NaN survives JSON."""


@dataclass(frozen=True)
class Measured:
    """An estimate with the ends of its confidence interval."""

    value: Number
    low: Number
    high: Number

    @classmethod
    def of(cls, interval: Interval, scale: float = 1.0) -> Measured:
        """Take an interval over, in another unit where ``scale`` is given."""
        return cls(interval.value * scale, interval.low * scale, interval.high * scale)


@dataclass(frozen=True)
class Spread:
    """Mean and median of a sample, each with its bootstrap interval."""

    mean: Measured
    median: Measured


@dataclass(frozen=True)
class TrialData:
    """Every trial, in the order in which they were drawn; the same order for every matcher.

    Parameters
    ----------
    displacement_m, rotation_deg : list of float
        Error of the found pose; of the guess where there was no answer.
    seconds : list of float
        Time of the match, the reference being prepared; NaN where the matcher raised.
    evaluations : list of int
        Fitness evaluations or iterations.
    score : list of float
        The framework's score of the match.
    failure : list of str
        Why there was no answer; empty where there was one.
    initial_displacement_m, initial_rotation_deg : list of float
        Error of the guess.
    seed : list of int
        Of the job that the trial belongs to.
    """

    displacement_m: list[Number]
    rotation_deg: list[Number]
    seconds: list[Number]
    evaluations: list[int]
    score: list[Number]
    failure: list[str]
    initial_displacement_m: list[Number]
    initial_rotation_deg: list[Number]
    seed: list[int]


@dataclass(frozen=True)
class Successes:
    """The trials that succeeded by one definition of success.

    Parameters
    ----------
    name : str
        Of the definition.
    displacement_limit_m, rotation_limit_deg : float
        Both errors are below these in a success.
    count : int
        Successes.
    ratio : Measured
        Share of the trials, with its Wilson interval.
    displacement_m, rotation_deg : Spread
        Errors over the successful trials.
    """

    name: str
    displacement_limit_m: float
    rotation_limit_deg: float
    count: int
    ratio: Measured
    displacement_m: Spread
    rotation_deg: Spread


@dataclass(frozen=True)
class MatcherTrials:
    """One matcher's trials.

    Parameters
    ----------
    protocol : str
        Where the true poses come from.
    count : int
        Trials.
    unanswered : dict
        Reasons why trials got no answer, and how many each cost.
    initial_displacement_m, initial_rotation_deg : float
        Mean error of the guesses.
    successes : list of Successes
        By each definition of success; the first is the one that plots show.
    displacement_all_m, rotation_all_deg : Spread
        Errors over all trials.
    seconds : Spread
        Time per match.
    evaluations_mean : float
        Evaluations per match.
    data : TrialData
        The trials themselves.
    """

    protocol: str
    count: int
    unanswered: dict[str, int]
    initial_displacement_m: Number
    initial_rotation_deg: Number
    successes: list[Successes]
    displacement_all_m: Spread
    rotation_all_deg: Spread
    seconds: Spread
    evaluations_mean: Number
    data: TrialData


@dataclass(frozen=True)
class Accuracy:
    """How far a trajectory is from whatever truth there is; the keys are those of `hsslam_eval.metrics`.

    Parameters
    ----------
    relations : dict or None
        Summary of the relations metric, where the dataset has relations.
    ate, rpe : dict or None
        Summaries of the absolute and the relative error (per metre driven), where exact truth is known.
    """

    relations: dict[str, Number] | None = None
    ate: dict[str, Number] | None = None
    rpe: dict[str, Number] | None = None


@dataclass(frozen=True)
class Loop:
    """A loop candidate for plotting: between two places of the robot's way, accepted or not."""

    first: tuple[float, float]
    second: tuple[float, float]
    accepted: bool


@dataclass(frozen=True)
class SlamOutcome:
    """One SLAM run, or a trajectory that something else made; what is not known of that is None or NaN.

    Parameters
    ----------
    folder : str
        The run folder, relative to the comparison's; empty where there is none.
    scans : int
        Poses of the trajectory.
    matched, keyframes, loops_tried, loops_accepted : int or None
        Counts; ``matched`` scans owe their pose to a match, the others to odometry.
    wall_seconds, cpu_seconds : float
        From the first scan asked for to the last pose, compiling excluded.
    warm_up_seconds : float
        Loading and compiling before that.
    log_seconds : float
        How long the robot drove.
    peak_memory_mb : float
        Largest resident memory of the process that ran it (10^6 bytes).
    stage_seconds : dict
        Wall time by stage of the pipeline.
    accuracy, odometry_accuracy : Accuracy
        Of the final trajectory, and of raw odometry by the same metrics.
    path, reference_path : list of [x, y]
        The robot's way for plotting, thinned out: estimated, and true or by odometry; in one frame.
    reference_kind : str
        ``truth`` or ``odometry``.
    note : str
        Why the run folder has no map; empty where it has one.
    seed : int or None
        Of the run.
    loops : list of Loop
        Every candidate tried, in the frame of ``path``.
    """

    folder: str
    scans: int
    matched: int | None
    keyframes: int | None
    loops_tried: int | None
    loops_accepted: int | None
    wall_seconds: Number
    cpu_seconds: Number
    warm_up_seconds: Number
    log_seconds: Number
    peak_memory_mb: Number
    stage_seconds: dict[str, Number]
    accuracy: Accuracy
    odometry_accuracy: Accuracy
    path: list[tuple[float, float]]
    reference_path: list[tuple[float, float]]
    reference_kind: str
    note: str = ""
    seed: int | None = None
    loops: list[Loop] = field(default_factory=list)

    @property
    def real_time_factor(self) -> float:
        """Seconds of driving per second of computing."""
        return self.log_seconds / self.wall_seconds if self.wall_seconds > 0.0 else math.nan

    @property
    def matched_share(self) -> float:
        """Share of the scans whose pose came from a match."""
        return self.matched / self.scans if self.scans and self.matched is not None else math.nan


@dataclass(frozen=True)
class Failure:
    """Why a part of a matcher's row is missing.

    Parameters
    ----------
    stage : str
        ``unavailable``, ``trials`` or ``slam``.
    reason : str
        One line.
    remedy : str
        The line to type that mends it, where one is known.
    seed : int or None
        Of the job that failed.
    """

    stage: str
    reason: str
    remedy: str = ""
    seed: int | None = None


@dataclass(frozen=True)
class MatcherOutcome:
    """One row of the comparison.

    Parameters
    ----------
    label : str
        Its name in this comparison; unique.
    name : str
        The matcher's registered name.
    parameters : dict
        Resolved; as given where the matcher is unavailable.
    trials : optional
        Its trials, those of all seeds; None where it was not asked to run any, or all of them failed.
    runs : list of SlamOutcome
        Its SLAM runs, one for each seed that did not fail.
    failures : list of Failure
        What went wrong.
    """

    label: str
    name: str
    parameters: dict[str, Any]
    trials: MatcherTrials | None = None
    runs: list[SlamOutcome] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)

    @property
    def slam(self) -> SlamOutcome | None:
        """The first of its SLAM runs."""
        return self.runs[0] if self.runs else None


@dataclass(frozen=True)
class DatasetRecord:
    """On what the matchers were compared; see `hsslam.datasets.dataset.DatasetInfo`."""

    name: str
    kind: str
    description: str
    attribution: str
    seed: int
    scans: int | None


@dataclass(frozen=True)
class Comparison:
    """Several matchers on one dataset.

    Parameters
    ----------
    dataset : DatasetRecord
        What was driven.
    config : dict
        The resolved `CompareConfig`.
    command : str
        The command line that makes it again; empty where it was made from Python.
    created : str
        When, ISO 8601.
    environment : dict
        `hsslam.environment.environment`.
    matchers : list of MatcherOutcome
        In the order in which they were asked for.
    notes : list of str
        On what terms runs that were there already are compared.
    hands : int
        How many jobs were done at once at most; where more than one, their times are those of a busy machine.
    hosts : list of str
        Names of the machines of workers elsewhere that did jobs; ``environment`` is that of this one.
    """

    dataset: DatasetRecord
    config: dict[str, Any]
    command: str
    created: str
    environment: dict[str, Any]
    matchers: list[MatcherOutcome]
    notes: list[str] = field(default_factory=list)
    hands: int = 1
    hosts: list[str] = field(default_factory=list)

    @property
    def failed(self) -> list[MatcherOutcome]:
        """Matchers with something missing."""
        return [matcher for matcher in self.matchers if matcher.failures]


@dataclass(frozen=True)
class Study:
    """The same comparison on one dataset or several: everything a report is made from.

    Parameters
    ----------
    comparisons : list of Comparison
        One for each dataset.
    """

    comparisons: list[Comparison]

    def save(self, folder: Path) -> Path:
        """Write ``comparison.json``; it appears when it is complete."""
        path = folder / COMPARISON_FILE
        write_record(path, self)
        return path

    @staticmethod
    def load(path: Path | str) -> Study:
        """Read a study from its folder or its file.

        Raises
        ------
        DataError
            There is none, or it was written by something else.
        """
        path = Path(path)
        return read_record(path / COMPARISON_FILE if path.is_dir() else path, Study)
