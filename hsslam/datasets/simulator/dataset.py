"""Simulated logs: a robot on its round through a floor plan."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hsslam.datasets.dataset import DatasetInfo
from hsslam.datasets.simulator.floorplan import FloorPlan
from hsslam.datasets.simulator.laser import LaserModel, laser_model
from hsslam.datasets.simulator.odometry import OdometryModel
from hsslam.datasets.simulator.path import DriveModel, drive
from hsslam.datasets.simulator.plans import floor_plan
from hsslam.datasets.simulator.raycast import raycast
from hsslam.errors import ConfigError
from hsslam.io.relations import Relations
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Pose, Poses, between_many, compose_many
from hsslam.trajectory import Trajectory

DEFAULT_SCANS = {"office": 750, "corridor": 400, "hall": 480}
"""Scans of a built-in world where no number is asked for."""

_BLOCK = 256


class SimulatedDataset:
    """A log of a simulated robot, with the exact truth.

    Everything follows from the seed: the way the robot sways, its odometry, the noise of every reading.
    Asking for more scans extends the log (the robot goes round again) and leaves the first ones as they are.
    Ranges are made in blocks while `scans` is read, so a log is never held in memory as a whole.

    The truth is in the plan's frame. Odometry starts at the true pose and drifts away from it.

    Parameters
    ----------
    name : str or FloorPlan
        ``office``, ``corridor``, ``hall``, or a plan of your own.
    seed : int
        Every random choice follows from it.
    scans : int, optional
        How many; by default what suits the world.
    laser : str or LaserModel
        A preset's name (``sick-lms200``, ``urg-04lx``, ``rplidar-a2``) or a model.
    odometry : OdometryModel, optional
        How odometry errs.
    laser_pose : Pose, optional
        Pose of the laser in the robot's frame; the robot's own where left out.
    motion : DriveModel, optional
        How the robot moves.

    Raises
    ------
    DataError
        No such world.
    ConfigError
        No such laser, or fewer scans than one.
    """

    def __init__(
        self,
        name: str | FloorPlan,
        *,
        seed: int = 0,
        scans: int | None = None,
        laser: str | LaserModel = "sick-lms200",
        odometry: OdometryModel | None = None,
        laser_pose: Pose | None = None,
        motion: DriveModel | None = None,
    ) -> None:
        self.plan: FloorPlan = floor_plan(name) if isinstance(name, str) else name
        self.seed: int = seed
        self.count: int = DEFAULT_SCANS.get(self.plan.name, 400) if scans is None else scans
        if self.count < 1:
            raise ConfigError(f"a simulated log has at least one scan, found {self.count}")
        self.laser: LaserModel = laser_model(laser)
        self.odometry_model: OdometryModel = odometry or OdometryModel()
        self.laser_pose: Pose = (
            np.zeros(3) if laser_pose is None else np.asarray(laser_pose, dtype=np.float64)
        )
        self.motion: DriveModel = motion or DriveModel()

    @property
    def info(self) -> DatasetInfo:
        """Name, kind and number of scans."""
        return DatasetInfo(self.plan.name, "simulated", self.plan.description, scan_count=self.count)

    @cached_property
    def poses(self) -> Poses:
        """True poses of the robot, (count, 3)."""
        return self._driven[:-1]

    @cached_property
    def _driven(self) -> Poses:
        """`poses`, and where the robot is one scan later."""
        return drive(self.plan.route, self.count + 1, self._rng(0), self.motion)

    @cached_property
    def odometry(self) -> Poses:
        """Odometry of every scan, (count, 3)."""
        return self.odometry_model.measure(self.poses, self._rng(1))

    @cached_property
    def stamps(self) -> NDArray[np.float64]:
        """Time of every scan (s), (count,)."""
        return np.arange(self.count) / self.motion.rate

    def scans(self) -> Iterator[LaserScan]:
        """Simulate the scans in order, as they are asked for; each call starts anew."""
        geometry = self.laser.geometry
        for first in range(0, self.count, _BLOCK):
            last = min(first + _BLOCK, self.count)
            ranges = self._ranges(first, last)
            for i in range(first, last):
                yield LaserScan(
                    stamp=float(self.stamps[i]),
                    ranges=ranges[i - first],
                    geometry=geometry,
                    odometry=self.odometry[i].copy(),
                    laser_pose=self.laser_pose,
                    index=i,
                )

    def truth(self) -> Trajectory:
        """Exact robot poses of every scan."""
        return Trajectory(self.stamps.copy(), self.poses.copy(), np.arange(self.count, dtype=np.int64))

    def relations(self) -> Relations | None:
        """None: the truth says more."""
        return None

    def _ranges(self, first: int, last: int) -> NDArray[np.float64]:
        robot = self.poses[first:last]
        if self.laser.time_increment > 0.0:
            distances = self._swept(first, last)
        else:
            laser = compose_many(robot, np.tile(self.laser_pose, (len(robot), 1)))
            distances = raycast(self.plan.segments, laser, self.laser.geometry, self.laser.beams)
        # Noise of a whole block is drawn, so that a log cut short begins like a longer one.
        padded = np.full((_BLOCK, self.laser.beams), np.inf)
        padded[: len(distances)] = distances
        return self.laser.measure(padded, self._rng(2, first // _BLOCK))[: len(distances)]

    def _swept(self, first: int, last: int) -> NDArray[np.float64]:
        """Distances of scans whose every beam is cast from where the robot is by then."""
        beams, geometry = self.laser.beams, self.laser.geometry
        steps = between_many(self._driven[first:last], self._driven[first + 1 : last + 1])
        shares = self.laser.time_increment * np.arange(beams) * self.motion.rate
        moved = steps[:, None, :] * shares[None, :, None]
        # From scan to scan the robot goes an arc: halfway through a turn it heads for half of it.
        robot = np.repeat(self._driven[first:last], beams, axis=0)
        bent = 0.5 * (moved[..., 2] - steps[:, None, 2])
        c, s = np.cos(bent), np.sin(bent)
        x, y = c * moved[..., 0] - s * moved[..., 1], s * moved[..., 0] + c * moved[..., 1]
        robot = compose_many(robot, np.stack((x, y, moved[..., 2]), axis=-1).reshape(-1, 3))
        laser = compose_many(robot, np.tile(self.laser_pose, (len(robot), 1)))
        laser[:, 2] += np.tile(geometry.angles(beams), last - first)
        ahead = ScanGeometry(0.0, 1.0)
        return raycast(self.plan.segments, laser, ahead, 1).reshape(last - first, beams)

    def _rng(self, *stream: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, *stream])
