"""Scans as a table of ranges: CSV, a scan a line, or NPZ, an array a column. docs/formats.md has the layout.

One table has one geometry: its laser does not change from scan to scan.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam.io.compressed import open_for_writing, read_lines
from hsslam.io.log_statistics import LogStatistics
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Pose, wrap

COLUMNS = ("stamp", "x", "y", "theta")
"""Before the ranges in a line of CSV: s, m, m, rad; the pose is the robot's by odometry."""

_TURNS = 1.5
"""More than any laser's sweep covers; a full one may overlap itself a little."""

_REQUIRED = ("angle_min", "angle_increment")
_OPTIONAL = {
    "range_min": 0.0,
    "range_max": math.inf,
    "time_increment": 0.0,
    "laser_x": 0.0,
    "laser_y": 0.0,
    "laser_theta": 0.0,
}


def read_range_csv(
    path: Path | str,
    *,
    on_error: Literal["stop", "skip"] = "stop",
    statistics: LogStatistics | None = None,
) -> Iterator[LaserScan]:
    """Read scans from CSV as a stream.

    Comment lines ``# angle_min=-1.57 angle_increment=0.01745`` (rad) come first; ``range_min``, ``range_max``
    (m), ``time_increment`` (s from beam to beam), ``laser_x``, ``laser_y`` (m) and ``laser_theta`` (rad) may stand
    there too. Then the header
    ``stamp,x,y,theta,r0,r1,...`` and a scan a line. An empty field, ``nan`` and ``inf`` are no returns.

    Raises
    ------
    DataError
        No such file, a setting or the header missing, a malformed line (where ``on_error`` is ``stop``), no scan.
    """
    settings: dict[str, float] = {}
    beams = -1
    index = 0
    for number, line in enumerate(read_lines(path), start=1):
        text = line.strip()
        if text.startswith(b"#"):
            settings.update(_settings(text))
            continue
        if not text:
            continue
        words = text.split(b",")
        if beams < 0:
            beams = _header(words, f"{path}:{number}")
            geometry, laser = _laser(settings, beams, str(path))
            continue
        try:
            stamp, odometry, ranges = _scan(words, beams)
        except ValueError as error:
            if on_error == "stop":
                raise DataError(f"{path}:{number}: {error}") from None
            if statistics is not None:
                statistics.skip(f"line {number}: {error}")
            continue
        yield LaserScan(stamp, ranges, geometry, odometry, laser, index)
        index += 1
    if beams < 0:
        raise DataError(f"{path}: expected the header {_wanted_header()}, found no line of a table")
    if not index:
        raise DataError(f"{path}: no scan in it; expected lines of {_wanted_header()}")


def write_range_csv(path: Path | str, scans: Iterable[LaserScan]) -> int:
    """Write scans as CSV that `read_range_csv` gives back to the last bit; how many were written.

    Raises
    ------
    DataError
        The laser changes from one scan to another; no scan; the folder cannot be written to.
    """
    path = Path(path)
    first: LaserScan | None = None
    count = 0
    with atomic_path(path) as temporary, open_for_writing(temporary, path.name) as out:
        for scan in scans:
            if first is None:
                first = scan
                names = ",".join((*COLUMNS, *(f"r{k}" for k in range(len(scan.ranges)))))
                told = " ".join(f"{key}={value!r}" for key, value in _told(scan).items())
                out.write(f"# {told}\n{names}\n".encode("ascii"))
            _require_same_laser(path, first, scan)
            values = [float(scan.stamp), *scan.odometry.tolist(), *scan.ranges.tolist()]
            out.write((",".join(map(repr, values)) + "\n").encode("ascii"))
            count += 1
        if first is None:
            raise DataError(f"{path}: no scan to write")
    return count


