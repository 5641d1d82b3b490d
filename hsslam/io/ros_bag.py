"""ROS bags as the library rosbags opens them: which topics there are, and which are meant.

ROS 1 (``.bag``), ROS 2 sqlite3 (a folder with ``metadata.yaml``, or a ``.db3`` file) and MCAP (a folder, or an
``.mcap`` file) are all read, without ROS. The library is the extra ``ros``.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hsslam.errors import DataError

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

LASER_SCAN = "sensor_msgs/msg/LaserScan"
ODOMETRY = "nav_msgs/msg/Odometry"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
_OLD_TRANSFORMS = "tf/msg/tfMessage"
_USUAL = {LASER_SCAN: ("/scan", "/base_scan"), ODOMETRY: ("/odom",)}
_OPTION = {LASER_SCAN: "scan_topic", ODOMETRY: "odom_topic"}

_MENDERS = {".bag": "rosbag reindex", ".mcap": "mcap recover"}

INSTALL = "pip install 'hsslam[ros]'"


@dataclass(frozen=True)
class Message:
    """A message as it was recorded: the reader's time (ns) and the decoded content."""

    topic: str
    kind: str
    received: int
    content: Any


class Bag:
    """An open bag.

    Parameters
    ----------
    path : path
        What errors name.
    reader : AnyReader
        Of the library, open.
    """

    def __init__(self, path: Path, reader: AnyReader) -> None:
        self.path = path
        self._reader = reader

    def topics(self, kind: str) -> list[str]:
        """Names of the topics of a message type that hold messages, sorted."""
        return sorted({c.topic for c in self._connections(kind)})

    def choose(self, kind: str, wanted: str | None) -> str | None:
        """The topic of a message type: the one wanted, the only one, or the one of the usual name.

        Returns
        -------
        str or None
            None where the bag holds no topic of this type and none was asked for.

        Raises
        ------
        DataError
            The topic wanted is not there or of another type; several are, and none has the usual name.
        """
        there = self.topics(kind)
        option = _OPTION[kind]
        if wanted is not None:
            for name in (wanted, f"/{wanted.lstrip('/')}", wanted.lstrip("/")):
                if name in there:
                    return name
            raise DataError(
                f"{self.path}: no {_short(kind)} on topic {wanted!r} (option {option}); "
                + (f"there are: {self._listed(kind)}" if there else f"the bag holds: {self.listing()}")
            )
        usual = [name for name in _USUAL[kind] if name in there]
        if len(there) > 1 and not usual:
            raise DataError(
                f"{self.path}: several topics hold {_short(kind)}: {self._listed(kind)}; choose one with "
                f"--{option.replace('_', '-')} TOPIC, or FILE?{option}=TOPIC where a dataset is named"
            )
        return next(iter(usual or there), None)

    def messages(self, *topics: str) -> Iterator[Message | DecodeError]:
        """Messages of some topics as they were received; one that cannot be decoded comes as its error.

        Raises
        ------
        DataError
            The file is damaged.
        """
        chosen = [c for c in self._reader.connections if c.topic in topics]
        if not chosen:
            return
        with _one_line(self.path):
            for number, (connection, received, raw) in enumerate(self._reader.messages(chosen), start=1):
                try:
                    content = self._reader.deserialize(raw, connection.msgtype)
                except _damage() as error:
                    yield DecodeError(
                        f"message {number} ({connection.topic}): cannot be decoded: {_told(error)}"
                    )
                    continue
                yield Message(connection.topic, connection.msgtype, received, content)

    def listing(self) -> str:
        """Every topic with its type and count, in one line."""
        counts: dict[tuple[str, str], int] = {}
        for c in self._reader.connections:
            counts[c.topic, c.msgtype] = counts.get((c.topic, c.msgtype), 0) + c.msgcount
        return ", ".join(f"{t} ({_short(k)}, {n:,})" for (t, k), n in sorted(counts.items())) or "no topic"

    def transform_topics(self) -> list[str]:
        """Topics that hold transforms, the static ones first."""
        found = {*self.topics(TRANSFORMS), *self.topics(_OLD_TRANSFORMS)}
        return sorted(found, key=lambda name: ("static" not in name, name))

    def _connections(self, kind: str) -> list[Connection]:
        return [c for c in self._reader.connections if c.msgtype == kind and c.msgcount]

    def _listed(self, kind: str) -> str:
        counts: dict[str, int] = {}
        for c in self._connections(kind):
            counts[c.topic] = counts.get(c.topic, 0) + c.msgcount
        return ", ".join(f"{topic} ({count:,})" for topic, count in sorted(counts.items()))


@dataclass(frozen=True)
class DecodeError:
    """A message that could not be decoded, and why."""

    reason: str


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag.

    Raises
    ------
    DataError
        rosbags is not installed; the bag cannot be read.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DataError(f"{path}: reading ROS bags needs the library rosbags: {INSTALL} ({error})") from error
    with _one_line(path):
        # Old ROS 2 recordings do not say how their messages are laid out.
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    try:
        yield Bag(path, reader)
    finally:
        reader.close()


@contextmanager
def _one_line(path: Path) -> Iterator[None]:
    try:
        yield
    except _damage() as error:
        mend = _MENDERS.get(path.suffix, "ros2 bag reindex")
        raise DataError(
            f"{path}: cannot be read as a ROS bag: {_told(error)}; if the recording was cut off, `{mend}` may mend it"
        ) from error


def _damage() -> tuple[type[Exception], ...]:
    """What rosbags raises on damaged files, its own errors and those of what it stands on."""
    import sqlite3

    from rosbags.highlevel import AnyReaderError
    from rosbags.rosbag1 import ReaderError as Reader1Error
    from rosbags.rosbag2 import ReaderError as Reader2Error
    from rosbags.serde import SerdeError
    from rosbags.typesys import TypesysError

    library: Sequence[type[Exception]] = (
        AnyReaderError,
        Reader1Error,
        Reader2Error,
        SerdeError,
        TypesysError,
    )
    return (
        *library,
        sqlite3.Error,
        OSError,
        EOFError,
        struct.error,
        KeyError,
        IndexError,
        ValueError,
        RuntimeError,
        AssertionError,
    )


def _told(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _short(kind: str) -> str:
    return kind.rsplit("/", 1)[-1]
