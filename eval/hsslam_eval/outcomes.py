"""From what trials and SLAM return to the plain records of a comparison."""

from __future__ import annotations

import os

import numpy as np

from hsslam.io.relations import Relations
from hsslam.se2 import Pose, Poses, compose, compose_many, inverse
from hsslam.slam.events import SlamResult
from hsslam.trajectory import Trajectory
from hsslam_eval import trial_summary
from hsslam_eval.accuracy import measure
from hsslam_eval.comparison import (
    Accuracy,
    MatcherTrials,
    Measured,
    SlamOutcome,
    Spread,
    Successes,
    TrialData,
)
from hsslam_eval.metrics import ate
from hsslam_eval.statistics import bootstrap_interval
from hsslam_eval.trials import TrialResult

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
        ),
    )


def slam_record(
    result: SlamResult,
    *,
    folder: str,
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
    if truth is not None:
        alignment = ate(estimated, truth).alignment
        reference, path = truth.poses, _moved(estimated.poses, alignment)
    else:
        reference = _moved(result.odometry.poses, _onto(result.odometry.poses[0], estimated.poses[0]))
        path = estimated.poses
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
        path=_thinned(path),
        reference_path=_thinned(reference),
        reference_kind="odometry" if truth is None else "truth",
        note=note,
    )


def cpu_seconds() -> float:
    """Processor time of this process so far, all threads (s)."""
    times = os.times()
    return times.user + times.system


def _onto(a: Pose, b: Pose) -> Pose:
    """The motion of a frame that takes pose ``a`` to pose ``b``."""
    return compose(b, inverse(a))


def _moved(poses: Poses, motion: Pose) -> Poses:
    return compose_many(np.tile(motion, (len(poses), 1)), np.ascontiguousarray(poses))


def _thinned(poses: Poses) -> list[tuple[float, float]]:
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