def read_range_npz(path: Path | str) -> Iterator[LaserScan]:
    """Read scans from an ``.npz`` file.

    Its arrays: ``ranges`` (N, B) m, ``angle_min`` and ``angle_increment`` (rad); where they are there
    ``stamps`` (N,) s, else the scan's number stands in, ``poses`` (N, 3) of the robot by odometry, else zeros,
    ``range_min``, ``range_max`` (m), ``time_increment`` (s), ``laser_pose`` (3,).

    Raises
    ------
    DataError
        No such file, an array that is missing, of another shape, or not of numbers.
    """
    arrays = _load(Path(path))
    ranges = _array(path, arrays, "ranges", 2)
    count = len(ranges)
    if not count:
        raise DataError(f"{path}: ranges holds no scan: its shape is {ranges.shape}")
    settings = {
        key: float(_array(path, arrays, key, 0))
        for key in (*_REQUIRED, "range_min", "range_max", "time_increment")
        if key in arrays
    }
    stamps = np.arange(count, dtype=np.float64)
    poses = np.zeros((count, 3))
    if "stamps" in arrays:
        stamps = _finite(path, "stamps", _array(path, arrays, "stamps", 1), (count,))
    if "poses" in arrays:
        poses = _finite(path, "poses", _array(path, arrays, "poses", 2), (count, 3))
    geometry, laser = _laser(settings, ranges.shape[1], str(path))
    if "laser_pose" in arrays:
        laser = _wrapped(_finite(path, "laser_pose", _array(path, arrays, "laser_pose", 1), (3,)))
    for index in range(count):
        yield LaserScan(float(stamps[index]), ranges[index], geometry, _wrapped(poses[index]), laser, index)


def write_range_npz(path: Path | str, scans: Iterable[LaserScan]) -> int:
    """Write scans as ``.npz`` that `read_range_npz` gives back to the last bit; how many were written.

    Raises
    ------
    DataError
        The laser changes from one scan to another; no scan; the folder cannot be written to.
    """
    path = Path(path)
    kept: list[LaserScan] = []
    for scan in scans:
        if kept:
            _require_same_laser(path, kept[0], scan)
        kept.append(scan)
    if not kept:
        raise DataError(f"{path}: no scan to write")
    geometry = kept[0].geometry
    with atomic_path(path) as temporary, temporary.open("wb") as out:
        np.savez_compressed(
            out,
            ranges=np.array([scan.ranges for scan in kept]),
            stamps=np.array([scan.stamp for scan in kept]),
            poses=np.array([scan.odometry for scan in kept]),
            laser_pose=kept[0].laser_pose,
            angle_min=np.float64(geometry.angle_min),
            angle_increment=np.float64(geometry.angle_increment),
            range_min=np.float64(geometry.range_min),
            range_max=np.float64(geometry.range_max),
            time_increment=np.float64(geometry.time_increment),
        )
    return len(kept)


def _settings(comment: bytes) -> dict[str, float]:
    """``key=value`` pairs of a comment; other words are a comment."""
    found = {}
    for word in comment.lstrip(b"# ").replace(b",", b" ").split():
        key, equals, value = word.decode("utf-8", "replace").partition("=")
        if equals and key in (*_REQUIRED, *_OPTIONAL):
            try:
                found[key] = float(value)
            except ValueError:
                found[key] = math.nan
    return found


def _laser(settings: Mapping[str, float], beams: int, path: str) -> tuple[ScanGeometry, Pose]:
    missing = [key for key in _REQUIRED if key not in settings]
    if missing:
        raise DataError(
            f"{path}: where do the beams point? expected {' and '.join(missing)} (rad): in CSV as a line "
            f"'# {' '.join(f'{key}=...' for key in missing)}' before the header, in NPZ as arrays"
        )
    told = {**_OPTIONAL, **settings}
    bad = [
        key for key, value in told.items() if math.isnan(value) or (key != "range_max" and math.isinf(value))
    ]
    if bad:
        raise DataError(f"{path}: expected a finite number for {bad[0]}, found none")
    turns = abs(told["angle_increment"]) * beams / math.tau
    if turns > _TURNS:
        raise DataError(
            f"{path}: {beams} beams, {told['angle_increment']:g} rad apart (angle_increment), would be {turns:.3g} "
            "turns; expected radians: are these degrees?"
        )
    geometry = ScanGeometry(*(told[key] for key in (*_REQUIRED, "range_min", "range_max", "time_increment")))
    return geometry, _wrapped(np.array([told["laser_x"], told["laser_y"], told["laser_theta"]]))


