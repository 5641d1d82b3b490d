"""Pairs of scans whose relative pose is known exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.datasets.simulator.floorplan import FloorPlan
from hsslam.datasets.simulator.laser import LaserModel, laser_model
from hsslam.datasets.simulator.path import DriveModel, drive
from hsslam.datasets.simulator.plans import floor_plan
from hsslam.datasets.simulator.raycast import raycast
from hsslam.errors import ConfigError
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Points, Pose, Poses, between, pose

CLEARANCE = 0.3
"""Poses keep this distance from everything solid (m)."""

_LAP = 2000

_STRAIGHT_AHEAD = ScanGeometry(angle_min=0.0, angle_increment=1.0)


@dataclass(frozen=True, eq=False)
class SimulatedPair:
    """Two scans taken near one another.

    Parameters
    ----------
    reference, scan : LaserScan
        The first and the second; their odometry is the true pose in the plan.
    relative : Pose
        True pose of the second seen from the first.
    """

    reference: LaserScan
    scan: LaserScan
    relative: Pose

    @property
    def reference_points(self) -> Points:
        """Returns of the first scan, (N, 2) m."""
        return self.reference.points

    @property
    def scan_points(self) -> Points:
        """Returns of the second scan, (N, 2) m."""
        return self.scan.points


def simulate_pairs(
    plan: str | FloorPlan,
    count: int,
    laser: str | LaserModel,
    rng: np.random.Generator,
    *,
    max_distance: float = 0.6,
    max_angle_deg: float = 40.0,
) -> list[SimulatedPair]:
    """Draw pairs of scans at random places of a world.

    The first pose is a random one along the robot's round, shifted and turned at random; the second lies
    within ``max_distance`` (m, uniform in the disc) and ``max_angle_deg`` (uniform) of it. Both keep
    `CLEARANCE` and nothing solid lies between them. The two scans have independent noise.

    Raises
    ------
    DataError, ConfigError
        No such world; no such laser, or limits below zero.
    """
    if count < 0 or max_distance < 0.0 or max_angle_deg < 0.0:
        raise ConfigError("count, max_distance and max_angle_deg of simulated pairs cannot be negative")
    world = floor_plan(plan) if isinstance(plan, str) else plan
    model = laser_model(laser)
    path = drive(world.route, _LAP, rng, DriveModel())
    firsts, seconds = np.empty((count, 3)), np.empty((count, 3))
    done = 0
    while done < count:
        batch = count - done
        on_path = path[rng.integers(len(path), size=batch)]
        first = _shift(on_path, 0.5, 0.5 * math.pi, rng)
        second = _shift(first, max_distance, math.radians(max_angle_deg), rng)
        good = _free(world, on_path, first) & _free(world, first, second)
        kept = int(good.sum())
        firsts[done : done + kept], seconds[done : done + kept] = first[good], second[good]
        done += kept
    return [
        SimulatedPair(reference, scan, between(reference.odometry, scan.odometry))
        for reference, scan in zip(
            _scans(world, model, firsts, rng), _scans(world, model, seconds, rng), strict=True
        )
    ]


def _shift(poses: Poses, distance: float, angle: float, rng: np.random.Generator) -> Poses:
    radius = distance * np.sqrt(rng.random(len(poses)))
    bearing = rng.uniform(-math.pi, math.pi, len(poses))
    turn = rng.uniform(-angle, angle, len(poses))
    return poses + np.column_stack((radius * np.cos(bearing), radius * np.sin(bearing), turn))


def _free(world: FloorPlan, start: Poses, end: Poses) -> NDArray[np.bool_]:
    """Whether each end keeps clear of everything and is seen from its start, which lies in free space."""
    gap = np.ascontiguousarray(end[:, :2] - start[:, :2])
    looks = start.copy()
    looks[:, 2] = np.arctan2(gap[:, 1], gap[:, 0])
    ahead = raycast(world.segments, looks, _STRAIGHT_AHEAD, 2)[:, 0]
    return np.asarray((world.clearance(end[:, :2]) >= CLEARANCE) & (ahead > np.hypot(gap[:, 0], gap[:, 1])))


def _scans(world: FloorPlan, laser: LaserModel, poses: Poses, rng: np.random.Generator) -> list[LaserScan]:
    readings = laser.measure(raycast(world.segments, poses, laser.geometry, laser.beams), rng)
    return [
        LaserScan(0.0, ranges, laser.geometry, odometry=pose(at[0], at[1], at[2]), index=i)
        for i, (at, ranges) in enumerate(zip(poses, readings, strict=True))
    ]
