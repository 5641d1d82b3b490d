"""CARMEN logs: one message a line, the format of most public 2D laser logs.

What is read
------------
The ``laser`` chosen, ``front`` or ``rear``, says which messages are scans:

=========================  =============================================================================
front / rear               words after the name; all end in ``ipc_timestamp host logger_timestamp``
=========================  =============================================================================
FLASER / RLASER            ``n r1..rn x y theta odom_x odom_y odom_theta``
ROBOTLASER1 / ROBOTLASER2  ``laser_type start_angle field_of_view angular_resolution maximum_range accuracy
                           remission_mode n r1..rn m i1..im``, pose of the laser, pose of the robot,
                           ``laser_tv laser_rv forward_safety_dist side_safety_dist turn_axis``
REMISSIONFLASER /          ``n r1 i1 .. rn in``: pairs of range and remission, no pose
REMISSIONRLASER
RAWLASER1 / RAWLASER2      as ROBOTLASER up to the remissions, no pose
=========================  =============================================================================

Besides, ``ODOM x y theta ...`` and ``PARAM name value`` are read; comments, ``SYNC``, ``TRUEPOS`` and all
other messages are counted and passed over. Remission values are passed over too. A CARMEN system logs a scan
without a pose beside the same scan with one, so messages without a pose are taken only where the first
`LOOK_AHEAD` lines hold no scan with a pose; their odometry is that of the newest ``ODOM`` line.

Conventions
-----------
- FLASER and the like do not tell where their beams point. Beams run from -90 to +90 degrees,
  counter-clockwise: step 1 degree for 180 and 181 beams, 0.5 for 360 and 361. 180 and 360 lack the last beam:
  they end at +89 and +89.5. The SICK's narrow modes start at -50 degrees: step 1, 0.5, 0.25 degree for
  100/101, 200/201, 400/401 beams. Any other count is centred with the step (degrees) that
  ``PARAM laser_front_laser_resolution`` gives; without it 540/541 and 1080/1081 beams start at -135 degrees (step
  0.5, 0.25), 682/683 at -120 (1024 to the turn), and the rest are spread over -90..+90.
- A reading that is no return reads as the laser's maximum (81.83, 81.91, ...), and stays in ``ranges``;
  ``geometry.range_max`` makes it invalid. It is 80 m for FLASER and the like, or what
  ``PARAM robot_front_laser_max`` says if that is less, or the largest reading of the first scans where it is there far
  more often than any other (8.19, 29.9, 50), until a scan reads more; for messages with a geometry it is their
  ``maximum_range``, where one from 80 to 82 m (a SICK's code, not its reach) or of 0 counts as 80 m.
- ``odometry`` is always the robot's pose. In FLASER it is the second pose of the line; the first is that of
  the laser (or, in corrected logs, the corrected one) and is not used: ``laser_pose`` comes from ``PARAM
  robot_frontlaser_offset`` (metres along the robot's x; also ``_side_offset``, ``_angular_offset``), the rear
  laser's from ``robot_rearlaser_offset`` and faces backwards. In ROBOTLASER it is the line's first pose seen
  from its second.
- ``stamp`` is ``ipc_timestamp``. Loggers write in bursts: stamps may step back. The order is that of the
  lines. ``FLASER`` and the like may lack the host and the logger's stamp, or all stamps: then these are 0, 1, 2...
- A last line that is cut off is left out and counted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import chain, islice
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io import carmen_messages as messages
from hsslam.io.carmen_messages import Laser, LogState, MalformedError
from hsslam.io.carmen_writer import CarmenWriter
from hsslam.io.compressed import read_lines
from hsslam.io.log_statistics import LogStatistics
from hsslam.io.no_return import no_return_of
from hsslam.scan import LaserScan

__all__ = ["LOOK_AHEAD", "CarmenStatistics", "CarmenWriter", "OnError", "read_carmen"]

OnError: TypeAlias = Literal["stop", "skip"]

LOOK_AHEAD = 1000
"""Lines looked at, before the first scan is given out, to see which messages the log holds."""

_Parser: TypeAlias = Callable[[messages.Words, LogState, int], LaserScan]

_WITH_POSE: dict[Laser, dict[bytes, _Parser]] = {
    "front": {b"FLASER": messages.parse_flaser, b"ROBOTLASER1": messages.parse_robotlaser},
    "rear": {b"RLASER": messages.parse_flaser, b"ROBOTLASER2": messages.parse_robotlaser},
}
_WITHOUT_POSE: dict[Laser, dict[bytes, _Parser]] = {
    "front": {b"REMISSIONFLASER": messages.parse_remission_flaser, b"RAWLASER1": messages.parse_rawlaser},
    "rear": {b"REMISSIONRLASER": messages.parse_remission_flaser, b"RAWLASER2": messages.parse_rawlaser},
}


@dataclass
class CarmenStatistics(LogStatistics):
    """What a reader saw; filled while it reads.

    Its fields beside those of `LogStatistics`:

    Parameters
    ----------
    lines : int
        Lines read.
    scans : Counter
        Scans given out, by message name.
    odometry : int
        ``ODOM`` lines.
    ignored : Counter
        Messages passed over, by name; comments under ``#``.
    """

    lines: int = 0
    scans: Counter[str] = field(default_factory=Counter)
    odometry: int = 0
    ignored: Counter[str] = field(default_factory=Counter)


def read_carmen(
    path: Path | str,
    *,
    on_error: OnError = "stop",
    laser: Laser = "front",
    range_max: float | None = None,
    statistics: CarmenStatistics | None = None,
) -> Iterator[LaserScan]:
    """Read the scans of a CARMEN log, one by one, in the order of their lines.

    The log may be plain, gzip or bzip2; its first bytes tell. The module's text states the conventions.

    Parameters
    ----------
    path : path
        The log.
    on_error : {"stop", "skip"}
        Whether a malformed line stops the reader or is left out and counted.
    laser : {"front", "rear"}
        Whose scans to read.
    range_max : float, optional
        Ranges at or over it (m) are no returns; left out, the log decides.
    statistics : CarmenStatistics, optional
        Filled while reading.

    Yields
    ------
    LaserScan
        ``index`` counts the scans given out, from 0.

    Raises
    ------
    DataError
        At the first scan asked for: no such file. While reading: a malformed line (file, line number,
        expected, found), compressed data that end early. At the end: a log without a scan.
    ValueError
        Another ``on_error`` or ``laser``.
    """
    if on_error not in ("stop", "skip"):
        raise ValueError(f"on_error is 'stop' or 'skip', not {on_error!r}")
    if laser not in _WITH_POSE:
        raise ValueError(f"laser is 'front' or 'rear', not {laser!r}")
    state = LogState(laser, range_max)
    return _scans(Path(path), on_error, state, statistics if statistics is not None else CarmenStatistics())


def _scans(
    path: Path, on_error: OnError, state: LogState, statistics: CarmenStatistics
) -> Iterator[LaserScan]:
    lines = read_lines(path)
    head = list(islice(lines, LOOK_AHEAD))
    parsers = _choose_parsers(head, state)
    state.no_return = _no_return(head, parsers)
    index = 0
    lines = chain(head, lines)
    for number, line in enumerate(lines, start=1):
        statistics.lines = number
        words = line.split()
        if not words:
            continue
        name = words[0]
        parser = parsers.get(name)
        try:
            if parser is not None:
                scan = parser(words, state, index)
                statistics.scans[name.decode()] += 1
                index += 1
                yield scan
            elif name == b"ODOM":
                messages.parse_odom(words, state)
                statistics.odometry += 1
            elif name == b"PARAM":
                messages.parse_param(words, state)
            else:
                label = "#" if name.startswith(b"#") else name[:32].decode("ascii", "replace")
                statistics.ignored[label] += 1
        except MalformedError as error:
            # What was being logged when the disk was full or the robot switched off: the end of many a log.
            if on_error == "stop" and not (index and next(lines, None) is None):
                raise DataError(
                    f"{path}:{number}: {error}; mend or delete the line, or have such lines skipped "
                    "(--on-error skip)"
                ) from error
            statistics.skip(f"line {number}: {error}")
    if not index:
        raise DataError(_why_no_scans(path, state.laser, statistics))


def _choose_parsers(head: list[bytes], state: LogState) -> dict[bytes, _Parser]:
    """Parsers of the messages to take for scans; also the first odometry, for scans that come before it."""
    names = set()
    for line in reversed(head):
        words = line.split(None, 4)
        if not words:
            continue
        names.add(words[0])
        if words[0] == b"ODOM":
            try:
                messages.parse_odom(words, state)
            except MalformedError:
                continue  # the reader proper reports it, with its line number
    with_pose, without = _WITH_POSE[state.laser], _WITHOUT_POSE[state.laser]
    return {**with_pose, **without} if names.isdisjoint(with_pose) else with_pose


def _no_return(head: list[bytes], parsers: dict[bytes, _Parser]) -> float | None:
    """What the scans at the beginning of a log read that have no return, of messages that do not tell."""
    readings: list[NDArray[np.float64]] = []
    for line in head:
        words = line.split()
        if words and words[0] in (b"FLASER", b"RLASER") and words[0] in parsers:
            try:
                readings.append(np.array(words[2 : 2 + int(words[1])], dtype=np.float64))
            except (ValueError, IndexError):
                continue  # the reader proper reports it, with its line number
    return no_return_of(np.concatenate(readings)) if readings else None


def _why_no_scans(path: Path, laser: Laser, statistics: CarmenStatistics) -> str:
    if not statistics.lines:
        return f"{path}: the file is empty; expected a CARMEN log"
    if statistics.skipped:
        first = statistics.reasons[0]
        return f"{path}: no scan can be read; {statistics.skipped} malformed lines, the first: {first}"
    other: Laser = "rear" if laser == "front" else "front"
    wanted = _message_names(laser)
    there = [name for name in _message_names(other) if name in statistics.ignored]
    names = [name for name, _ in statistics.ignored.most_common(5) if name != "#"][:4]
    if not all(name.isprintable() and "\ufffd" not in name for name in names):
        return f"{path}: expected a CARMEN log, a text file, found a binary one; is it another format's?"
    found = ", ".join(there or map(repr, names)) or (
        "odometry only" if statistics.odometry else "no messages"
    )
    hint = f"; it holds scans of the {other} laser" if there else ""
    return (
        f"{path}: no scans of the {laser} laser in {statistics.lines} lines: expected a CARMEN log with "
        f"{', '.join(wanted)} messages, found {found}{hint}"
    )


def _message_names(laser: Laser) -> list[str]:
    return [name.decode() for kinds in (_WITH_POSE, _WITHOUT_POSE) for name in kinds[laser]]
