"""Logs of any format: which one a file is, how it is read and written.

The first bytes tell where they can, the name where they cannot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Literal

from hsslam.errors import DataError
from hsslam.io import readers
from hsslam.io.log_statistics import LogStatistics
from hsslam.scan import LaserScan

PACKED = ("", ".bz2", ".gz")
"""What may follow the suffix of a text log."""

_MAGIC = {b"#ROSBAG": "ros1", b"SQLite format 3": "ros2", b"\x89MCAP": "mcap", b"PK\x03\x04": "npz"}
BAGS = ("ros1", "ros2", "mcap")
"""Formats of ROS bags, which have topics."""
_GFS_LINES = 20


@dataclass(frozen=True)
class LogOptions:
    """How a log is read; what a format has no use for it passes over.

    Parameters
    ----------
    on_error : {"stop", "skip"}
        What a malformed line or message does.
    laser : {"front", "rear"}
        Whose scans, of a CARMEN log.
    scan_topic, odom_topic : str, optional
        Topics of a ROS bag; guessed where left out. `hsslam.io.ros_reader.read_bag` says more.
    """

    on_error: Literal["stop", "skip"] = "stop"
    laser: Literal["front", "rear"] = "front"
    scan_topic: str | None = None
    odom_topic: str | None = None


@dataclass(frozen=True)
class LogFormat:
    """A format of logs: what messages call it, and the suffixes that ask for it when a log is written."""

    name: str
    title: str
    suffixes: tuple[str, ...]
    packed: bool = False
    writable: bool = True


FORMATS = {
    log.name: log
    for log in (
        LogFormat("carmen", "CARMEN log", (".clf", ".log"), packed=True),
        LogFormat("gfs", "GMapping run", (".gfs",), packed=True, writable=False),
        LogFormat("ros1", "ROS 1 bag", (".bag",)),
        LogFormat("ros2", "ROS 2 bag (sqlite3)", (".db3",)),
        LogFormat("mcap", "ROS 2 bag (MCAP)", (".mcap",)),
        LogFormat("csv", "CSV of ranges", (".csv",), packed=True),
        LogFormat("npz", "NPZ of ranges", (".npz",)),
    )
}
"""The formats by name."""


def by_suffix(name: str) -> LogFormat | None:
    """The format that a file's name asks for, if any."""
    for log in FORMATS.values():
        for packed in PACKED if log.packed else ("",):
            if name.lower().endswith(tuple(suffix + packed for suffix in log.suffixes)):
                return log
    return None


def log_stem(name: str) -> str:
    """Strip a log's file name of the suffix of its format, and of what packs it."""
    if (reader := readers.reader_of(Path(name))) is not None:
        return readers.stem(Path(name), reader)
    for log in FORMATS.values():
        for suffix in log.suffixes:
            for packed in PACKED if log.packed else ("",):
                if name.lower().endswith(suffix + packed):
                    return name[: -len(suffix + packed)]
    return name


def is_bag_folder(path: Path) -> bool:
    """Whether a folder is a ROS 2 recording."""
    return (path / "metadata.yaml").is_file()


def detect(path: Path | str) -> LogFormat:
    """Which format a log is.

    Raises
    ------
    DataError
        No such file, a folder that is no bag, a file that cannot be read.
    """
    path = Path(path)
    if not path.exists():
        raise DataError(f"{path}: no such file")
    if (reader := readers.reader_of(path)) is not None:
        return LogFormat(reader.name, reader.title, reader.suffixes, writable=False)
    if path.is_dir():
        return FORMATS[_bag_in_folder(path)]
    try:
        with path.open("rb") as stream:
            head = stream.read(16)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    for magic, name in _MAGIC.items():
        if head.startswith(magic):
            (suffix,) = FORMATS[name].suffixes
            if name in BAGS and path.suffix != suffix:  # rosbags goes by the name
                raise DataError(f"{path}: holds a {FORMATS[name].title}; rename it to {path.stem}{suffix}")
            return FORMATS[name]
    named = by_suffix(path.name)
    if named is not None and named.name in ("csv", "gfs"):
        return named
    if named is not None and named.name != "carmen":
        found = repr(head[:8]) if head else "an empty file"
        raise DataError(f"{path}: expected a {named.title}, as its name says, found {found}")
    state = path.stat()
    return FORMATS["gfs" if _looks_like_gfs(path, state.st_size, state.st_mtime_ns) else "carmen"]


