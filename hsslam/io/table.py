"""Numbers in columns, read so that a bad line is named by its number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.compressed import read_lines
from hsslam.se2 import wrap


def read_table(
    path: Path | str, columns: Sequence[str], *, separator: str | None = None, header: bool = False
) -> tuple[NDArray[np.float64], list[int]]:
    """Read a table of finite numbers.

    Parameters
    ----------
    path : path
        Plain, gzip or bzip2. Empty lines and lines that begin with ``#`` are passed over.
    columns : sequence of str
        Names of the columns.
    separator : str, optional
        Between columns; white space where left out.
    header : bool
        Whether the first line must hold the names of the columns.

    Returns
    -------
    table : float64 (N, len(columns))
    lines : list of int
        Number of the line that each row stands on, from 1.

    Raises
    ------
    DataError
        The file, the line, what was expected and what was found.
    """
    rows: list[list[float]] = []
    lines: list[int] = []
    mark = separator.encode() if separator is not None else None
    expected = (separator or " ").join(columns)
    for number, line in enumerate(read_lines(path), start=1):
        stripped = line.strip()
        if not stripped or stripped.startswith(b"#"):
            continue
        words = [word.strip() for word in stripped.split(mark)]
        if header:
            header = False
            if words != [name.encode() for name in columns]:
                raise DataError(
                    f"{path}:{number}: expected the header {expected!r}, found {_shown(stripped)}"
                )
            continue
        rows.append(_row(words, len(columns), f"{path}:{number}", expected))
        lines.append(number)
    if header:
        raise DataError(f"{path}: expected the header {expected!r}, found an empty file")
    return np.array(rows, dtype=np.float64).reshape(-1, len(columns)), lines


def whole_numbers(
    table: NDArray[np.float64], column: int, name: str, path: Path | str, lines: Sequence[int]
) -> NDArray[np.int64]:
    """Read a column as numbers of scans: whole and not negative.

    Raises
    ------
    DataError
        Naming the first line where they are not.
    """
    values = table[:, column]
    bad = np.flatnonzero((values != np.floor(values)) | (values < 0))
    if len(bad):
        row = int(bad[0])
        raise DataError(
            f"{path}:{lines[row]}: expected a whole number from 0 for {name}, found {values[row]:.12g}"
        )
    return values.astype(np.int64)


def wrapped(theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles (rad) brought into [-pi, pi); those that are there already do not change in the last digit."""
    out = theta.copy()
    outside = np.flatnonzero((theta < -math.pi) | (theta >= math.pi))
    for i in outside:
        out[i] = wrap(theta[i])
    return out


def _row(words: list[bytes], width: int, where: str, expected: str) -> list[float]:
    if len(words) != width:
        raise DataError(
            f"{where}: expected {width} numbers ({expected}), found {len(words)} words: "
            f"{_shown(b' '.join(words))}"
        )
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise DataError(f"{where}: expected finite numbers ({expected}), found {_shown(word)}")
        values.append(value)
    return values


def _shown(text: bytes) -> str:
    return repr(text[:60].decode("utf-8", "replace"))
