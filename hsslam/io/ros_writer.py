"""Scans to a ROS bag, with odometry and transforms, as a robot would have recorded them."""

from __future__ import annotations

import math
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.ros_bag import INSTALL, LASER_SCAN, ODOMETRY, TRANSFORMS
from hsslam.scan import LaserScan
from hsslam.se2 import Pose

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

BagKind: TypeAlias = Literal["ros1", "ros2", "mcap"]

SCAN_TOPIC, ODOM_TOPIC = "/scan", "/odom"
ODOM_FRAME, BASE_FRAME, LASER_FRAME = "odom", "base_link", "laser"

_LAST_SECOND = 2**31


def write_bag(path: Path | str, scans: Iterable[LaserScan], kind: BagKind) -> int:
    """Write scans as a bag: ``/scan``, ``/odom``, ``/tf`` (odom to base_link), ``/tf_static`` (the laser's place).

    Ranges and angles become 32-bit floats, as LaserScan has them. A reading that is no return is written as
    infinity, one below ``range_min`` as 0. Stamps may step back; recording times do not.

    Parameters
    ----------
    path : path
        For ``ros1`` the file. For ``ros2`` and ``mcap`` the folder, or, where the name ends in ``.db3`` or ``.mcap``,
        the file alone, without the ``metadata.yaml`` that goes with it in a folder.
    scans : iterable of LaserScan
        From one laser at one place on the robot.
    kind : {"ros1", "ros2", "mcap"}
        ROS 1; ROS 2 with sqlite3 storage; ROS 2 with MCAP storage.

    Returns
    -------
    int
        Scans written.

    Raises
    ------
    DataError
        rosbags is not installed; the path is there; a stamp that ROS cannot hold; a laser that moves on its
        robot; no scan.
    """
    path = Path(path)
    if path.exists():
        raise DataError(f"{path}: is there already; a bag is not overwritten")
    with _temporary(path) as place:
        writer = _open(place, kind, path)
        with writer.bag:
            count = writer.write_all(scans, path)
        if not count:
            raise DataError(f"{path}: no scan to write")
        made = place
        if kind != "ros1" and path.suffix in (".db3", ".mcap"):
            (made,) = place.glob(f"*{path.suffix}")
        made.replace(path)
    return count


