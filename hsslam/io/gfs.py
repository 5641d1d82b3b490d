"""What GMapping leaves of a run (``.gfs``): its scans and their odometry.

GMapping writes a line per record. Taken are ``LASER_READING n r1..rn x y theta time``: a scan that it
processed, with the robot's pose by odometry. The particles' poses (``ODO_UPDATE``, ``SM_UPDATE``) and the rest are
passed over: GMapping's own trajectory is its result, not its input; ``gfs2log`` of GMapping turns it into a
CARMEN log. The first scan of a run and scans that GMapping skipped are not in the file; ranges have two
decimals.

Like ``FLASER`` the record does not tell where its beams point. 540 and 541 beams are taken for a SICK S300's
(from -135 degrees by 0.5, 30 m), 682 and 683 for a Hokuyo URG's (from -120 degrees, 1024 to the turn, 5.5 m): the
lasers that ``gfs2log`` knows. Any other number is read as `hsslam.io.carmen` reads it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from hsslam.errors import DataError
from hsslam.io.carmen_messages import FLASER_RANGE_MAX, beam_start_and_step
from hsslam.io.compressed import read_lines
from hsslam.io.log_statistics import LogStatistics
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import wrap

RECORDS = (b"LASER_READING", b"ODO_UPDATE", b"SM_UPDATE", b"FRAME", b"NEFF", b"ENTROPY", b"SIMULATOR_POS")
"""Records that no CARMEN log holds: they tell the format."""

_TURN = 2.0 * math.pi


def read_gfs(
    path: Path | str,
    *,
    on_error: Literal["stop", "skip"] = "stop",
    statistics: LogStatistics | None = None,
) -> Iterator[LaserScan]:
    """Read the scans of a ``.gfs`` file as a stream.

    Raises
    ------
    DataError
        No such file, a malformed ``LASER_READING`` (where ``on_error`` is ``stop``), none at all.
    """
    index = 0
    for number, line in enumerate(read_lines(path), start=1):
        if not line.startswith(b"LASER_READING"):
            continue
        try:
            scan = _parse(line.split(), index)
        except ValueError as error:
            if on_error == "stop":
                raise DataError(f"{path}:{number}: {error}") from None
            if statistics is not None:
                statistics.skip(f"line {number}: {error}")
            continue
        yield scan
        index += 1
    if not index:
        raise DataError(f"{path}: no scan in it; expected GMapping's LASER_READING lines")


def _parse(words: list[bytes], index: int) -> LaserScan:
    expected = "LASER_READING n r1..rn x y theta time"
    try:
        beams = int(words[1])
        values = [float(word) for word in words[2:]]
    except (ValueError, IndexError):
        raise ValueError(f"expected {expected} in numbers, found {words[1:6]!r}") from None
    # Old versions of GMapping leave out the time.
    if len(values) not in (beams + 3, beams + 4) or beams < 0:
        raise ValueError(f"expected {expected}: {beams + 6} words for {beams} readings, found {len(words)}")
    x, y, theta, stamp = (*values[beams:], float(index))[:4]
    if not all(map(math.isfinite, (x, y, theta, stamp))):
        raise ValueError(f"expected {expected} with a finite pose, found {words[-4:]!r}")
    inside = -math.pi <= theta < math.pi
    odometry = np.array([x, y, theta if inside else wrap(theta)])
    return LaserScan(stamp, np.array(values[:beams]), _geometry(beams), odometry, index=index)


def _geometry(beams: int) -> ScanGeometry:
    if beams in (540, 541):
        return ScanGeometry(math.radians(-135.0), math.radians(0.5), range_max=30.0)
    if beams in (682, 683):
        return ScanGeometry(-_TURN / 3.0, _TURN / 1024.0, range_max=5.5)
    start, step = beam_start_and_step(beams)
    return ScanGeometry(start, step, range_max=FLASER_RANGE_MAX)
