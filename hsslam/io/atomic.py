"""Files that are either there as a whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hsslam.errors import DataError


@contextmanager
def atomic_path(path: Path | str) -> Iterator[Path]:
    """Write a file under a temporary name beside its own and rename it when the block ends well.

    The temporary name ends in the same suffixes, so that libraries which go by the suffix write the same
    format. A reader never sees half a file; an exception leaves whatever was there before.

    Parameters
    ----------
    path : path
        The file to make; its folder is made where it is missing.

    Yields
    ------
    Path
        An empty file in the same folder to write to.

    Raises
    ------
    DataError
        The folder cannot be made or written to.
    """
    target = Path(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=".part-", suffix=f"-{target.name}")
    except OSError as error:
        raise DataError(f"{target}: cannot be written: {error.strerror or error}") from error
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        try:
            temporary.replace(target)
        except OSError as error:
            raise DataError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    # The only portable way to read the mask is to set it; mkstemp's 0600 would hide results from colleagues.
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
