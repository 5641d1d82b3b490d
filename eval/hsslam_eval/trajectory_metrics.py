"""Absolute and relative error of a trajectory against exact truth (ATE, RPE).

Definitions: Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012. Poses are put
side by side by the number of their scan, never by their stamp: stamps of a log may repeat or step back.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import ConfigError, DataError
from hsslam.se2 import Pose, Poses, between_many, compose_many, inverse_many, pose
from hsslam.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class AteResult:
    """Absolute trajectory error.

    Parameters
    ----------
    translation : float64 (N,)
        Distance of each aligned position from the true one (m).
    rotation : float64 (N,)
        Absolute difference of each aligned heading from the true one (rad).
    scans : int64 (N,)
        The scans that were compared.
    alignment : Pose
        What was applied to the estimate: its frame in the frame of the truth.
    """

    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]
    scans: NDArray[np.int64]
    alignment: Pose

    def summary(self) -> dict[str, float]:
        """Count, and root mean square, mean, median, standard deviation, largest error (m, deg)."""
        return _summary(self.translation, self.rotation)


@dataclass(frozen=True, eq=False)
class RpeResult:
    """Relative pose error.

    Parameters
    ----------
    translation, rotation : float64 (P,)
        Length (m) and absolute angle (rad) of the error pose of each pair.
    first, second : int64 (P,)
        The scans of each pair.
    delta : float
        How far apart the two are.
    unit : str
        ``frames`` or ``metres``.
    """

    translation: NDArray[np.float64]
    rotation: NDArray[np.float64]
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    delta: float
    unit: str

    def summary(self) -> dict[str, float]:
        """Count, and root mean square, mean, median, standard deviation, largest error (m, deg)."""
        return _summary(self.translation, self.rotation)


def ate(estimate: Trajectory, truth: Trajectory, align: bool = True) -> AteResult:
    """Absolute trajectory error over the scans that both have.

    Parameters
    ----------
    estimate, truth : Trajectory
        What is judged, and the exact poses.
    align : bool
        Move the estimate rigidly so that its positions fit the true ones best (least squares; `align_rigid`).
        False compares the poses as they are.

    Raises
    ------
    DataError
        No scan is in both.
    """
    scans, found, true = _associate(estimate, truth)
    alignment = align_rigid(found[:, :2], true[:, :2]) if align else np.zeros(3)
    moved = compose_many(np.tile(alignment, (len(found), 1)), found)
    error = between_many(true, moved)
    return AteResult(np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2]), scans, alignment)


def rpe(
    estimate: Trajectory, truth: Trajectory, delta: float = 1.0, unit: Literal["frames", "metres"] = "frames"
) -> RpeResult:
    """Relative pose error over the scans that both have.

    The pairs follow from the truth: any two estimates of the same scans are judged on the same pairs.

    Parameters
    ----------
    estimate, truth : Trajectory
        What is judged, and the exact poses.
    delta : float
        Distance between the two poses of a pair.
    unit : {"frames", "metres"}
        ``frames``: every pair of poses ``delta`` places apart among those that both trajectories have.
        ``metres``: the true path cut into stretches, each ending at the first pose at least ``delta`` on.

    Raises
    ------
    ConfigError
        ``delta`` is not positive, or not whole where it counts frames.
    DataError
        No scan is in both, or they are too short for a single pair.
    """
    if not delta > 0.0 or (unit == "frames" and delta != int(delta)):
        raise ConfigError(f"delta is a positive {'whole ' if unit == 'frames' else ''}number, found {delta}")
    scans, found, true = _associate(estimate, truth)
    first, second = _by_count(len(scans), int(delta)) if unit == "frames" else _by_path(true, delta)
    if len(first) == 0:
        raise DataError(f"no two of {len(scans)} poses are {delta:g} {unit} apart; choose a smaller delta")
    expected, actual = between_many(true[first], true[second]), between_many(found[first], found[second])
    error = compose_many(inverse_many(expected), actual)
    translation, rotation = np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])
    return RpeResult(translation, rotation, scans[first], scans[second], float(delta), unit)


def align_rigid(source: NDArray[np.float64], target: NDArray[np.float64]) -> Pose:
    """Find the rigid motion that takes points onto others with the least squared distance.

    In the plane the solution of Umeyama ("Least-squares estimation of transformation parameters between two
    point patterns", PAMI 1991) without scale has a closed form: the angle between the summed cross and dot
    products of the centred points, then the shift that brings the centres together.

    Parameters
    ----------
    source, target : float64 (N, 2)
        Corresponding points, N >= 1 (m). Where all source or target points coincide the angle is 0.

    Returns
    -------
    Pose
        Apply it with `hsslam.se2.transform`.
    """
    centre_source, centre_target = source.mean(axis=0), target.mean(axis=0)
    a, b = source - centre_source, target - centre_target
    sine = float(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
    cosine = float(np.sum(a * b))
    theta = float(np.arctan2(sine, cosine))
    c, s = np.cos(theta), np.sin(theta)
    x, y = centre_target - np.array([[c, -s], [s, c]]) @ centre_source
    return pose(float(x), float(y), theta)


def _associate(estimate: Trajectory, truth: Trajectory) -> tuple[NDArray[np.int64], Poses, Poses]:
    scans, i, j = np.intersect1d(estimate.indices, truth.indices, assume_unique=True, return_indices=True)
    if len(scans) == 0:
        raise DataError("the trajectory and the truth have no scan in common")
    return scans, np.ascontiguousarray(estimate.poses[i]), np.ascontiguousarray(truth.poses[j])


def _by_count(poses: int, delta: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    first = np.arange(max(poses - delta, 0), dtype=np.int64)
    return first, first + delta


def _by_path(true: Poses, delta: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    path = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(true[:, :2], axis=0).T))))
    cuts = [0]
    # A hair less than delta, so that steps which sum to it exactly but for rounding do end a stretch.
    while (following := int(np.searchsorted(path, path[cuts[-1]] + delta * (1.0 - 1e-9)))) < len(path):
        cuts.append(following)
    ends = np.array(cuts, dtype=np.int64)
    return ends[:-1], ends[1:]


def _summary(translation: NDArray[np.float64], rotation: NDArray[np.float64]) -> dict[str, float]:
    out: dict[str, float] = {"count": float(len(translation))}
    for name, unit, errors in (("translation", "m", translation), ("rotation", "deg", np.degrees(rotation))):
        out[f"{name}_rmse_{unit}"] = float(np.sqrt(np.square(errors).mean()))
        out[f"{name}_mean_{unit}"] = float(errors.mean())
        out[f"{name}_median_{unit}"] = float(np.median(errors))
        out[f"{name}_std_{unit}"] = float(errors.std())
        out[f"{name}_max_{unit}"] = float(errors.max())
    return out
