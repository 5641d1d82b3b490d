"""Datasets by name: where each comes from, and how it is opened."""

from __future__ import annotations

import difflib
import os
import shlex
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from hsslam.datasets.dataset import Dataset, DatasetInfo, DatasetSource
from hsslam.errors import ConfigError, DataError, UnavailableError
from hsslam.registry import Registry

if TYPE_CHECKING:
    from hsslam.io.carmen import OnError

HOMES = {
    "logs": "https://raw.githubusercontent.com/MOLAorg/mola_test_datasets/"
    "13a2ed141116bc654e14ffca1d88fb740b3d1253/datasets/radish/",
    "relations": "http://ais.informatik.uni-freiburg.de/slamevaluation/datasets/",
}
"""Public homes of the files."""

_ATTRIBUTION = (
    "{log}; relations by R. Kuemmerle, B. Steder, C. Dornhege, M. Ruhnke, G. Grisetti, C. Stachniss and "
    'A. Kleiner ("On measuring the accuracy of SLAM algorithms", Autonomous Robots 27, 2009; SLAM '
    "benchmarking, University of Freiburg). Creative Commons Attribution 3.0 (CC-BY 3.0)."
)


@dataclass(frozen=True)
class RemoteFile:
    """A file of a real dataset: its name, its home (a key of `HOMES`) and the sha256 sum that proves it."""

    name: str
    home: Literal["logs", "relations"]
    sha256: str


@dataclass(frozen=True)
class RealDataset:
    """A real dataset: what it is, and its files, the log first."""

    info: DatasetInfo
    files: tuple[RemoteFile, ...]


SIMULATED = {
    "office": "simulated office with corridors and a loop; exact truth",
    "corridor": "simulated long plain corridor; exact truth",
    "hall": "simulated cluttered hall; exact truth",
}
"""Names and descriptions of the built-in simulated datasets."""

REAL = {
    "intel": RealDataset(
        DatasetInfo(
            name="intel",
            kind="real",
            description="Intel Research Lab, Seattle: an office floor driven several times, 2,984 relations",
            attribution=_ATTRIBUTION.format(log="Intel Research Lab log by D. Haehnel (2003)"),
            scan_count=13631,
        ),
        (
            RemoteFile(
                "intel.clf.bz2", "logs", "d9ce4addefc9405d5e78fd883d2214766552537d262009f8e6f0137885f9f72a"
            ),
            RemoteFile(
                "intel.relations",
                "relations",
                "330378f153eeae652d6756c1746f335801f66c3e097d90611548e6c4f593c359",
            ),
        ),
    ),
    "mit-csail": RealDataset(
        DatasetInfo(
            name="mit-csail",
            kind="real",
            description="MIT CSAIL: offices and corridors, 361 beams, 1,172 relations",
            attribution=_ATTRIBUTION.format(
                log="MIT CSAIL log from the Robotics Data Set Repository (Radish)"
            ),
            scan_count=1988,
        ),
        (
            RemoteFile(
                "mit-csail.clf.bz2",
                "logs",
                "e010703e450a20e71a97b0e8de88d9474040c8106e547ff894d885e67a309b47",
            ),
            RemoteFile(
                "mit-csail.relations",
                "relations",
                "ffd7ebe97fa1738913931e39ca643ee0a1b67de80499b0197a3d01abad0f589d",
            ),
        ),
    ),
}
"""The real datasets by name."""


SOURCE_OPTIONS = ("scan_topic", "odom_topic")
"""What may follow the path of a log, after a question mark."""


def names() -> list[str]:
    """Names of all datasets: the simulated ones, the real ones, those of plugins."""
    return [*SIMULATED, *REAL, *_plugins.names()]


def describe(name: str) -> DatasetInfo:
    """Tell what a dataset is, without opening it.

    Raises
    ------
    DataError
        No dataset has this name.
    """
    if name in REAL:
        return REAL[name].info
    if name in SIMULATED:
        from hsslam.datasets.simulator import DEFAULT_SCANS

        return DatasetInfo(name, "simulated", SIMULATED[name], scan_count=DEFAULT_SCANS.get(name))
    if name in _plugins.names():
        try:
            return _plugins.load(name).info
        except UnavailableError as error:
            return DatasetInfo(name, "unavailable", error.reason)
    raise DataError(f"no dataset is named {name!r}{_suggest(name)}")


GROUP = "hsslam.datasets"
"""Entry points in this group declare a `DatasetSource`."""


def _fault(part: Any) -> str:
    if not isinstance(part, DatasetSource):
        return "is no hsslam.datasets.dataset.DatasetSource"
    if part.info.name in (*SIMULATED, *REAL):
        return f"has the name of a built-in dataset, {part.info.name}"
    return ""


_plugins: Registry[DatasetSource] = Registry("dataset", GROUP, fault=_fault)


def register_dataset(source: DatasetSource) -> None:
    """Make a dataset known to this process, and by ``--plugin`` to all that it starts, without packaging it.

    Raises
    ------
    ConfigError
        Its name is taken, or it is none.
    """
    if fault := _fault(source):
        raise ConfigError(f"this dataset {fault}")
    _plugins.register(source.info.name, source)


def remedy(name: str) -> str:
    """Line to type where a plugin's dataset is unavailable."""
    return _plugins.remedy(name)


