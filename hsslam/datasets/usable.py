"""Whether a log holds anything to match, found out before work begins."""

from __future__ import annotations

import numpy as np

from hsslam.datasets.dataset import Dataset
from hsslam.datasets.file import FileDataset
from hsslam.errors import DataError
from hsslam.scan import LaserScan

ENOUGH = 3
"""Returns that a scan needs to fix a pose."""


def require_returns(log: Dataset) -> None:
    """Read a log up to the first scan that can be matched, which as a rule is its first.

    Raises
    ------
    DataError
        No scan has enough returns; says what the readings are instead. Also what reading raises.
    """
    first: LaserScan | None = None
    count = 0
    for scan in log.scans():
        if np.count_nonzero(scan.valid) >= ENOUGH:
            return
        first = scan if first is None else first
        count += 1
    if first is not None:
        name = log.path if isinstance(log, FileDataset) else log.info.name
        raise DataError(
            f"{name}: expected scans with {ENOUGH} returns or more, found none in {count:,}; "
            f"{_readings(first)}"
        )


def _readings(scan: LaserScan) -> str:
    """What the readings of a scan are that are no returns, and what may be wrong."""
    ranges, geometry = scan.ranges, scan.geometry
    finite = ranges[np.isfinite(ranges)]
    counts = (
        (len(ranges) - len(finite), "are not finite"),
        (
            np.count_nonzero(finite >= geometry.range_max),
            f"are at or over range_max, {geometry.range_max:g} m",
        ),
        (np.count_nonzero(finite <= 0.0), "are zero or negative"),
        (
            np.count_nonzero((finite > 0.0) & (finite < geometry.range_min)),
            f"are below range_min, {geometry.range_min:g} m",
        ),
    )
    told = ", ".join(f"{number} {what}" for number, what in counts if number)
    if not told:
        return f"the first has {len(ranges)} readings in all"
    text = f"of the {len(ranges)} readings of the first {told}"
    if len(finite) and np.median(finite) > 10.0 * geometry.range_max:
        text += f" (their median is {np.median(finite):g}: are they millimetres? Expected are metres)"
    return text
