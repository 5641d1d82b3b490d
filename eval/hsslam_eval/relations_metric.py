"""Accuracy of a trajectory against relations between scans.

The metric of Kuemmerle et al., "On measuring the accuracy of SLAM algorithms", Autonomous Robots 27, 2009:
only relative poses are compared, so that an error made once is counted once, wherever the trajectory goes
later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.relations import Relations
from hsslam.se2 import Poses, between_many, compose_many, inverse_many
from hsslam.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class RelationErrors:
    """Error of each relation.

    Parameters
    ----------
    translation : float64 (R,)
        Length of the translation of the error pose (m).
    rotation : float64 (R,)
        Absolute rotation of the error pose (rad), in [0, pi].
    """

    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]

    def summary(self) -> dict[str, float]:
        """Count, mean, standard deviation (of the population), mean square, median and largest error.

        Translations are in metres, rotations in degrees, as the metric is published; the keys say so.
        """
        out: dict[str, float] = {"count": float(len(self.translation))}
        for name, unit, errors in (
            ("translation", "m", self.translation),
            ("rotation", "deg", np.degrees(self.rotation)),
        ):
            out[f"{name}_mean_{unit}"] = float(errors.mean())
            out[f"{name}_std_{unit}"] = float(errors.std())
            out[f"{name}_squared_mean_{unit}2"] = float(np.square(errors).mean())
            out[f"{name}_median_{unit}"] = float(np.median(errors))
            out[f"{name}_max_{unit}"] = float(errors.max())
        return out


def relations_errors(
    trajectory: Trajectory, odometry: Trajectory | None, relations: Relations
) -> RelationErrors:
    """Compare the relative poses of a trajectory with true ones.

    The error of a relation is ``compose(inverse(true), estimated)``: the estimated second pose seen from
    where it should be, the first poses laid on one another.

    Parameters
    ----------
    trajectory : Trajectory
        What is judged; its frame does not matter.
    odometry : Trajectory or None
        Raw odometry of the log's scans; stands in where ``trajectory`` lacks a scan (see `fill_in`). None
        will do for a trajectory that has them all.
    relations : Relations
        The true relative poses.

    Raises
    ------
    DataError
        There are no relations, or a scan that they name is neither in the trajectory nor in the odometry.
    """
    if len(relations) == 0:
        raise DataError("there are no relations to compare the trajectory with")
    first = fill_in(trajectory, odometry, relations.first)
    second = fill_in(trajectory, odometry, relations.second)
    true = np.ascontiguousarray(relations.poses, dtype=np.float64)
    error = compose_many(inverse_many(true), between_many(first, second))
    return RelationErrors(np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2]))


def fill_in(trajectory: Trajectory, odometry: Trajectory | None, scans: NDArray[np.int64]) -> Poses:
    """Poses of a trajectory at given scans, odometry standing in where it has none.

    A scan that the trajectory lacks gets the pose of the last scan before it that has one, carried on by the
    odometry between the two; before the first pose of the trajectory, that one is carried back. The pose that
    follows is not used: a system that skips scans knew no better until it came.

    Parameters
    ----------
    trajectory : Trajectory
        Poses of some or all of the scans.
    odometry : Trajectory or None
        Odometry of the scans; None where the trajectory has every scan asked for.
    scans : int64 (K,)
        Numbers of the scans wanted, from 0, in any order.

    Returns
    -------
    Poses
        (K, 3), in the trajectory's frame.

    Raises
    ------
    DataError
        The trajectory is empty, or odometry lacks a scan that is needed.
    """
    if len(trajectory) == 0:
        raise DataError("the trajectory is empty; expected at least one pose")
    scans = np.asarray(scans, dtype=np.int64)
    anchor = np.maximum(np.searchsorted(trajectory.indices, scans, side="right") - 1, 0)
    start = np.ascontiguousarray(trajectory.poses[anchor], dtype=np.float64)
    missing = trajectory.indices[anchor] != scans
    if not missing.any():
        return start
    if odometry is None:
        raise DataError(
            f"the trajectory has no pose for {np.unique(scans[missing]).size} scans, "
            f"the first of them scan {scans[missing].min()}; give the log's odometry to fill them in"
        )
    moved = between_many(
        _at(odometry, trajectory.indices[anchor[missing]]),
        _at(odometry, scans[missing]),
    )
    out = start.copy()
    out[missing] = compose_many(np.ascontiguousarray(start[missing]), moved)
    return out


def _at(odometry: Trajectory, scans: NDArray[np.int64]) -> Poses:
    place = np.searchsorted(odometry.indices, scans)
    found = place < len(odometry)
    found[found] = odometry.indices[place[found]] == scans[found]
    if not found.all():
        last = f"its last is {odometry.indices[-1]}" if len(odometry) else "it is empty"
        raise DataError(
            f"odometry has no pose for scan {scans[~found][0]} ({last}); "
            "do trajectory, relations and log belong together?"
        )
    return np.ascontiguousarray(odometry.poses[place], dtype=np.float64)
