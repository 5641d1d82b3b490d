"""A log in a file, with the truth that lies beside it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from hsslam.datasets.dataset import DatasetInfo
from hsslam.errors import DataError
from hsslam.io.log_statistics import LogStatistics
from hsslam.io.logs import BAGS, LogOptions, detect, log_stem, new_statistics, read_log
from hsslam.io.relations import Relations, read_relations
from hsslam.io.tum import read_tum
from hsslam.scan import LaserScan
from hsslam.trajectory import Trajectory


class FileDataset:
    """A log of any format and, where they lie beside it, its relations and its exact truth.

    Beside ``office.clf.bz2`` these are ``office.relations`` (with ``office.relations.index.csv``, which names
    scans by number, where it is there) and ``office.truth.tum`` (a pose per scan). Nothing is kept in memory:
    each call of `scans` reads the file anew.

    Parameters
    ----------
    path : path
        The log: a file, or the folder of a ROS 2 bag.
    info : DatasetInfo, optional
        What listings show; made from the file's name where left out.
    scans : int, optional
        Take only the first so many scans, and the truth of those.
    options : LogOptions, optional
        How it is read: what a malformed line does, which laser, which topics.

    Raises
    ------
    DataError
        No such file, a folder that is no bag, or ``scans`` below 1.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        info: DatasetInfo | None = None,
        scans: int | None = None,
        options: LogOptions | None = None,
    ) -> None:
        self.path = Path(path)
        found = detect(self.path)
        title = found.title
        if scans is not None and scans < 1:
            raise DataError(f"{self.path}: expected at least one scan to be asked for, found {scans}")
        self.statistics: LogStatistics = new_statistics(self.path)
        """Of the newest call of `scans`."""
        self._limit = scans
        self._options = options or LogOptions()
        if (self._options.scan_topic or self._options.odom_topic) and found.name not in BAGS:
            raise DataError(f"{self.path}: a {title} has no topics; leave out --scan-topic and --odom-topic")
        self._count = info.scan_count if info is not None else None
        if scans is not None and self._count is not None:
            self._count = min(scans, self._count)
        self._info = info or DatasetInfo(self.stem, "file", f"{title} {self.path.name}")

    @property
    def stem(self) -> str:
        """The file's name without its suffixes."""
        return log_stem(self.path.name)

    @property
    def info(self) -> DatasetInfo:
        """Name, kind, attribution; the scan count once it is known."""
        i = self._info
        return DatasetInfo(i.name, i.kind, i.description, i.attribution, self._count)

    def scans(self) -> Iterator[LaserScan]:
        """Read the scans in the log's order, as a stream; `hsslam.io.logs.read_log` says what is raised."""
        self.statistics = statistics = new_statistics(self.path)
        stream = read_log(self.path, self._options, statistics)
        count = 0
        for scan in islice(stream, self._limit):
            count += 1
            yield scan
        self._count = count

    def truth(self) -> Trajectory | None:
        """Exact robot poses from ``<stem>.truth.tum``, where it is there.

        Raises
        ------
        DataError
            A malformed line.
        """
        path = self.path.with_name(f"{self.stem}.truth.tum")
        if not path.exists():
            return None
        truth = read_tum(path)
        n = self._limit
        return Trajectory(truth.stamps[:n], truth.poses[:n], truth.indices[:n])

    def relations(self) -> Relations | None:
        """Relations from ``<stem>.relations``, where it is there; those between the scans that are taken.

        Without an index file, and where malformed lines are skipped, scans are found by their stamps, which
        reads the log.

        Raises
        ------
        DataError
            A malformed line, or a stamp that names no scan.
        """
        path = self.path.with_name(f"{self.stem}.relations")
        if not path.exists():
            return None
        index = path.with_name(f"{path.name}.index.csv")
        if index.exists() and self._options.on_error == "stop":
            found = read_relations(path, index=index)
        else:
            log = read_log(self.path, self._options)
            found = read_relations(path, stamps=np.array([scan.stamp for scan in log]))
        if self._limit is None:
            return found
        taken = np.maximum(found.first, found.second) < self._limit
        return Relations(found.first[taken], found.second[taken], found.poses[taken])
