"""Scans to a CARMEN log."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from hsslam.io.atomic import atomic_path
from hsslam.io.carmen_messages import FLASER_RANGE_MAX, beam_start_and_step
from hsslam.io.compressed import open_for_writing
from hsslam.scan import LaserScan
from hsslam.se2 import Pose

_FLASER_BEAMS = (180, 181, 360, 361)
_NO_RETURN = 81.91
_RESOLUTION = 1e-4
_HEADER = """\
# CARMEN log written by hsslam
# message_name [message contents] ipc_timestamp ipc_hostname logger_timestamp
# PARAM param_name param_value
# ODOM x y theta tv rv accel (velocities are not known and written as 0)
# FLASER num_readings [range_readings] x y theta odom_x odom_y odom_theta
# ROBOTLASER1 laser_type start_angle field_of_view angular_resolution maximum_range accuracy remission_mode \
num_readings [range_readings] num_remissions [remission values] laser_pose_x laser_pose_y laser_pose_theta \
robot_pose_x robot_pose_y robot_pose_theta laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis
"""


class CarmenWriter:
    """Writes scans so that `hsslam.io.carmen.read_carmen` gives them back; a context manager.

    A scan is written as an ``ODOM`` line and a ``FLASER`` line where that message can tell its geometry (180,
    181, 360 or 361 beams from -90 degrees, ``range_max`` of at most 80 m, laser straight ahead at the offset
    of the first scan), else as ``ROBOTLASER1``. Read back, ranges are within 0.1 mm, poses within 1e-6 and
    stamps within 1 us; returns stay returns and other readings stay none: those below ``range_min`` (which
    the format does not hold) are written as 0, NaN and infinity as the maximum. A ``range_max`` from 80 to
    82 m reads back as 80 m.

    Parameters
    ----------
    path : path
        The log; ``.gz`` and ``.bz2`` at its end ask for compression. It appears under its name when the
        block ends without an exception.
    exact : bool
        Write every number with as many digits as give it back to the last bit, for conversions that must not
        change a result. Only the pose of a laser that ``FLASER`` cannot tell is still rounded: the format
        holds its sum with the robot's pose.

    Raises
    ------
    DataError
        On entering: the folder cannot be written to.
    """

    def __init__(self, path: Path | str, *, exact: bool = False) -> None:
        self.path = Path(path)
        self._exact = exact
        self._stack = ExitStack()
        self._stream: BinaryIO | None = None
        self._start = 0.0
        self._offset = 0.0
        self._range_max = FLASER_RANGE_MAX
        self.count = 0

    def __enter__(self) -> CarmenWriter:
        with ExitStack() as stack:
            temporary = stack.enter_context(atomic_path(self.path))
            self._stream = stack.enter_context(open_for_writing(temporary, self.path.name))
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None and not self.count:
            self._put(_HEADER)
        self._stream = None
        self._stack.__exit__(kind, error, trace)

    def write(self, scan: LaserScan) -> None:
        """Append a scan."""
        if not self.count:
            self._begin(scan)
        self.count += 1
        stamp = repr(float(scan.stamp)) if self._exact else f"{scan.stamp:.6f}"
        after = f"{stamp} nohost {scan.stamp - self._start:.6f}\n"
        robot = self._pose_text(scan.odometry)
        laser = self._pose_text(_placed(scan.odometry, scan.laser_pose))
        odom = f"ODOM {robot} 0 0 0 {after}"
        n = len(scan.ranges)
        if self._fits_flaser(scan):
            line = f"FLASER {n} {self._ranges_text(scan, _NO_RETURN)}{laser} {robot} {after}"
        else:
            g = scan.geometry
            view = g.angle_increment * max(n - 1, 0)
            numbers = (g.angle_min, view, g.angle_increment, g.range_max)
            config = "0 {!r} {!r} {!r} {!r} 0.01 0".format(*map(float, numbers))
            ranges = self._ranges_text(scan, g.range_max)
            line = f"ROBOTLASER1 {config} {n} {ranges}0 {laser} {robot} 0 0 0 0 0 {after}"
        self._put(odom + line)

    def write_all(self, scans: Iterable[LaserScan]) -> int:
        """Append scans; how many have been written in all."""
        for scan in scans:
            self.write(scan)
        return self.count

    def _begin(self, scan: LaserScan) -> None:
        self._start = scan.stamp
        self._offset = float(scan.laser_pose[0])
        self._range_max = scan.geometry.range_max
        if not self._fits_flaser(scan):
            self._offset, self._range_max = 0.0, FLASER_RANGE_MAX
        self._put(
            f"{_HEADER}PARAM robot_frontlaser_offset {self._offset!r} nohost 0\n"
            f"PARAM robot_front_laser_max {float(self._range_max)!r} nohost 0\n"
        )

    def _fits_flaser(self, scan: LaserScan) -> bool:
        beams, g = len(scan.ranges), scan.geometry
        if beams not in _FLASER_BEAMS or not 0.0 < g.range_max <= FLASER_RANGE_MAX:
            return False
        start, step = beam_start_and_step(beams)
        tolerance = 0.0 if self._exact else 1e-9
        return (
            abs(g.angle_min - start) <= tolerance
            and abs(g.angle_increment - step) <= tolerance
            and g.range_max == self._range_max
            and bool(np.abs(scan.laser_pose - (self._offset, 0.0, 0.0)).max() <= tolerance)
        )

    def _pose_text(self, pose: Sequence[float] | Pose) -> str:
        x, y, theta = map(float, pose)
        return f"{x!r} {y!r} {theta!r}" if self._exact else f"{x:.9f} {y:.9f} {theta:.9f}"

    def _ranges_text(self, scan: LaserScan, no_return: float) -> str:
        values = _written(scan, no_return, 0.0 if self._exact else _RESOLUTION).tolist()
        return (
            "".join(f"{value!r} " for value in values)
            if self._exact
            else ("%.4f " * len(values)) % tuple(values)
        )

    def _put(self, text: str) -> None:
        if self._stream is None:
            raise ValueError("write to a CarmenWriter inside its with block")
        self._stream.write(text.encode("ascii"))


def _written(scan: LaserScan, no_return: float, resolution: float) -> NDArray[np.float64]:
    """Make the readings such that rounding to ``resolution`` makes no return of none, nor none of a return."""
    g = scan.geometry
    out = np.where(np.isfinite(scan.ranges), scan.ranges, no_return)
    out[(out > 0.0) & (out < g.range_min)] = 0.0
    if resolution > 0.0:
        valid = scan.valid
        out[valid] = np.clip(out[valid], resolution, g.range_max - resolution)
    return out


def _placed(robot: Pose, laser: Pose) -> tuple[float, float, float]:
    c, s = math.cos(robot[2]), math.sin(robot[2])
    x = robot[0] + c * laser[0] - s * laser[1]
    y = robot[1] + s * laser[0] + c * laser[1]
    return float(x), float(y), float(robot[2] + laser[2])
