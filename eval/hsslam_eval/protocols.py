"""Where trials come from: pairs of scans whose true relative pose is known, five ways.

``simulated``
    Two scans that the simulator took from poses near by, in the floor plan of the dataset: truth is exact.
``relations``
    The two scans of an official relation: verified by hand, about 1 cm.
``static``
    Two scans between which odometry did not move: truth is zero.
``split``
    The even beams of a scan against its odd ones: truth is zero. Unkind to fitness on points, as beams alias.
``consecutive``
    Scans i and i + k of a given trajectory: truth has that trajectory's noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hsslam.datasets.dataset import Dataset
from hsslam.datasets.simulator import SimulatedDataset, simulate_pairs
from hsslam.errors import ConfigError, DataError
from hsslam.io.trajectory_csv import read_trajectory_csv
from hsslam.io.tum import read_tum
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, Poses, between_many, wrap
from hsslam.trajectory import Trajectory
from hsslam_eval.trial_config import Protocol, TrialConfig

_PAIRS_STREAM = 0x7A1
"""Keeps the choice of pairs apart from the guesses, which come from the same seed."""

_REMEDY: dict[Protocol, str] = {
    "simulated": "ask for more",
    "relations": "widen pair_distance, pair_angle_deg",
    "static": "odometry never stands still for long: widen static_distance, static_angle_deg",
    "split": "the log is empty",
    "consecutive": "take a smaller consecutive_step",
}


@dataclass(frozen=True, eq=False)
class TrialPair:
    """Two scans and the truth between them.

    Parameters
    ----------
    reference_points, scan_points : Points
        (N, 2) m, each in the frame of the robot.
    truth : Pose
        Pose of the robot at the scan, seen from the robot at the reference.
    protocol : str
        How the truth is known: one of the five protocols.
    reference_index, scan_index : int
        Numbers of the two scans in their log; -1 where they are in none.
    """

    reference_points: Points
    scan_points: Points
    truth: Pose
    protocol: Protocol
    reference_index: int = -1
    scan_index: int = -1


def make_pairs(dataset: Dataset, config: TrialConfig, truth: Trajectory | None = None) -> list[TrialPair]:
    """Draw the pairs of the trials.

    The same dataset and config give the same pairs. Of a log only the scans that are needed are kept.

    Parameters
    ----------
    dataset : Dataset
        A log or a simulated dataset.
    config : TrialConfig
        ``protocol``, ``count``, ``seed`` and the limits of the protocol.
    truth : Trajectory, optional
        For ``consecutive``; else the file that ``config.trajectory`` names, else the dataset's own.

    Returns
    -------
    list of TrialPair
        At most ``config.count`` pairs; none twice.

    Raises
    ------
    ConfigError
        The dataset has not what the protocol needs.
    DataError
        It has, but no pair is within the limits.
    """
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, _PAIRS_STREAM]))
    if truth is None and config.trajectory is not None:
        truth = _read_trajectory(config.trajectory)
    protocol = config.protocol
    if protocol == "auto":
        protocol = _choose(dataset, config, truth)
    match protocol:
        case "simulated":
            pairs = _simulated(dataset, config, rng)
        case "relations":
            pairs = _relations(dataset, config, rng)
        case "static":
            pairs = _static(dataset, config, rng)
        case "split":
            pairs = _split(dataset, config, rng)
        case "consecutive":
            pairs = _consecutive(dataset, config, truth, rng)
    if not pairs:
        raise DataError(
            f"{dataset.info.name}: no pair of scans for {protocol} trials; "
            f"{_REMEDY[protocol]}, or choose another protocol"
        )
    return pairs


def _choose(dataset: Dataset, config: TrialConfig, truth: Trajectory | None) -> Protocol:
    if dataset.relations() is not None:
        return "relations"
    if isinstance(dataset, SimulatedDataset):
        return "simulated"
    if truth is not None:
        return "consecutive"
    return "static" if _standstills(_odometry(dataset), config) else "split"


def _simulated(dataset: Dataset, config: TrialConfig, rng: np.random.Generator) -> list[TrialPair]:
    if not isinstance(dataset, SimulatedDataset):
        raise ConfigError(f"{dataset.info.name} is not simulated; choose another protocol, e.g. split")
    found = simulate_pairs(
        dataset.plan,
        config.count,
        dataset.laser,
        rng,
        max_distance=config.pair_distance,
        max_angle_deg=config.pair_angle_deg,
    )
    return [TrialPair(pair.reference_points, pair.scan_points, pair.relative, "simulated") for pair in found]


def _relations(dataset: Dataset, config: TrialConfig, rng: np.random.Generator) -> list[TrialPair]:
    relations = dataset.relations()
    if relations is None:
        raise ConfigError(f"{dataset.info.name} has no relations; choose another protocol, e.g. split")
    near = np.flatnonzero(_within(relations.poses, config.pair_distance, config.pair_angle_deg))
    chosen = _draw(near, config.count, rng)
    first, second = relations.first[chosen], relations.second[chosen]
    return _pairs(dataset, first, second, relations.poses[chosen], "relations")


def _static(dataset: Dataset, config: TrialConfig, rng: np.random.Generator) -> list[TrialPair]:
    odometry = _odometry(dataset)
    # Dealt out one a standstill and round again, so that a long one does not crowd out the others.
    hands = [_pairs_of(run, config.count, rng) for run in _standstills(odometry, config)]
    order = rng.permutation(len(hands))
    dealt: list[tuple[int, int]] = []
    for turn in range(max(map(len, hands), default=0)):
        dealt.extend(hands[k][turn] for k in order if turn < len(hands[k]))
        if len(dealt) >= config.count:
            break
    dealt = sorted(dealt[: config.count])
    first, second = (odometry.indices[[pair[side] for pair in dealt]] for side in (0, 1))
    return _pairs(dataset, first, second, np.zeros((len(dealt), 3)), "static")


def _split(dataset: Dataset, config: TrialConfig, rng: np.random.Generator) -> list[TrialPair]:
    every = _odometry(dataset).indices
    scans = _collect(dataset, _draw(every, config.count, rng))
    return [TrialPair(*_halves(scan), np.zeros(3), "split", index, index) for index, scan in scans.items()]


def _consecutive(
    dataset: Dataset, config: TrialConfig, truth: Trajectory | None, rng: np.random.Generator
) -> list[TrialPair]:
    truth = truth if truth is not None else dataset.truth()
    if truth is None:
        raise ConfigError(
            f"{dataset.info.name} has no true trajectory for consecutive trials; "
            "name one (trajectory: FILE.tum or FILE.csv) or choose another protocol"
        )
    place = np.searchsorted(truth.indices, truth.indices + config.consecutive_step)
    known = np.flatnonzero(place < len(truth))
    known = known[truth.indices[place[known]] == truth.indices[known] + config.consecutive_step]
    first = _draw(known, config.count, rng)
    second = place[first]
    relative = between_many(truth.poses[first], truth.poses[second])
    return _pairs(dataset, truth.indices[first], truth.indices[second], relative, "consecutive")


def _pairs(
    dataset: Dataset, first: NDArray[np.int64], second: NDArray[np.int64], truth: Poses, protocol: Protocol
) -> list[TrialPair]:
    scans = _collect(dataset, np.concatenate((first, second)))
    return [
        TrialPair(scans[i].robot_points, scans[j].robot_points, relative, protocol, i, j)
        for i, j, relative in zip(first.tolist(), second.tolist(), truth, strict=True)
    ]


def _collect(dataset: Dataset, wanted: NDArray[np.int64]) -> dict[int, LaserScan]:
    missing = set(wanted.tolist())
    found: dict[int, LaserScan] = {}
    scans = iter(dataset.scans())
    while missing and (scan := next(scans, None)) is not None:
        if scan.index in missing:
            missing.remove(scan.index)
            found[scan.index] = scan
    if missing:
        raise DataError(
            f"{dataset.info.name}: the log has no scan {min(missing)}, which the truth of a trial names; "
            "do they belong together?"
        )
    return found


def _odometry(dataset: Dataset) -> Trajectory:
    stamps, poses, indices = [], [], []
    for scan in dataset.scans():
        stamps.append(scan.stamp)
        poses.append(scan.odometry)
        indices.append(scan.index)
    return Trajectory(np.array(stamps), np.array(poses).reshape(-1, 3), np.array(indices, dtype=np.int64))


def _standstills(odometry: Trajectory, config: TrialConfig) -> list[range]:
    """Places in ``odometry`` of scans taken while it did not move, margins left out, two or more a run."""
    limit = math.radians(config.static_angle_deg)
    runs, start = [], 0
    for place in range(1, len(odometry) + 1):
        if place < len(odometry):
            x, y, theta = odometry.poses[place] - odometry.poses[start]
            if math.hypot(x, y) <= config.static_distance and abs(wrap(theta)) <= limit:
                continue
        run = range(start + config.static_margin, place - config.static_margin)
        if len(run) >= 2:
            runs.append(run)
        start = place
    return runs


def _pairs_of(run: range, count: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Up to ``count`` different pairs i < j of a run, at random: numbers of cells of a triangle, decoded."""
    cells = len(run) * (len(run) - 1) // 2
    cell = rng.choice(cells, size=min(cells, count), replace=False)
    column = ((1.0 + np.sqrt(1.0 + 8.0 * cell)) / 2.0).astype(np.int64)
    row = cell - column * (column - 1) // 2
    return [(run[i], run[j]) for i, j in zip(row.tolist(), column.tolist(), strict=True)]


def _halves(scan: LaserScan) -> tuple[Points, Points]:
    step = scan.geometry.angle_increment
    halves = []
    for offset in (0, 1):
        geometry = replace(
            scan.geometry, angle_min=scan.geometry.angle_min + offset * step, angle_increment=2.0 * step
        )
        halves.append(replace(scan, ranges=scan.ranges[offset::2], geometry=geometry).robot_points)
    return halves[0], halves[1]


def _within(poses: Poses, distance: float, angle_deg: float) -> NDArray[np.bool_]:
    near = np.hypot(poses[:, 0], poses[:, 1]) < distance
    return near & (np.abs(poses[:, 2]) < math.radians(angle_deg))


def _draw(values: NDArray[np.int64], count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Up to ``count`` different ones of sorted ``values``, still sorted."""
    if len(values) <= count:
        return values
    return values[np.sort(rng.choice(len(values), size=count, replace=False))]


def _read_trajectory(path: Path) -> Trajectory:
    match path.suffix.lower():
        case ".tum":
            return read_tum(path)
        case ".csv":
            return read_trajectory_csv(path)
        case suffix:
            raise ConfigError(f"{path}: a trajectory is a .tum or .csv file, found {suffix or 'no suffix'}")
