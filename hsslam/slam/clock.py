"""The time from scan to scan, as far as stamps can be believed."""

from __future__ import annotations

import math

RECENT = 100
"""Scans over which the usual interval is averaged."""

LONG = 30.0
"""A longer interval than so many usual ones is a pause, and counts for no more."""

SHORT = 0.5
"""After an interval shorter than this share of the usual one the scan before must have been stamped late."""

DOUBTED = 30
"""Scans for which stamps are doubted once one was late."""


PAUSE = 5.0
PAUSE_SECONDS = 1.0
PAUSE_INTERVALS = 10
"""A recording paused where stamps go on by more than so many usual intervals and seconds, or so many seconds back; what
is usual is known after so many."""

PAUSE_AMONG_LATE = 4.0
"""Where stamps come late, it takes so many times as long: Intel's are up to 3.5 s late."""


class ScanClock:
    """Tells the time between scans.

    Recorders stamp scans when they get round to it: late, then several at once. The time between two such stamps
    says nothing, that of many does. Intervals that are longer than usual are those of lost scans.
    """

    def __init__(self) -> None:
        self._last = 0.0
        self._usual = 0.0
        self._intervals = -1
        self._doubted = 0

    def observe(self, stamp: float) -> None:
        """Take note of a scan's stamp (s)."""
        interval = stamp - self._last
        self._doubted = DOUBTED if self._late(interval) else max(self._doubted - 1, 0)
        self._last = stamp
        self._intervals += 1
        if self._intervals > 0:
            counted = min(interval, LONG * self._usual) if self._usual > 0.0 else interval
            self._usual += (counted - self._usual) / min(self._intervals, RECENT)

    def steady(self, stamp: float) -> bool:
        """Whether neither the scan of this stamp nor any of the last was stamped late."""
        return self._doubted == 0 and not self._late(stamp - self._last)

    def paused(self, stamp: float) -> bool:
        """Whether the recording paused before a scan, or began anew with it."""
        interval, least = stamp - self._last, max(PAUSE * self._usual, PAUSE_SECONDS)
        if self._doubted:
            least *= PAUSE_AMONG_LATE
        return self._intervals >= PAUSE_INTERVALS and (interval > least or interval < -least)

    def pause(self, stamp: float) -> float:
        """Length of a pause before a scan (s): infinite if stamps go back."""
        return stamp - self._last if stamp > self._last else math.inf

    def since_last(self, stamp: float) -> float:
        """Time (s) from the last scan to this, or the usual time where stamps are not steady; 0 if unknown."""
        return max(stamp - self._last if self.steady(stamp) else self._usual, 0.0)

    def _late(self, interval: float) -> bool:
        return self._intervals > 0 and interval < SHORT * self._usual