@contextmanager
def _temporary(path: Path) -> Iterator[Path]:
    """A path beside the target that is not there yet; gone afterwards."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(dir=path.parent, prefix=".part-"))
    except OSError as error:
        raise DataError(f"{path}: cannot be written: {error.strerror or error}") from error
    try:
        yield folder / path.name.removesuffix(".db3").removesuffix(".mcap")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _open(place: Path, kind: BagKind, path: Path) -> _Writer:
    try:
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise DataError(f"{path}: writing ROS bags needs the library rosbags: {INSTALL} ({error})") from error
    if kind == "ros1":
        store = get_typestore(Stores.ROS1_NOETIC)
        # The library's ROS 1 types are those of common_msgs, which tf2 is not among.
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
        return _Writer(Writer1(place), store, True)
    storage = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    # Version 8 is read by every ROS 2 from Humble on.
    return _Writer(
        Writer2(place, version=8, storage_plugin=storage), get_typestore(Stores.ROS2_HUMBLE), False
    )


@dataclass
class _Writer:
    bag: Any
    store: Typestore
    ros1: bool
    received: int = 0

    def write_all(self, scans: Iterable[LaserScan], path: Path) -> int:
        tf_static = self._static_topic()
        odom, tf = self._topic(ODOM_TOPIC, ODOMETRY), self._topic("/tf", TRANSFORMS)
        topic = self._topic(SCAN_TOPIC, LASER_SCAN)
        place: Pose | None = None
        count = 0
        for scan in scans:
            sec, nanosec = _split(scan, path)
            stamp = sec * 1_000_000_000 + nanosec
            if place is None:
                place = scan.laser_pose
                mounted = self._transform(self._header(sec, nanosec, BASE_FRAME), LASER_FRAME, place)
                self._write(tf_static, TRANSFORMS, stamp, self._new(TRANSFORMS, [mounted]))
            elif not np.array_equal(scan.laser_pose, place):
                raise DataError(
                    f"{path}: scan {scan.index}: the laser sits elsewhere than in the first scan; a bag has one place"
                )
            header = self._header(sec, nanosec, ODOM_FRAME)
            moved = self._transform(header, BASE_FRAME, scan.odometry)
            self._write(odom, ODOMETRY, stamp, self._odometry(header, scan.odometry))
            self._write(tf, TRANSFORMS, stamp, self._new(TRANSFORMS, [moved]))
            self._write(topic, LASER_SCAN, stamp, self._scan(self._header(sec, nanosec, LASER_FRAME), scan))
            count += 1
        return count

    def _topic(self, name: str, kind: str, **more: Any) -> Any:
        return self.bag.add_connection(name, kind, typestore=self.store, **more)

    def _static_topic(self) -> Any:
        """The topic whose one message late listeners must get too."""
        if self.ros1:
            return self._topic("/tf_static", TRANSFORMS, latching=1)
        from rosbags.interfaces import (
            Qos,
            QosDurability,
            QosHistory,
            QosLiveliness,
            QosReliability,
            QosTime,
        )

        never = QosTime(0x7FFFFFFF, 0xFFFFFFFF)
        latched = Qos(
            QosHistory.KEEP_LAST,
            1,
            QosReliability.RELIABLE,
            QosDurability.TRANSIENT_LOCAL,
            never,
            never,
            QosLiveliness.AUTOMATIC,
            never,
            False,
        )
        return self._topic("/tf_static", TRANSFORMS, offered_qos_profiles=[latched])

    def _write(self, topic: Any, kind: str, stamp: int, message: Any) -> None:
        self.received = max(self.received + 1, stamp)
        serialise = self.store.serialize_ros1 if self.ros1 else self.store.serialize_cdr
        self.bag.write(topic, self.received, serialise(message, kind))

    def _new(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def _header(self, sec: int, nanosec: int, frame: str) -> Any:
        stamp = self._new("builtin_interfaces/msg/Time", sec, nanosec)
        sequence = (0,) if self.ros1 else ()
        return self._new("std_msgs/msg/Header", *sequence, stamp, frame)

    def _quaternion(self, theta: float) -> Any:
        return self._new(
            "geometry_msgs/msg/Quaternion", 0.0, 0.0, math.sin(theta / 2.0), math.cos(theta / 2.0)
        )

    def _transform(self, header: Any, child: str, pose: Pose) -> Any:
        x, y, theta = map(float, pose)
        shift = self._new("geometry_msgs/msg/Vector3", x, y, 0.0)
        transform = self._new("geometry_msgs/msg/Transform", shift, self._quaternion(theta))
        return self._new("geometry_msgs/msg/TransformStamped", header, child, transform)

    def _odometry(self, header: Any, pose: Pose) -> Any:
        x, y, theta = map(float, pose)
        unknown = np.zeros(36)
        point = self._new("geometry_msgs/msg/Point", x, y, 0.0)
        placed = self._new("geometry_msgs/msg/Pose", point, self._quaternion(theta))
        still = self._new("geometry_msgs/msg/Vector3", 0.0, 0.0, 0.0)
        twist = self._new("geometry_msgs/msg/Twist", still, still)
        return self._new(
            ODOMETRY,
            header,
            BASE_FRAME,
            self._new("geometry_msgs/msg/PoseWithCovariance", placed, unknown),
            self._new("geometry_msgs/msg/TwistWithCovariance", twist, unknown),
        )

    def _scan(self, header: Any, scan: LaserScan) -> Any:
        g, beams = scan.geometry, len(scan.ranges)
        last = g.angle_min + g.angle_increment * max(beams - 1, 0)
        none = np.zeros(0, dtype=np.float32)
        return self._new(
            LASER_SCAN,
            header,
            *map(float, (g.angle_min, last, g.angle_increment)),
            float(g.time_increment),
            float(g.time_increment * beams),
            *map(float, (g.range_min, g.range_max)),
            _ranges(scan),
            none,
        )


def _ranges(scan: LaserScan) -> NDArray[np.float32]:
    """Ranges in 32 bits, such that rounding makes no return of none, nor none of a return."""
    g = scan.geometry
    least, most = np.float32(g.range_min), np.float32(g.range_max)
    out = np.where(np.isfinite(scan.ranges), scan.ranges, np.inf).astype(np.float32)
    valid = scan.valid
    out[~valid & (out > 0.0)] = np.where(out[~valid & (out > 0.0)] < least, 0.0, np.inf)
    out[valid] = np.clip(
        out[valid], np.nextafter(least, np.float32(np.inf)) if least < g.range_min else least, None
    )
    if np.isfinite(most):
        out[valid] = np.minimum(out[valid], np.nextafter(most, np.float32(0.0)))
    return out


def _split(scan: LaserScan, path: Path) -> tuple[int, int]:
    """Seconds and nanoseconds, from which the very same double comes back."""
    sec = math.floor(scan.stamp)
    nanosec = round((scan.stamp - sec) * 1e9)
    if nanosec == 1_000_000_000:
        sec, nanosec = sec + 1, 0
    if not 0 <= sec < _LAST_SECOND:
        raise DataError(f"{path}: scan {scan.index}: ROS holds stamps from 0 to 2^31 s, found {scan.stamp!r}")
    return sec, nanosec
