"""Scans of a ROS bag: LaserScan messages with the odometry of their moment and the laser's place by tf."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from hsslam.errors import DataError
from hsslam.io.log_statistics import LogStatistics
from hsslam.io.ros_bag import LASER_SCAN, ODOMETRY, Bag, DecodeError, Message, open_bag
from hsslam.io.ros_transforms import Mounting, TransformTree, frame_name, planar
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Pose, interpolate

NO_ODOMETRY = "none"
"""In place of a topic: scans without odometry."""

FROM_TF = "tf"
"""In place of a topic: odometry from the transforms."""

_HISTORY = 20_000_000_000
_FAR = 500_000_000
_DAY = 86_400_000_000_000
_LONGEST_SWEEP = 2.0
_USUAL_BASES = ("base_footprint", "base_link")


@dataclass(frozen=True)
class _Plan:
    """Where scans and odometry come from."""

    scan_topic: str
    odometry: str
    base: str
    odom_frame: str
    mounting: Mounting
    topics: tuple[str, ...]


@dataclass
class _Odometry:
    """Poses by stamp (ns), the newest `_HISTORY` of them: recordings interleave and repeat stamps."""

    stamps: list[int] = field(default_factory=list)
    poses: dict[int, Pose] = field(default_factory=dict)

    def add(self, stamp: int, pose: Pose) -> None:
        if stamp not in self.poses:
            insort(self.stamps, stamp)
        self.poses[stamp] = pose
        while len(self.stamps) > 2 and self.stamps[0] < self.stamps[-1] - _HISTORY:
            del self.poses[self.stamps.pop(0)]

    def knows(self, stamp: int) -> bool:
        """Whether later messages can tell no more about this moment."""
        return bool(self.stamps) and stamp <= self.stamps[-1]

    def at(self, stamp: int) -> tuple[Pose, bool]:
        """Pose at a moment, between its neighbours in time; and whether the nearest is far from it."""
        right = bisect_left(self.stamps, stamp)
        if right < len(self.stamps) and self.stamps[right] == stamp:
            return self.poses[stamp], False
        near = self.stamps[max(right - 1, 0) : right + 1]
        far = min(abs(t - stamp) for t in near) > _FAR
        if len(near) == 1 or right == 0:
            return self.poses[near[0]], far
        before, after = near
        share = (stamp - before) / (after - before)
        return interpolate(self.poses[before], self.poses[after], share), far


def read_bag(
    path: Path | str,
    *,
    scan_topic: str | None = None,
    odom_topic: str | None = None,
    on_error: Literal["stop", "skip"] = "stop",
    statistics: LogStatistics | None = None,
) -> Iterator[LaserScan]:
    """Read the scans of a ROS 1 or ROS 2 bag as a stream, in the order they were received.

    A scan's odometry is that of its stamp: the message of that very stamp, else between the two around it, at
    the ends the nearest. Where the laser sits comes from the transforms, by the frames that the messages name;
    where nothing tells, it sits at the robot's origin, and ``statistics.notes`` says so. A laser that hangs
    upside down has its beams turned round. Stamps are the messages' own; where they are 0, the moment of
    recording. Ranges are 32-bit floats in a bag, and so are angles. A stamp is that of the first beam, as ROS has it.

    Parameters
    ----------
    path : path
        ``.bag``, ``.db3``, ``.mcap``, or the folder of a ROS 2 recording.
    scan_topic : str, optional
        Of LaserScan; guessed where left out.
    odom_topic : str, optional
        Of Odometry; ``tf`` for the transform from the frame ``odom``, ``none`` for no odometry. Guessed where
        left out: a topic of Odometry, else tf.
    on_error : {"stop", "skip"}
        What a message that cannot be decoded does.
    statistics : LogStatistics, optional
        Filled while reading.

    Raises
    ------
    DataError
        rosbags is not installed; a bag that cannot be read; no such topic, or several that could be meant
        (with the list of what is there); no odometry; a laser that does not scan level; no scan.
    """
    path = Path(path)
    told = statistics if statistics is not None else LogStatistics()
    with open_bag(path) as bag:
        plan = _plan(bag, scan_topic, odom_topic, told)
        yield from _scans(bag, plan, on_error, told)


def _scans(bag: Bag, plan: _Plan, on_error: str, told: LogStatistics) -> Iterator[LaserScan]:
    odometry = _Odometry()
    waiting: deque[tuple[int, Any]] = deque()
    count = far = 0

    def ready(last: bool) -> Iterator[LaserScan]:
        nonlocal count, far
        while waiting and (last or plan.odometry == NO_ODOMETRY or odometry.knows(waiting[0][0])):
            stamp, message = waiting.popleft()
            pose, away = (np.zeros(3), False) if plan.odometry == NO_ODOMETRY else odometry.at(stamp)
            far += away
            yield _scan(message, stamp, pose, plan.mounting, count)
            count += 1

    for message in bag.messages(*plan.topics):
        try:
            if isinstance(message, DecodeError):
                raise ValueError(message.reason)
            if message.topic == plan.scan_topic:
                _check(message)
                waiting.append((_stamp(message), message.content))
            elif (found := _odometry(message, plan)) is not None:
                odometry.add(*found)
        except ValueError as error:
            if on_error == "stop":
                raise DataError(
                    f"{bag.path}: {error}; have such messages skipped with on_error skip"
                ) from error
            told.skip(str(error))
        yield from ready(last=False)
    if waiting and plan.odometry != NO_ODOMETRY and not odometry.stamps:
        raise DataError(
            f"{bag.path}: no odometry could be read from {plan.odometry}; it holds: {bag.listing()}"
        )
    yield from ready(last=True)
    if not count:
        raise DataError(f"{bag.path}: no scan could be read from {plan.scan_topic}")
    if far:
        told.notes.append(f"{far:,} scans are over 0.5 s away from any odometry, and took the nearest")


def _plan(bag: Bag, scan_topic: str | None, odom_topic: str | None, told: LogStatistics) -> _Plan:
    scans = bag.choose(LASER_SCAN, scan_topic)
    if scans is None:
        raise DataError(f"{bag.path}: expected a topic of LaserScan, found {bag.listing()}")
    odometry = odom_topic
    if odometry not in (NO_ODOMETRY, FROM_TF):
        odometry = bag.choose(ODOMETRY, odom_topic) or (FROM_TF if bag.transform_topics() else None)
    if odometry is None:
        raise DataError(
            f"{bag.path}: expected odometry, a topic of Odometry or of transforms, found {bag.listing()}; "
            "without any, give --odom-topic none (FILE?odom_topic=none)"
        )
    laser = frame_name(_first(bag, scans).header.frame_id)
    base = ""
    if odometry not in (NO_ODOMETRY, FROM_TF):
        base = frame_name(_first(bag, odometry).child_frame_id)
    tree, base, odom_frame = _transforms(bag, odometry, base, laser)
    mounting = Mounting(np.zeros(3))
    matrix = tree.find(base, laser) if base and laser else None
    place = "laser taken to sit at the robot's origin: no transform says where it is"
    if matrix is not None:
        try:
            mounting = Mounting.of(matrix)
        except ValueError as error:
            raise DataError(f"{bag.path}: {laser} seen from {base}: {error}") from None
        x, y, theta = mounting.pose
        place = f"laser at {x:.3f} m, {y:.3f} m, {np.degrees(theta):.1f} deg of {base}"
        place += ", upside down" if mounting.flipped else ""
    source = f"tf ({odom_frame} to {base})" if odometry == FROM_TF else odometry
    told.notes.append(f"scans from {scans}, odometry from {source}, {place}")
    more = {NO_ODOMETRY: (), FROM_TF: tuple(bag.transform_topics())}.get(odometry, (odometry,))
    return _Plan(scans, odometry, base, odom_frame, mounting, (scans, *more))


def _transforms(bag: Bag, odometry: str, base: str, laser: str) -> tuple[TransformTree, str, str]:
    """Read transforms until they lead from the robot to its laser; also the frames of robot and odometry."""
    tree = TransformTree()
    odom_frame = ""
    for message in bag.messages(*bag.transform_topics()):
        if isinstance(message, DecodeError):
            continue  # the reader proper tells
        try:
            tree.add(message.content)
        except ValueError as error:
            raise DataError(f"{bag.path}: {message.topic}: {error}") from error
        if not base:
            base, odom_frame = _robot(tree, laser)
        if base and laser and tree.find(base, laser) is not None:
            break
    if odometry == NO_ODOMETRY and not base:
        base = next((name for name in _USUAL_BASES if name in tree.ancestors(laser)), "")
    if odometry == FROM_TF and not odom_frame:
        raise DataError(
            f"{bag.path}: expected a transform from a frame 'odom' to the robot that carries {laser!r}, found "
            f"{', '.join(f'{p} to {c}' for c, (p, _) in sorted(tree.parents.items())) or 'no transforms'}; without "
            "odometry, give --odom-topic none (FILE?odom_topic=none)"
        )
    return tree, base, odom_frame


def _robot(tree: TransformTree, laser: str) -> tuple[str, str]:
    """The frame that moves in ``odom`` and carries the laser, and the name of ``odom``; empty if not known."""
    chain = tree.ancestors(laser)
    for child, parent in pairwise(chain):
        if "odom" in parent.rsplit("/", 1)[-1]:
            return child, parent
    return "", ""


def _first(bag: Bag, topic: str) -> Any:
    for message in bag.messages(topic):
        if isinstance(message, Message):
            return message.content
    raise DataError(f"{bag.path}: no message of {topic} can be decoded")


def _odometry(message: Message, plan: _Plan) -> tuple[int, Pose] | None:
    if plan.odometry != FROM_TF:
        pose = message.content.pose.pose
        return _stamp(message), planar(pose.position, pose.orientation)
    for stamped in message.content.transforms:
        frames = frame_name(stamped.header.frame_id), frame_name(stamped.child_frame_id)
        if frames == (plan.odom_frame, plan.base):
            transform = stamped.transform
            return _nanoseconds(stamped.header, message), planar(transform.translation, transform.rotation)
    return None


def _scan(message: Any, stamp: int, odometry: Pose, mounting: Mounting, index: int) -> LaserScan:
    sign = -1.0 if mounting.flipped else 1.0
    geometry = _geometry(
        sign * float(message.angle_min),
        sign * float(message.angle_increment),
        float(message.range_min),
        float(message.range_max),
        _time_increment(message),
    )
    ranges = np.asarray(message.ranges, dtype=np.float64)
    # A whole number of nanoseconds over 1e9 is the double nearest to the stamp.
    return LaserScan(stamp / 1e9, ranges, geometry, odometry, mounting.pose, index)


@lru_cache(maxsize=16)
def _geometry(start: float, step: float, least: float, most: float, seconds: float) -> ScanGeometry:
    # Some drivers leave the limits at 0 or NaN.
    return ScanGeometry(
        start, step, max(least, 0.0) if least == least else 0.0, most if most > 0.0 else np.inf, seconds
    )


def _time_increment(message: Any) -> float:
    """Time from beam to beam (s); 0 where it is none, or such that the beams took longer than the scan."""
    seconds, scan_time = float(message.time_increment), float(message.scan_time)
    if not 0.0 < seconds < _LONGEST_SWEEP / max(len(message.ranges), 1):
        return 0.0
    if scan_time > 0.0 and seconds * len(message.ranges) > 1.1 * scan_time:
        return 0.0
    return seconds


def _check(message: Message) -> None:
    scan = message.content
    if not np.isfinite([scan.angle_min, scan.angle_increment]).all() or (
        len(scan.ranges) > 1 and scan.angle_increment == 0.0
    ):
        raise ValueError(
            f"{message.topic}: expected a scan with angle_min and an angle_increment other than 0, found "
            f"{scan.angle_min:g} and {scan.angle_increment:g}"
        )


def _stamp(message: Message) -> int:
    return _nanoseconds(message.content.header, message)


def _nanoseconds(header: Any, message: Message) -> int:
    stamp = int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)
    # A simulation may begin at 0; a recording of today's with 0 in it was never stamped.
    return message.received if stamp == 0 and message.received > _DAY else stamp