def data_directory(data_dir: Path | str | None = None) -> Path:
    """Folder of the real datasets: the one given, else ``$HSSLAM_DATA``, else the user's data folder."""
    if data_dir is not None:
        return Path(data_dir).expanduser()
    chosen = os.environ.get("HSSLAM_DATA")
    if chosen:
        return Path(chosen).expanduser()
    import platformdirs

    return platformdirs.user_data_path("hsslam", appauthor=False)


def open_dataset(
    name_or_path: str | Path,
    *,
    data_dir: Path | None = None,
    seed: int = 0,
    scans: int | None = None,
    on_error: OnError = "stop",
) -> Dataset:
    """Open a dataset by name, or a log of any format by path.

    Parameters
    ----------
    name_or_path : str or path
        A name that `names` lists, or a file. A name wins over a file of the same name; ``./intel``
        is the file. Topics of a ROS bag may follow the path: ``drive.bag?scan_topic=/front&odom_topic=/odom``.
    data_dir : path, optional
        Where real datasets lie; see `data_directory`. Found there as ``intel/intel.clf`` or ``intel.clf``,
        plain or with ``.bz2`` or ``.gz`` at the end.
    seed : int
        Of a simulated dataset; others do not use it.
    scans : int, optional
        Take only the first so many scans of a log; make so many of a simulation.
    on_error : {"stop", "skip"}
        What a malformed line of a log does.

    Raises
    ------
    DataError
        Not found: says where it looked, and what fetches it.
    """
    from hsslam.datasets.file import FileDataset
    from hsslam.io.logs import LogOptions, log_stem

    name = str(name_or_path)
    if name in _plugins.names():
        source = _plugins.load(name)
        opened = source.open(seed=seed, scans=scans, data_dir=data_dir, on_error=on_error)
        lacking = [part for part in ("info", "scans", "truth", "relations") if not hasattr(opened, part)]
        if lacking:
            raise DataError(
                f"dataset {name!r}: expected its source to open a hsslam.datasets.dataset.Dataset, found a "
                f"{type(opened).__name__} without {', '.join(lacking)}"
            )
        return opened
    if name in SIMULATED:
        from hsslam.datasets.simulator import SimulatedDataset

        return SimulatedDataset(name, seed=seed, scans=scans)
    if name in REAL:
        path = find_log(name, data_dir)
        return FileDataset(path, info=REAL[name].info, scans=scans, options=LogOptions(on_error))
    location, told = split_source(name)
    path = Path(location).expanduser()
    options = LogOptions(on_error, scan_topic=told.get("scan_topic"), odom_topic=told.get("odom_topic"))
    if not path.exists():
        raise DataError(
            f"{name}: no such file, and no dataset has this name{_suggest(name)}"
            if path.name == name and not path.suffix
            else f"{name}: no such file"
        )
    stem = log_stem(path.name)
    dataset = FileDataset(path, scans=scans, options=options)
    if stem in REAL:
        # A copy of a public log under its own name still has to be attributed.
        info = replace(dataset.info, attribution=REAL[stem].info.attribution)
        dataset = FileDataset(path, info=info, scans=scans, options=options)
    return dataset


def split_source(source: str) -> tuple[str, dict[str, str]]:
    """Part the path of a log from the options that follow it after a question mark.

    Raises
    ------
    DataError
        An option that is none.
    """
    if Path(source).expanduser().exists() or "?" not in source:
        return source, {}
    location, _, query = source.rpartition("?")
    told = {}
    for part in query.split("&"):
        key, _, value = part.partition("=")
        if key not in SOURCE_OPTIONS or not value:
            raise DataError(
                f"{source}: expected {' or '.join(f'{k}=...' for k in SOURCE_OPTIONS)}, found {part!r}"
            )
        told[key] = value
    return location, told


def join_source(source: str, **options: str | None) -> str:
    """Put options behind the path of a log, over those that stand there; None leaves one as it is.

    A path is made absolute, so that the source means the same from any folder. Raises what `split_source` does.
    """
    if source in names():
        if any(options.values()):
            raise DataError(
                f"dataset {source!r} has no topics: {', '.join(k for k, v in options.items() if v)}"
            )
        return source
    location, told = split_source(source)
    told |= {key: value for key, value in options.items() if value is not None}
    path = Path(location).expanduser()
    place = str(path.resolve()) if path.exists() else location
    return f"{place}?{'&'.join(f'{k}={v}' for k, v in told.items())}" if told else place


def find_log(name: str, data_dir: Path | str | None = None) -> Path:
    """Path of a real dataset's log.

    Raises
    ------
    DataError
        It is not there: says where it looked, and what fetches it.
    """
    from hsslam.io.logs import FORMATS, PACKED

    folder = data_directory(data_dir)
    for place in (folder / name, folder):
        for suffix in FORMATS["carmen"].suffixes:
            for packed in PACKED:
                path = place / f"{name}{suffix}{packed}"
                if path.is_file():
                    return path
    raise DataError(
        f"dataset {name!r} is not here: looked for {name}.clf (or .clf.bz2, .clf.gz, .log) in "
        f"{folder / name} and {folder}; get it with: {fetch_command(name, data_dir)}"
    )


def fetch_command(name: str, data_dir: Path | str | None = None) -> str:
    """Line to type that fetches a real dataset."""
    option = f" --data-dir {shlex.quote(str(data_dir))}" if data_dir is not None else ""
    return f"hsslam datasets fetch {name}{option}"


def _suggest(name: str) -> str:
    close = difflib.get_close_matches(name, names(), n=1)
    hint = f"; did you mean {close[0]!r}?" if close else ""
    return f"{hint} (there are: {', '.join(names())}; or give the path of a log)"
