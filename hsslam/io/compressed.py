"""Text files as lines of bytes, whether plain, gzip or bzip2."""

from __future__ import annotations

import bz2
import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO, cast

from hsslam.errors import DataError

_GZIP = b"\x1f\x8b"
_BZIP2 = b"BZh"
_BZIP2_BUFFER = 1 << 20


def read_lines(path: Path | str) -> Iterator[bytes]:
    """Lines of a file as a stream, decompressed as its first bytes ask for, whatever its suffix.

    Raises
    ------
    DataError
        The file is not there, cannot be read, or its compressed data ends early or is damaged.
    """
    path = Path(path)
    count = 0
    try:
        with _open(path) as stream:
            for line in stream:
                count += 1
                yield line
    except FileNotFoundError:
        raise DataError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise DataError(f"{path}: expected a file, found a folder") from None
    except EOFError:
        raise DataError(
            f"{path}: the compressed data ends early, after line {count}: the file is cut off; get it again"
        ) from None
    except (OSError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise DataError(f"{path}: cannot be read after line {count}: {reason}") from error


def open_for_writing(path: Path | str, kind: str) -> AbstractContextManager[BinaryIO]:
    """Open a file to write bytes to, compressed where the name ``kind`` ends in ``.gz`` or ``.bz2``.

    The same bytes always give the same file: no time stamp or name goes into the gzip header.
    """
    if kind.endswith(".bz2"):
        return cast("AbstractContextManager[BinaryIO]", bz2.open(path, "wb"))
    if kind.endswith(".gz"):
        return cast("AbstractContextManager[BinaryIO]", _Gzip(path))
    return Path(path).open("wb")


class _Gzip(gzip.GzipFile):
    """A gzip file that owns the plain file under it; ``GzipFile`` itself leaves it open."""

    def __init__(self, path: Path | str) -> None:
        self._file = Path(path).open("wb")  # noqa: SIM115  (closed in close)
        super().__init__(filename="", mode="wb", fileobj=self._file, mtime=0)

    def close(self) -> None:
        super().close()
        self._file.close()


def _open(path: Path) -> AbstractContextManager[BinaryIO]:
    with path.open("rb") as stream:
        magic = stream.read(3)
    if magic.startswith(_GZIP):
        return cast("AbstractContextManager[BinaryIO]", gzip.open(path, "rb"))
    if magic == _BZIP2:
        # A block's tables are larger than most caches: taken eight kilobytes at a time between matches, they are
        # fetched anew every time.
        return cast(
            "AbstractContextManager[BinaryIO]", io.BufferedReader(bz2.open(path, "rb"), _BZIP2_BUFFER)
        )
    return path.open("rb")
