"""From what trials and SLAM return to the plain records of a comparison."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.io.relations import Relations
from hsslam.se2 import Pose, Poses, compose, compose_many, inverse
from hsslam.slam.events import LoopChecked, SlamResult
from hsslam.trajectory import Trajectory
from hsslam_eval import trial_summary
from hsslam_eval.accuracy import measure
from hsslam_eval.comparison import (
    Accuracy,
    Loop,
    MatcherTrials,
    Measured,
    SlamOutcome,
    Spread,
    Successes,
    TrialData,
)
from hsslam_eval.metrics import ate
from hsslam_eval.statistics import bootstrap_interval
from hsslam_eval.trials import TrialConfig, TrialResult

_PATH_POINTS = 3000


def trials_record(result: TrialResult) -> MatcherTrials:
    """The record of one matcher's trials."""
    summary, config = result.summary(), result.config
    timed = result.seconds[np.isfinite(result.seconds)]
    mean, median = (
        bootstrap_interval(
            timed, statistic, seed=config.seed, confidence=config.confidence, resamples=config.resamples
        )
        for statistic in ("mean", "median")
    )
    return MatcherTrials(
        protocol=summary.protocol,
        count=summary.trials,
        unanswered=summary.failures,
        initial_displacement_m=summary.initial_displacement_m,
        initial_rotation_deg=summary.initial_rotation_deg,
        successes=[_successes(success) for success in summary.success.values()],
        displacement_all_m=_spread(summary.displacement_m),
        rotation_all_deg=_spread(summary.rotation_deg),
        seconds=Spread(Measured.of(mean), Measured.of(median)),
        evaluations_mean=summary.evaluations_mean,
        data=TrialData(
            displacement_m=result.displacement.tolist(),
            rotation_deg=np.degrees(result.rotation).tolist(),
            seconds=result.seconds.tolist(),
            evaluations=result.evaluations.tolist(),
            score=result.score.tolist(),
            failure=list(result.failures),
            initial_displacement_m=result.initial_displacement.tolist(),
            initial_rotation_deg=np.degrees(result.initial_rotation).tolist(),
            seed=[config.seed] * len(result),
        ),
    )


def pooled(records: Sequence[MatcherTrials], config: TrialConfig) -> MatcherTrials:
    """The trials of several seeds as one sample; ``config`` is that of the first."""
    if len(records) == 1:
        return records[0]
    seeds = [seed for record in records for seed in record.data.seed]

    def column(name: str, dtype: type) -> NDArray[Any]:
        return np.concatenate([np.array(getattr(record.data, name), dtype=dtype) for record in records])

    unknown = np.full(len(seeds), np.nan)
    whole = trials_record(
        TrialResult(
            matcher="",
            protocol=records[0].protocol,
            config=config,
            displacement=column("displacement_m", np.float64),
            rotation=np.radians(column("rotation_deg", np.float64)),
            initial_displacement=column("initial_displacement_m", np.float64),
            initial_rotation=np.radians(column("initial_rotation_deg", np.float64)),
            seconds=column("seconds", np.float64),
            prepare_seconds=unknown,
            evaluations=column("evaluations", np.int64),
            score=column("score", np.float64),
            converged=np.zeros(len(seeds), dtype=np.bool_),
            failures=tuple(failure for record in records for failure in record.data.failure),
        )
    )
    return replace(whole, data=replace(whole.data, seed=seeds))


def slam_record(
    result: SlamResult,
    *,
    folder: str,
    seed: int,
    relations: Relations | None,
    truth: Trajectory | None,
    wall_seconds: float,
    cpu_seconds: float,
    warm_up_seconds: float,
    peak_memory_mb: float,
    note: str = "",
) -> SlamOutcome:
    """The record of one SLAM run; see `SlamOutcome` for what is what."""
    estimated = result.trajectory
    stamps = estimated.stamps
    path, reference, motion = ways(estimated, result.odometry, truth)
    places = moved(result.keyframe_poses, motion)
    return SlamOutcome(
        folder=folder,
        scans=len(estimated),
        matched=result.matched,
        keyframes=len(result.keyframes),
        loops_tried=len(result.loops),
        loops_accepted=sum(loop.accepted for loop in result.loops),
        wall_seconds=wall_seconds,
        cpu_seconds=cpu_seconds,
        warm_up_seconds=warm_up_seconds,
        # The span, not last minus first: stamps of a log may step back.
        log_seconds=float(np.ptp(stamps)),
        peak_memory_mb=peak_memory_mb,
        stage_seconds=dict(result.seconds),
        accuracy=Accuracy(**measure(estimated, result.odometry, truth, relations)),
        odometry_accuracy=Accuracy(**measure(result.odometry, result.odometry, truth, relations)),
        path=thinned(path),
        reference_path=thinned(reference),
        reference_kind="odometry" if truth is None else "truth",
        note=note,
        seed=seed,
        loops=[loop_between(places, loop) for loop in result.loops],
    )


def ways(estimated: Trajectory, odometry: Trajectory, truth: Trajectory | None) -> tuple[Poses, Poses, Pose]:
    """The estimated and the reference way in one frame for plotting, and the motion that took the estimate there.

    The reference is the truth with the estimate aligned to it, or else odometry from the estimate's first pose on.
    """
    if truth is not None:
        motion = ate(estimated, truth).alignment
        return moved(estimated.poses, motion), truth.poses, motion
    start = int(np.searchsorted(odometry.indices, estimated.indices[0]))
    reference = moved(odometry.poses, _onto(odometry.poses[start], estimated.poses[0]))
    return estimated.poses, reference, np.zeros(3)


def loop_between(places: Poses, loop: LoopChecked) -> Loop:
    """A loop candidate between two keyframes' places."""
    first, second = thinned(places[[loop.first, loop.second]])
    return Loop(first, second, loop.accepted)


def cpu_seconds() -> float:
    """Processor time of this process so far, all threads (s)."""
    times = os.times()
    return times.user + times.system


def _onto(a: Pose, b: Pose) -> Pose:
    """The motion of a frame that takes pose ``a`` to pose ``b``."""
    return compose(b, inverse(a))


def moved(poses: Poses, motion: Pose) -> Poses:
    """Poses in a frame that was moved."""
    return compose_many(np.tile(motion, (len(poses), 1)), np.ascontiguousarray(poses))


def thinned(poses: Poses) -> list[tuple[float, float]]:
    """Places for plotting, not more than can be told apart."""
    keep = np.unique(np.linspace(0, len(poses) - 1, min(_PATH_POINTS, len(poses))).astype(np.int64))
    return [(round(float(x), 4), round(float(y), 4)) for x, y in poses[keep, :2]]


def _spread(spread: trial_summary.Spread) -> Spread:
    return Spread(Measured.of(spread.mean), Measured.of(spread.median))


def _successes(success: trial_summary.SuccessSummary) -> Successes:
    return Successes(
        name=success.name,
        displacement_limit_m=success.displacement_limit_m,
        rotation_limit_deg=float(np.degrees(success.rotation_limit_rad)),
        count=success.successes,
        ratio=Measured.of(success.ratio),
        displacement_m=_spread(success.displacement_m),
        rotation_deg=_spread(success.rotation_deg),
    )