def read_log(
    path: Path | str, options: LogOptions | None = None, statistics: LogStatistics | None = None
) -> Iterator[LaserScan]:
    """Read the scans of a log of any format, as a stream where the format allows it.

    Parameters
    ----------
    path : path
        The log.
    options : LogOptions, optional
        How; the defaults where left out.
    statistics : LogStatistics, optional
        Filled while reading; `new_statistics` makes the right one.

    Raises
    ------
    DataError
        As the format's own reader does.
    """
    path, options = Path(path), options or LogOptions()
    if (reader := readers.reader_of(path)) is not None:
        return readers.read_with(reader, path)
    name = detect(path).name
    if name == "npz":
        from hsslam.io.range_table import read_range_npz

        return read_range_npz(path)
    if name == "csv":
        from hsslam.io.range_table import read_range_csv

        return read_range_csv(path, on_error=options.on_error, statistics=statistics)
    if name == "gfs":
        from hsslam.io.gfs import read_gfs

        return read_gfs(path, on_error=options.on_error, statistics=statistics)
    if name == "carmen":
        from hsslam.io.carmen import CarmenStatistics, read_carmen

        seen = statistics if isinstance(statistics, CarmenStatistics) else None
        return read_carmen(path, on_error=options.on_error, laser=options.laser, statistics=seen)
    from hsslam.io.ros_reader import read_bag

    return read_bag(
        path,
        scan_topic=options.scan_topic,
        odom_topic=options.odom_topic,
        on_error=options.on_error,
        statistics=statistics,
    )


def new_statistics(path: Path | str) -> LogStatistics:
    """Statistics of the kind that the log's reader fills; raises what `detect` does."""
    if detect(path).name == "carmen":
        from hsslam.io.carmen import CarmenStatistics

        return CarmenStatistics()
    return LogStatistics()


def write_log(path: Path | str, scans: Iterable[LaserScan], format_name: str) -> int:
    """Write scans as a log; as exactly as its format can hold them.

    Parameters
    ----------
    path : path
        The log.
    scans : iterable of LaserScan
        In their order.
    format_name : str
        One of `FORMATS` that is writable.

    Returns
    -------
    int
        Scans written.

    Raises
    ------
    DataError
        As the format's own writer does.
    """
    writer = _writer(format_name)
    return writer(Path(path), scans)


def _writer(name: str) -> Callable[[Path, Iterable[LaserScan]], int]:
    if name == "carmen":
        from hsslam.io.carmen import CarmenWriter

        def write_carmen(path: Path, scans: Iterable[LaserScan]) -> int:
            with CarmenWriter(path, exact=True) as writer:
                return writer.write_all(scans)

        return write_carmen
    if name == "csv":
        from hsslam.io.range_table import write_range_csv

        return write_range_csv
    if name == "npz":
        from hsslam.io.range_table import write_range_npz

        return write_range_npz
    if name not in BAGS:
        raise DataError(f"logs are not written as {name!r}: {FORMATS[name].title}s are read only")
    from hsslam.io.ros_writer import BagKind, write_bag

    kind: BagKind = "ros1" if name == "ros1" else "ros2" if name == "ros2" else "mcap"
    return lambda path, scans: write_bag(path, scans, kind)


def _bag_in_folder(path: Path) -> str:
    if not is_bag_folder(path):
        there = sorted(p.name for s in (".db3", ".mcap", ".bag") for p in path.glob(f"*{s}"))
        if (path / "trajectory.tum").is_file():
            hint = "it is a run folder; name the log that was run"
        elif (path / "journal.jsonl").is_file():
            hint = (
                f"it is the folder of a run that was ended early; `hsslam run --resume {path}` completes it"
            )
        elif there:
            hint = f"name the file in it, e.g. {path / there[0]}"
        else:
            hint = "name the file in it"
        raise DataError(
            f"{path}: expected a log, found a folder without metadata.yaml, so no ROS 2 bag; {hint}"
        )
    return "mcap" if any(path.glob("*.mcap")) else "ros2"


@lru_cache(maxsize=8)  # a log is asked for its format several times, and its first lines may be compressed
def _looks_like_gfs(path: Path, size: int, changed: int) -> bool:
    from hsslam.io.compressed import read_lines
    from hsslam.io.gfs import RECORDS

    return any(line.startswith(RECORDS) for line in islice(read_lines(path), _GFS_LINES))
