"""The messages of a CARMEN log, each parsed from its words; `hsslam.io.carmen` tells what they mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.io.no_return import refutes
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Pose, wrap

Words: TypeAlias = Sequence[bytes]
Laser: TypeAlias = Literal["front", "rear"]

FLASER_RANGE_MAX = 80.0
"""Ranges at or over it (m) are no returns of a SICK LMS: its error codes read 81.83 to 81.91 m."""

_SICK_CODES_END = 82.0
_NO_POSE_DIFFERENCE = 2e-6

_STEPS_DEG = {180: 1.0, 181: 1.0, 360: 0.5, 361: 0.5}
_NARROW_STEPS_DEG = {100: 1.0, 101: 1.0, 200: 0.5, 201: 0.5, 400: 0.25, 401: 0.25}
_WIDE_DEG = {
    **dict.fromkeys((540, 541), (-135.0, 0.5)),
    **dict.fromkeys((682, 683), (-120.0, 360.0 / 1024.0)),
    **dict.fromkeys((1080, 1081), (-135.0, 0.25)),
}
"""First beam and step of lasers that see more than half a turn, by their beams: SICK S300 and LMS1xx, Hokuyo URG-04LX
and UTM-30LX."""


class MalformedError(ValueError):
    """What was expected of a line and what was found; the reader adds file and line number."""


@dataclass
class LogState:
    """What earlier lines of a log say about later ones.

    Parameters
    ----------
    laser : {"front", "rear"}
        Which of the two lasers is read.
    range_max : float, optional
        The caller's limit (m), which wins over the log's.
    odometry : Pose
        From the newest ``ODOM`` line.
    parameters : dict
        Numbers from ``PARAM`` lines.
    no_return : float, optional
        What readings say that are no return, as far as the readings tell (m).
    """

    laser: Laser
    range_max: float | None = None
    odometry: Pose = field(default_factory=lambda: np.zeros(3))
    parameters: dict[str, float] = field(default_factory=dict)
    no_return: float | None = None

    def mounted_pose(self) -> Pose:
        """Pose of the laser in the robot's frame, from the ``PARAM`` lines."""
        name = f"robot_{self.laser}laser"
        backwards = -math.pi if self.laser == "rear" else 0.0
        return _pose(
            self.parameters.get(f"{name}_offset", 0.0),
            self.parameters.get(f"{name}_side_offset", 0.0),
            self.parameters.get(f"{name}_angular_offset", backwards),
        )

    def look_at(self, ranges: NDArray[np.float64]) -> None:
        """Readings further than what was taken for no return are returns: then that is one, too."""
        if self.no_return is not None and refutes(ranges, self.no_return):
            self.no_return = None

    def flaser_range_max(self) -> float:
        """Range limit of messages that carry none (m)."""
        if self.range_max is not None:
            return self.range_max
        told = self.parameters.get(f"robot_{self.laser}_laser_max", 0.0)
        if 0.0 < told <= FLASER_RANGE_MAX:
            return told
        return self.no_return if self.no_return is not None else FLASER_RANGE_MAX


def parse_param(words: Words, state: LogState) -> None:
    """``PARAM name value ...``: keep it if its value is a number; a laser's mounting must be one."""
    name = words[1].decode("ascii", "replace") if len(words) > 1 else ""
    mounting = name.startswith(("robot_frontlaser", "robot_rearlaser"))
    if len(words) < 3:
        if mounting:
            raise MalformedError(f"expected PARAM name value, found {_shown(words)}")
        return
    try:
        state.parameters[name] = float(words[2])
    except ValueError:
        if mounting:
            raise MalformedError(f"expected a number for {name}, found {_text(words[2])}") from None


def parse_odom(words: Words, state: LogState) -> None:
    """``ODOM x y theta ...``: keep the pose."""
    if len(words) < 4:
        raise MalformedError(f"expected ODOM x y theta tv rv accel, found {_shown(words)}")
    state.odometry = _pose(*_finite(words, 1, 4, "x y theta"))


def parse_flaser(words: Words, state: LogState, index: int) -> LaserScan:
    """``FLASER`` and ``RLASER``: readings, the laser's pose, the robot's, stamp."""
    n = _count(words, 1, "number of readings")
    # Converters leave out the host and the logger's stamp, or all stamps; no line that lost a reading looks so.
    if len(words) not in (n + 8, n + 9):
        _expect_words(words, n + 11, f"{_text(words[0])} with {n} readings")
    what = "x y theta odom_x odom_y odom_theta ipc_timestamp"
    poses = [*_finite(words, n + 2, min(n + 9, len(words)), what), float(index)]
    ranges = _readings(words, 2, n + 2)
    state.look_at(ranges)
    return LaserScan(
        stamp=poses[6],
        ranges=ranges,
        geometry=_flaser_geometry(n, state.flaser_range_max(), state.parameters.get(_resolution(state))),
        odometry=_pose(poses[3], poses[4], poses[5]),
        laser_pose=state.mounted_pose(),
        index=index,
    )


def parse_remission_flaser(words: Words, state: LogState, index: int) -> LaserScan:
    """``REMISSIONFLASER`` and ``REMISSIONRLASER``: pairs of range and remission, stamp, no pose."""
    n = _count(words, 1, "number of readings")
    _expect_words(words, 2 * n + 5, f"{_text(words[0])} with {n} pairs of range and remission")
    return LaserScan(
        stamp=_finite(words, 2 * n + 2, 2 * n + 3, "ipc_timestamp")[0],
        ranges=_readings(words, 2, 2 * n + 2, 2),
        geometry=_flaser_geometry(n, state.flaser_range_max(), state.parameters.get(_resolution(state))),
        odometry=state.odometry,
        laser_pose=state.mounted_pose(),
        index=index,
    )


