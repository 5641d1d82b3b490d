"""Readers of plugins: logs in formats that hsslam does not know (entry points in the group ``hsslam.readers``)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsslam.errors import ConfigError, DataError, HsslamError, UnavailableError
from hsslam.registry import Registry
from hsslam.scan import LaserScan

GROUP = "hsslam.readers"


@dataclass(frozen=True)
class Reader:
    """How logs of a format are told and read.

    Parameters
    ----------
    name : str
        What it is registered under.
    title : str
        What messages call such a log, e.g. ``SLAMTEC recording``.
    suffixes : tuple of str
        Ends of the names of such logs, in lower case, e.g. ``(".slamtec",)``.
    read : callable
        Yields the scans of a log, in its order, as they are asked for; a `hsslam.errors.DataError` says file,
        line, expected and found.
    """

    name: str
    title: str
    suffixes: tuple[str, ...]
    read: Callable[[Path], Iterator[LaserScan]]


def _fault(part: Any) -> str:
    if not isinstance(part, Reader):
        return "is no hsslam.io.readers.Reader"
    wrong = [suffix for suffix in part.suffixes if not suffix.startswith(".") or suffix != suffix.lower()]
    if wrong or not part.suffixes:
        return f"needs suffixes like .slamtec, in lower case, found {part.suffixes}"
    from hsslam.io.logs import FORMATS

    taken = [suffix for suffix in part.suffixes for log in FORMATS.values() if suffix in log.suffixes]
    if taken or part.name in FORMATS:
        return f"takes {taken[0] if taken else part.name}, which is hsslam's own; choose another"
    return ""


_readers: Registry[Reader] = Registry("reader", GROUP, fault=_fault)


def register_reader(reader: Reader) -> None:
    """Make a reader known to this process, and by ``--plugin`` to all that it starts, without packaging it.

    Raises
    ------
    ConfigError
        Its name is taken, or it is none.
    """
    if fault := _fault(reader):
        raise ConfigError(f"this reader {fault}")
    _readers.register(reader.name, reader)


def reader_of(path: Path) -> Reader | None:
    """The reader that a log's name asks for, if any: the longest suffix counts, a broken plugin is passed over."""
    name = path.name.lower()
    best: tuple[int, Reader] | None = None
    for known in _readers.names():
        try:
            reader = _readers.load(known)
        except UnavailableError:
            continue
        for suffix in reader.suffixes:
            if name.endswith(suffix) and (best is None or len(suffix) > best[0]):
                best = (len(suffix), reader)
    return None if best is None else best[1]


def stem(path: Path, reader: Reader) -> str:
    """The name of a log without the suffix that made it this reader's."""
    fitting = [suffix for suffix in reader.suffixes if path.name.lower().endswith(suffix)]
    return path.name[: -len(max(fitting, key=len))]


def read_with(reader: Reader, path: Path) -> Iterator[LaserScan]:
    """Read a log; whatever a plugin raises becomes a `DataError` with the file's name."""
    scan_number = 0
    try:
        for scan in reader.read(path):
            if not isinstance(scan, LaserScan):
                raise TypeError(f"expected a hsslam.scan.LaserScan, found {type(scan).__name__}")
            yield scan
            scan_number += 1
    except HsslamError:
        raise
    except Exception as error:
        raise DataError(
            f"{path}: the reader {reader.name} failed at scan {scan_number}: {type(error).__name__}: {error}"
        ) from error
