"""Accuracy of a trajectory by whatever truth a dataset has."""

from __future__ import annotations

from contextlib import suppress

from hsslam.errors import DataError
from hsslam.io.relations import Relations
from hsslam.trajectory import Trajectory
from hsslam_eval.metrics import ate, relations_errors, rpe

RPE_DELTA = 1.0
"""Travel between the two poses of a relative error (m)."""


def measure(
    trajectory: Trajectory,
    odometry: Trajectory,
    truth: Trajectory | None,
    relations: Relations | None,
) -> dict[str, dict[str, float]]:
    """Errors of a trajectory.

    Parameters
    ----------
    trajectory : Trajectory
        What is judged.
    odometry : Trajectory
        Of every scan that was read; relations beyond them are left out.
    truth : Trajectory or None
        Exact poses, if known.
    relations : Relations or None
        True relative poses, if known.

    Returns
    -------
    dict
        ``relations``, and ``ate`` and ``rpe`` against the truth: the summaries of `hsslam_eval.metrics`; only
        those for which there is something to compare with.
    """
    found: dict[str, dict[str, float]] = {}
    if relations is not None:
        within = _within(relations, len(odometry))
        if len(within):
            found["relations"] = relations_errors(trajectory, odometry, within).summary()
    if truth is not None:
        found["ate"] = ate(trajectory, truth).summary()
        # A drive shorter than the delta has no relative error; that spoils nothing else.
        with suppress(DataError):
            found["rpe"] = rpe(trajectory, truth, RPE_DELTA, "metres").summary()
    return found


def _within(relations: Relations, scans: int) -> Relations:
    keep = (relations.first < scans) & (relations.second < scans)
    return Relations(relations.first[keep], relations.second[keep], relations.poses[keep])
