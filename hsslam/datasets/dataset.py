"""What a dataset is to the rest of hsslam: scans in order, and whatever truth there is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from hsslam.io.relations import Relations
    from hsslam.scan import LaserScan
    from hsslam.trajectory import Trajectory


@dataclass(frozen=True)
class DatasetInfo:
    """What a listing shows of a dataset.

    Parameters
    ----------
    name : str
        What the command line calls it; for a file, its name without suffixes.
    kind : str
        ``simulated``, ``real``, ``file``, or what a plugin calls its own; ``unavailable`` where a plugin is
        broken, with the reason for a description.
    description : str
        One line.
    attribution : str
        What must be printed wherever results appear; empty where nothing must.
    scan_count : int or None
        Scans in it, where known without reading it.
    """

    name: str
    kind: str
    description: str
    attribution: str = ""
    scan_count: int | None = None


class Dataset(Protocol):
    """A log: real, simulated or a file of the user's."""

    @property
    def info(self) -> DatasetInfo:
        """Name, kind, attribution."""

    def scans(self) -> Iterator[LaserScan]:
        """Yield the scans in the log's order, read as they are asked for; each call starts anew."""

    def truth(self) -> Trajectory | None:
        """Exact robot poses of every scan, where they are known (simulated data)."""

    def relations(self) -> Relations | None:
        """Manually verified relative poses between scans, where there are some (real data)."""


class OpenDataset(Protocol):
    """Opens a dataset; what it has no use for it passes over."""

    def __call__(
        self, *, seed: int, scans: int | None, data_dir: Path | None, on_error: Literal["stop", "skip"]
    ) -> Dataset:
        """Open it; see `hsslam.datasets.catalogue.open_dataset`."""


@dataclass(frozen=True)
class DatasetSource:
    """A dataset that a plugin brings: what listings show, and how it is opened.

    Parameters
    ----------
    info : DatasetInfo
        Its ``name`` is the one that it is registered under.
    open : callable
        Opens it.
    """

    info: DatasetInfo
    open: OpenDataset
