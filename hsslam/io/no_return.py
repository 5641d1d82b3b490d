"""What readings say that are no return, where a log does not tell: the laser's maximum, again and again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FARTHEST = 80.0
"""Readings at or over it (m) are no returns of any laser that is logged so."""

FEWEST = 2000
"""Readings to judge by, at least."""

LEAST_SHARE = 0.02
"""Share of the readings that the maximum must be, at least: one beam through a door is less."""

TIMES = 5
"""How many times as often as any other far reading the maximum must be there: a wall reads this and that."""

FAR = 0.5
"""How far a far reading is, as a share of the maximum."""


def no_return_of(readings: NDArray[np.float64]) -> float | None:
    """The reading that stands for no return (m), if there is one among the returns.

    Parameters
    ----------
    readings : float64 (N,)
        Of many beams, as recorded (m).

    Returns
    -------
    float or None
        The largest of the readings under `FARTHEST`, if it is there far more often than any other.
    """
    far = readings[(readings > 0.0) & (readings < FARTHEST)]
    if not len(far) or len(readings) < FEWEST:
        return None
    far = far[far > FAR * far.max()]
    values, counts = np.unique(far, return_counts=True)
    often = counts[-1] >= LEAST_SHARE * len(readings)
    return float(values[-1]) if often and counts[-1] > TIMES * counts[:-1].max(initial=0) else None


def refutes(readings: NDArray[np.float64], no_return: float) -> bool:
    """Whether later readings are further than what was taken for no return, and returns."""
    return bool(((readings > no_return) & (readings < FARTHEST)).any())
