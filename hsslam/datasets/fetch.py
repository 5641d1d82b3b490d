"""Download of the real datasets from their public homes, checked by their sha256 sums."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsslam.datasets.catalogue import (
    HOMES,
    REAL,
    RealDataset,
    RemoteFile,
    data_directory,
    describe,
    fetch_command,
)
from hsslam.errors import DataError

Progress = Callable[[str, int, int], None]
"""Told the file's name, bytes done and bytes in all (0 where the server does not say)."""

_TIMEOUT = 30.0
_CHUNK = 1 << 16


@dataclass(frozen=True)
class FetchedFile:
    """A file that is there and has the right sum; ``downloaded`` is False where it was there before."""

    path: Path
    sha256: str
    size: int
    downloaded: bool


@dataclass(frozen=True)
class FetchReport:
    """What was fetched, and what was checked.

    Parameters
    ----------
    name : str
        The dataset's.
    files : tuple of FetchedFile
        Each with the sha256 sum it was checked against.
    scan_count : int
        Scans read from the log.
    beams : dict
        Scans by number of beams.
    duration : float
        Between the earliest and the latest stamp (s).
    attribution : str
        What the licence asks to be printed.
    """

    name: str
    files: tuple[FetchedFile, ...]
    scan_count: int
    beams: dict[int, int]
    duration: float
    attribution: str

    def __str__(self) -> str:
        lines = [
            f"{file.path}: {file.size:,} bytes, sha256 {file.sha256[:12]}... checked"
            f"{'' if file.downloaded else ', was here already'}"
            for file in self.files
        ]
        beams = ", ".join(f"{n} beams" for n in sorted(self.beams))
        lines.append(f"{self.name}: {self.scan_count:,} scans, as expected; {beams}; {self.duration:,.0f} s")
        lines.append(self.attribution)
        return "\n".join(lines)


def fetch(
    name: str,
    data_dir: Path | str | None = None,
    progress: Progress | None = None,
    base_urls: Mapping[str, str] | None = None,
) -> FetchReport:
    """Download a real dataset into ``<data folder>/<name>/``, and read it through once.

    A file that is there with the right sum is not downloaded again; one with another sum is replaced. A
    download that fails leaves no file behind.

    Parameters
    ----------
    name : str
        ``intel`` or ``mit-csail``.
    data_dir : path, optional
        The data folder; see `hsslam.datasets.catalogue.data_directory`.
    progress : callable, optional
        Called while bytes arrive.
    base_urls : mapping, optional
        Other homes in place of `HOMES`, by the same keys; mirrors, and the tests' server.

    Raises
    ------
    DataError
        No such dataset or a simulated one; a home that does not answer or does not have the file; a file
        whose sum is another; a log whose scans are not as many as expected.
    """
    if name not in REAL:
        describe(name)
        raise DataError(f"dataset {name!r} is simulated: there is nothing to fetch, it is ready to use")
    dataset = REAL[name]
    folder = data_directory(data_dir) / name
    homes = {**HOMES, **(base_urls or {})}
    again = fetch_command(name, data_dir)
    files = tuple(_fetch_file(file, homes[file.home], folder, again, progress) for file in dataset.files)
    return _check(dataset, files)


def _check(dataset: RealDataset, files: tuple[FetchedFile, ...]) -> FetchReport:
    from hsslam.io.carmen import read_carmen

    beams: Counter[int] = Counter()
    earliest, latest = float("inf"), float("-inf")
    for scan in read_carmen(files[0].path):
        beams[len(scan.ranges)] += 1
        earliest, latest = min(earliest, scan.stamp), max(latest, scan.stamp)
    count, info = beams.total(), dataset.info
    if count != info.scan_count:
        raise DataError(f"{files[0].path}: expected {info.scan_count} scans, found {count}")
    return FetchReport(info.name, files, count, dict(beams), latest - earliest, info.attribution)


def _fetch_file(
    file: RemoteFile, home: str, folder: Path, again: str, progress: Progress | None
) -> FetchedFile:
    import pooch

    path = folder / file.name
    url = home.rstrip("/") + "/" + file.name
    before = _sum(path) == file.sha256
    if not before:
        bar: Any = _Bar(file.name, progress) if progress is not None else False
        logger = pooch.get_logger()
        level = logger.level
        logger.setLevel(logging.ERROR)  # pooch tells of every download on stderr; the report does so here
        try:
            pooch.retrieve(
                url,
                known_hash=f"sha256:{file.sha256}",
                fname=file.name,
                path=folder,
                downloader=pooch.HTTPDownloader(progressbar=bar, chunk_size=_CHUNK, timeout=_TIMEOUT),
            )
        except ValueError as error:
            raise DataError(
                f"{url}: expected the sha256 sum {file.sha256}, found another: the file was changed or cut "
                f"off on its way; nothing was kept; try again with: {again}"
            ) from error
        except OSError as error:  # what requests raises is an OSError too
            raise DataError(
                f"{url}: cannot be downloaded to {folder}: {_reason(error)}; "
                f"nothing was kept; try again with: {again}"
            ) from error
        finally:
            logger.setLevel(level)
    return FetchedFile(path, file.sha256, path.stat().st_size, downloaded=not before)


def _sum(path: Path) -> str | None:
    import pooch

    return str(pooch.file_hash(str(path))) if path.is_file() else None


def _reason(error: OSError) -> str:
    response = getattr(error, "response", None)
    if response is not None:
        return f"the server answers {response.status_code} {response.reason}"
    if error.strerror:
        return error.strerror
    kind = type(error).__name__
    told = {
        "ConnectionError": "no connection to the server",
        "ConnectTimeout": "the server does not answer",
        "ReadTimeout": "the server stopped answering",
        "ChunkedEncodingError": "the connection broke off before the end of the file",
        "SSLError": "the server's certificate is not accepted",
    }
    return told.get(kind, f"{kind}: {error}".splitlines()[0])


class _Bar:
    """What pooch wants of a progress bar."""

    def __init__(self, name: str, progress: Progress) -> None:
        self.name = name
        self.progress = progress
        self.total = 0
        self.done = 0

    def update(self, size: int) -> None:
        self.done += size
        # pooch counts whole chunks, so the last one overshoots.
        self.progress(self.name, min(self.done, self.total) if self.total else self.done, self.total)

    def reset(self) -> None:
        # pooch resets the bar at the end and then adds the total, to force it full.
        self.done = 0

    def close(self) -> None:
        """Nothing to close."""