def parse_rawlaser(words: Words, state: LogState, index: int) -> LaserScan:
    """``RAWLASER1`` and ``RAWLASER2``: geometry, readings, remissions, stamp, no pose."""
    n, end = _configured_readings(words, after=3)
    return LaserScan(
        stamp=_finite(words, end, end + 1, "ipc_timestamp")[0],
        ranges=_readings(words, 9, 9 + n),
        geometry=_own_geometry(words, state),
        odometry=state.odometry,
        laser_pose=state.mounted_pose(),
        index=index,
    )


def parse_robotlaser(words: Words, state: LogState, index: int) -> LaserScan:
    """``ROBOTLASER1`` and ``ROBOTLASER2``: geometry, readings, remissions, both poses, stamp."""
    n, end = _configured_readings(words, after=14)
    p = _finite(words, end, end + 6, "laser pose and robot pose")
    odometry = _pose(p[3], p[4], p[5])
    return LaserScan(
        stamp=_finite(words, end + 11, end + 12, "ipc_timestamp")[0],
        ranges=_readings(words, 9, 9 + n),
        geometry=_own_geometry(words, state),
        odometry=odometry,
        laser_pose=_seen_from(odometry, p[0], p[1], p[2]),
        index=index,
    )


def beam_start_and_step(beams: int, resolution_deg: float | None = None) -> tuple[float, float]:
    """Angle of the first beam and step (rad) of a message that does not tell them."""
    if beams in _STEPS_DEG:
        return -0.5 * math.pi, math.radians(_STEPS_DEG[beams])
    if beams in _NARROW_STEPS_DEG:
        return math.radians(-50.0), math.radians(_NARROW_STEPS_DEG[beams])
    if resolution_deg is not None and resolution_deg > 0.0:
        step = math.radians(resolution_deg)
        return -0.5 * step * (beams - 1), step
    if beams in _WIDE_DEG:
        first_deg, step_deg = _WIDE_DEG[beams]
        return math.radians(first_deg), math.radians(step_deg)
    return -0.5 * math.pi, math.pi / max(beams - 1, 1)


@lru_cache(maxsize=64)
def _flaser_geometry(beams: int, range_max: float, resolution_deg: float | None) -> ScanGeometry:
    start, step = beam_start_and_step(beams, resolution_deg)
    return ScanGeometry(start, step, range_max=range_max)


def _resolution(state: LogState) -> str:
    return f"laser_{state.laser}_laser_resolution"


def _own_geometry(words: Words, state: LogState) -> ScanGeometry:
    start, _, step = _finite(words, 2, 5, "start_angle field_of_view angular_resolution")
    told = _numbers(words, 5, 6)[0]
    if state.range_max is not None:
        limit = state.range_max
    elif FLASER_RANGE_MAX <= told <= _SICK_CODES_END or not told > 0.0:
        limit = FLASER_RANGE_MAX
    else:
        limit = told
    return _shared_geometry(start, step, limit)


@lru_cache(maxsize=64)
def _shared_geometry(start: float, step: float, range_max: float) -> ScanGeometry:
    return ScanGeometry(start, step, range_max=range_max)


def _configured_readings(words: Words, after: int) -> tuple[int, int]:
    """Return the number of readings, and the place of the first word after the remissions."""
    n = _count(words, 8, "number of readings")
    m = _count(words, 9 + n, "number of remissions")
    what = f"{_text(words[0])} with {n} readings and {m} remissions"
    _expect_words(words, 10 + n + m + after, what)
    return n, 10 + n + m


def _count(words: Words, place: int, what: str) -> int:
    if place >= len(words):
        raise MalformedError(f"the line ends before its {what} (word {place + 1}), after {len(words)} words")
    try:
        n = int(words[place])
    except ValueError:
        n = -1
    if n < 0:
        raise MalformedError(f"expected the {what} as word {place + 1}, found {_text(words[place])}")
    return n


def _expect_words(words: Words, expected: int, what: str) -> None:
    if len(words) != expected:
        raise MalformedError(f"expected {expected} words for {what}, found {len(words)}")


def _numbers(words: Words, start: int, end: int, step: int = 1) -> list[float]:
    try:
        return list(map(float, words[start:end:step]))
    except ValueError:
        for place in range(start, end, step):
            try:
                float(words[place])
            except ValueError:
                text = f"expected a number as word {place + 1}, found {_text(words[place])}"
                raise MalformedError(text) from None
        raise


def _finite(words: Words, start: int, end: int, what: str) -> list[float]:
    numbers = _numbers(words, start, end)
    if not all(map(math.isfinite, numbers)):
        raise MalformedError(f"expected finite numbers for {what}, found {_shown(words[start:end])}")
    return numbers


def _readings(words: Words, start: int, end: int, step: int = 1) -> NDArray[np.float64]:
    return np.array(_numbers(words, start, end, step), dtype=np.float64)


def _pose(x: float, y: float, theta: float) -> Pose:
    inside = -math.pi <= theta < math.pi
    return np.array((x, y, theta if inside else wrap(theta)), dtype=np.float64)


def _seen_from(robot: Pose, x: float, y: float, theta: float) -> Pose:
    c, s = math.cos(robot[2]), math.sin(robot[2])
    dx, dy = x - robot[0], y - robot[1]
    seen = _pose(c * dx + s * dy, c * dy - s * dx, theta - robot[2])
    # Six printed digits make two equal poses differ in the last one; that is no mounting.
    return np.zeros(3) if np.abs(seen).max() < _NO_POSE_DIFFERENCE else seen


def _text(word: bytes) -> str:
    return repr(word[:24].decode("ascii", "replace"))


def _shown(words: Words) -> str:
    return repr(b" ".join(words[:6])[:60].decode("ascii", "replace"))