def _told(scan: LaserScan) -> dict[str, float]:
    g = scan.geometry
    laser = dict(zip(("laser_x", "laser_y", "laser_theta"), scan.laser_pose.tolist(), strict=True))
    limits = {"range_min": float(g.range_min), "range_max": float(g.range_max)}
    if g.time_increment != 0.0:
        limits["time_increment"] = float(g.time_increment)
    return {"angle_min": float(g.angle_min), "angle_increment": float(g.angle_increment), **limits, **laser}


def _header(words: list[bytes], where: str) -> int:
    names = [word.strip().decode("utf-8", "replace") for word in words]
    if tuple(names[: len(COLUMNS)]) != COLUMNS or len(names) == len(COLUMNS):
        found = ",".join(names)[:60]
        raise DataError(f"{where}: expected the header {_wanted_header()}, found {found!r}")
    return len(names) - len(COLUMNS)


def _wanted_header() -> str:
    return f"{','.join(COLUMNS)},r0,r1,..."


def _scan(words: list[bytes], beams: int) -> tuple[float, Pose, NDArray[np.float64]]:
    if len(words) != len(COLUMNS) + beams:
        raise ValueError(f"expected {len(COLUMNS) + beams} fields as in the header, found {len(words)}")
    try:
        values = [float(word) if word.strip() else math.nan for word in words]
    except ValueError as error:
        raise ValueError(f"expected numbers: {error}") from None
    if not all(map(math.isfinite, values[: len(COLUMNS)])):
        found = b",".join(words[: len(COLUMNS)]).decode("utf-8", "replace")
        raise ValueError(f"expected finite numbers for {','.join(COLUMNS)}, found {found!r}")
    stamp, x, y, theta = values[: len(COLUMNS)]
    return stamp, _wrapped(np.array([x, y, theta])), np.array(values[len(COLUMNS) :], dtype=np.float64)


def _wrapped(pose: NDArray[np.float64]) -> Pose:
    """The pose with its heading in [-pi, pi); one that is there already keeps its last digit."""
    out = np.array(pose, dtype=np.float64)
    if not -math.pi <= out[2] < math.pi:
        out[2] = wrap(out[2])
    return out


def _require_same_laser(path: Path, first: LaserScan, scan: LaserScan) -> None:
    if (
        scan.geometry != first.geometry
        or len(scan.ranges) != len(first.ranges)
        or not np.array_equal(scan.laser_pose, first.laser_pose)
    ):
        raise DataError(
            f"{path}: a table of ranges has one laser, but scan {scan.index} differs from the first in beams, "
            "angles, range limits or place; convert to a CARMEN log or a bag"
        )


def _load(path: Path) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as loaded:
            return {name: loaded[name] for name in loaded.files}
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, ValueError, EOFError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise DataError(f"{path}: cannot be read as an NPZ file of numbers: {error}") from error


def _array(path: Path | str, arrays: Mapping[str, Any], name: str, dimensions: int) -> NDArray[np.float64]:
    if name not in arrays:
        raise DataError(f"{path}: expected an array called {name!r}, found {', '.join(arrays) or 'none'}")
    array = np.asarray(arrays[name])
    if dimensions == 0 and array.size == 1:
        array = array.reshape(())
    if array.dtype.kind not in "fiu" or array.ndim != dimensions:
        raise DataError(
            f"{path}: expected numbers in {dimensions} dimensions for {name}, found {array.dtype} {array.shape}"
        )
    return np.asarray(array, dtype=np.float64)


def _finite(
    path: Path | str, name: str, array: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    if array.shape != shape or not np.isfinite(array).all():
        what = "numbers that are not finite" if array.shape == shape else f"shape {array.shape}"
        raise DataError(f"{path}: expected finite numbers of shape {shape} for {name}, found {what}")
    return array
