"""Plain dataclasses as files of JSON."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path

_Record = TypeVar("_Record")


def write_record(path: Path, record: object) -> None:
    """Write a dataclass as JSON; it appears when it is complete."""
    kind: type[Any] = type(record)
    text = TypeAdapter(kind).dump_json(record, indent=1)
    with atomic_path(path) as temporary:
        temporary.write_bytes(text + b"\n")


def read_record(path: Path, kind: type[_Record]) -> _Record:
    """Read what `write_record` wrote.

    Raises
    ------
    DataError
        The file is not there, or holds something else.
    """
    try:
        return TypeAdapter(kind).validate_json(path.read_bytes())
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise DataError(f"{path}: is no {kind.__name__}: {where or 'content'}: {first['msg']}") from error
