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
    low: tuple[float, float],
    high: tuple[float, float],
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
    low, high : (float, float)
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
    per_metre = float(frame[2])
    before, after = [0, 0], [0, 0]
    margin = math.ceil(MARGIN * per_metre)
    # One axis after the other, in plain numbers: most boxes are inside, and arrays of two take longer to tell.
    for axis, size in enumerate(reversed(cells.shape)):
        first = math.floor((low[axis] - float(frame[axis])) * per_metre)
        last = math.floor((high[axis] - float(frame[axis])) * per_metre)
        if first < 1:
            before[axis] = 1 - first + margin
        if last > size - 2:
            after[axis] = last - size + 2 + margin
    if before == after == [0, 0]:
        return cells, frame
    rows, columns = cells.shape
    new_columns, new_rows = columns + before[0] + after[0], rows + before[1] + after[1]
    if max(new_columns, new_rows) > most:
        return None
    grown = np.full((new_rows, new_columns), fill, dtype=cells.dtype)
    grown[before[1] : before[1] + rows, before[0] : before[0] + columns] = cells
    moved = frame.copy()
    moved[:2] -= np.array(before) / per_metre
    return grown, moved
