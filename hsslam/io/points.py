"""Point sets from a file."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import DataError
from hsslam.io.compressed import read_lines
from hsslam.se2 import Points

SUFFIXES = (".csv", ".txt", ".xyz", ".npy", ".npz")
"""What `read_points` reads."""


def read_points(path: Path | str) -> Points:
    """Read points (m), float64 (N, 2).

    ``.csv``, ``.txt`` and ``.xyz`` hold a point a line: x and y first, further columns are not used;
    separated by commas, semicolons or white space. The first line may be a header; lines that begin with
    ``#`` are comments. ``.npy`` and ``.npz`` hold an array (N, 2) or wider; of an ``.npz`` with several
    arrays, the one called ``points``.

    Raises
    ------
    DataError
        No such file, an unknown suffix, no points, a malformed line, an array of another shape.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise DataError(f"{path}: expected a file of points ({', '.join(SUFFIXES)}), found suffix {suffix!r}")
    points = _from_numpy(path) if suffix in (".npy", ".npz") else _from_text(path)
    if not len(points):
        raise DataError(f"{path}: no points in it")
    return points


def _from_text(path: Path) -> Points:
    rows: list[tuple[float, float]] = []
    first = True
    for number, line in enumerate(read_lines(path), start=1):
        words = line.replace(b",", b" ").replace(b";", b" ").split()
        if not words or words[0].startswith(b"#"):
            continue
        try:
            x, y = float(words[0]), float(words[1])
            if not (math.isfinite(x) and math.isfinite(y)):
                raise ValueError
        except (ValueError, IndexError):
            if first and not _is_number(words[0]):
                first = False
                continue
            found = line.strip()[:60].decode("utf-8", "replace")
            raise DataError(f"{path}:{number}: expected x and y in finite numbers, found {found!r}") from None
        first = False
        rows.append((x, y))
    return np.array(rows, dtype=np.float64).reshape(-1, 2)


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _from_numpy(path: Path) -> Points:
    try:
        loaded = np.load(path, allow_pickle=False)
        array = loaded if isinstance(loaded, np.ndarray) else _pick(path, loaded)
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DataError(f"{path}: cannot be read as a NumPy file of numbers: {error}") from error
    if array.ndim != 2 or array.shape[1] < 2 or array.dtype.kind not in "fiu":
        raise DataError(
            f"{path}: expected an array of numbers of shape (N, 2), found {array.dtype} {array.shape}"
        )
    return np.ascontiguousarray(array[:, :2], dtype=np.float64)


def _pick(path: Path, arrays: np.lib.npyio.NpzFile) -> NDArray[np.generic]:
    with arrays:
        names = arrays.files
        name = "points" if "points" in names else names[0] if len(names) == 1 else None
        if name is None:
            raise DataError(f"{path}: expected an array called 'points', found {', '.join(names) or 'none'}")
        picked: NDArray[np.generic] = arrays[name]
        return picked
