"""Rasters that grow: room for more, and what is new stamped into what is there."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

MARGIN = 4.0
"""A raster that has to grow does so by this much more than is needed (m), so that it seldom has to."""

CellT = TypeVar("CellT", np.uint8, np.uint32)


def make_room(
    cells: NDArray[CellT],
    frame: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    fill: int,
    most: int,
) -> tuple[NDArray[CellT], NDArray[np.float64]] | None:
    """A raster with room for a box, its old cells where they were.

    Parameters
    ----------
    cells : (H, W)
        The raster; itself the answer if the box is inside its border of one cell.
    frame : float64 (F,)
        Position (m) of the corner of cell (0, 0), cells per metre; what follows is kept.
    low, high : float64 (2,)
        Corners of the box (m).
    fill : int
        What new cells hold.
    most : int
        Cells per side, at most.

    Returns
    -------
    (array, float64 (F,)) or None
        Cells and frame; None where a side would be longer than ``most``.
    """
    per_metre = frame[2]
    rows, columns = cells.shape
    size = np.array([columns, rows])
    first = np.floor((low - frame[:2]) * per_metre).astype(np.int64)
    last = np.floor((high - frame[:2]) * per_metre).astype(np.int64)
    if (first >= 1).all() and (last <= size - 2).all():
        return cells, frame
    margin = math.ceil(MARGIN * per_metre)
    before = np.where(first < 1, 1 - first + margin, 0)
    after = np.where(last > size - 2, last - size + 2 + margin, 0)
    new_columns, new_rows = (int(v) for v in size + before + after)
    if max(new_columns, new_rows) > most:
        return None
    grown = np.full((new_rows, new_columns), fill, dtype=cells.dtype)
    grown[before[1] : before[1] + rows, before[0] : before[0] + columns] = cells
    moved = frame.copy()
    moved[:2] -= before / per_metre
    return grown, moved
