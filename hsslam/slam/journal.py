"""The journal of a run: every event as a line of JSON, from which a killed run goes on where it was.

Its first line is a header that says what is being run; a run goes on only as the very same one. Floats have as many
digits as it takes for them to come back bit by bit, and every line is handed to the system at once: what was written
before a kill is there after it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import orjson

from hsslam.errors import ConfigError, DataError
from hsslam.slam.events import Event, KeyframeAdded, LoopChecked, Optimised, Tracked
from hsslam.version import __version__

_FORMAT = 1
_EVENTS: dict[str, type[Event]] = {
    "tracked": Tracked,
    "keyframe": KeyframeAdded,
    "loop": LoopChecked,
    "optimised": Optimised,
}
_NAMES = {kind: (name, [item.name for item in fields(kind)]) for name, kind in _EVENTS.items()}
"""What a kind of event is called, and what is written of it."""


@dataclass(frozen=True)
class Header:
    """What a journal is the journal of.

    Parameters
    ----------
    dataset : mapping
        Whatever opens the same scans again; JSON types only.
    config : mapping
        The resolved config, as JSON types.
    version : str
        Of hsslam.
    """

    dataset: Mapping[str, Any]
    config: Mapping[str, Any]
    version: str = __version__

    def check_same(self, other: Header, path: Path | str) -> None:
        """Raise `ConfigError` naming each setting in which ``other``, read from ``path``, differs."""
        was, now = _flat(asdict(other)), _flat(asdict(self))
        different = [
            f"{key} was {was.get(key)!r}, now {now.get(key)!r}"
            for key in sorted({*was, *now})
            if was.get(key) != now.get(key)
        ]
        if different:
            raise ConfigError(
                f"{path}: this is another run, so it cannot be resumed ({'; '.join(different)}); "
                "leave these options out, or start a new run"
            )


@dataclass(frozen=True)
class Replay:
    """What a journal remembers: matches found here need not be computed again.

    Parameters
    ----------
    tracked : dict
        By number of the scan.
    loops : dict
        By the two keyframes ``(first, second)``.
    keyframes : set
        Numbers of the keyframes announced.
    header : Header, optional
        The journal's first line.
    end : int
        Bytes of the journal that are whole lines; the rest was torn off by a kill.
    """

    tracked: dict[int, Tracked] = field(default_factory=dict)
    loops: dict[tuple[int, int], LoopChecked] = field(default_factory=dict)
    keyframes: set[int] = field(default_factory=set)
    header: Header | None = None
    end: int = 0

    def holds(self, event: Event) -> bool:
        """Whether the journal has this event already."""
        match event:
            case Tracked():
                return event.scan in self.tracked
            case LoopChecked():
                return (event.first, event.second) in self.loops
            case KeyframeAdded():
                return event.keyframe in self.keyframes
            case _:
                return False


class Journal:
    """Appends events to a journal; a context manager.

    Parameters
    ----------
    path : path
        The file. It must not exist yet, unless ``replay`` is what `read_journal` made of it.
    header : Header
        What is being run.
    replay : Replay, optional
        Go on after these events; they are not written a second time when the pipeline repeats them.

    Raises
    ------
    ConfigError
        ``replay`` belongs to another run than ``header`` says.
    DataError
        The file exists and ``replay`` was left out.
    """

    def __init__(self, path: Path | str, header: Header, replay: Replay | None = None) -> None:
        path = Path(path)
        self._replay = replay if replay is not None else Replay()
        if replay is None:
            try:
                self._file = path.open("xb")
            except FileExistsError as error:
                raise DataError(f"{path}: holds a run already; resume it or choose another folder") from error
            self._write(_json({"journal": _FORMAT, **asdict(header)}))
            return
        if replay.header is not None:
            header.check_same(replay.header, path)
        os.truncate(path, replay.end)
        self._file = path.open("ab")

    def write(self, event: Event) -> None:
        """Append an event."""
        if not self._replay.holds(event):
            name, attributes = _NAMES[type(event)]
            self._write(_line({"event": name, **{key: getattr(event, key) for key in attributes}}))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, line: bytes) -> None:
        self._file.write(line)
        self._file.flush()


def read_journal(path: Path | str) -> Replay:
    """Read a journal; a last line that a kill tore off is ignored.

    Raises
    ------
    DataError
        The file cannot be read, has no header, or a line that is no event.
    """
    path = Path(path)
    replay = Replay()
    end = 0
    header = None
    for number, line in _whole_lines(path):
        try:
            values = json.loads(line)
            if number == 1:
                header = _header(values)
            else:
                _remember(replay, _event(values))
        except (ValueError, KeyError, TypeError) as error:
            expected = "the header of a journal" if number == 1 else "an event"
            raise DataError(
                f"{path}:{number}: expected {expected}, found {line[:60].decode(errors='replace').strip()!r}; "
                "the run cannot be resumed, start it anew"
            ) from error
        end += len(line)
    if header is None:
        raise DataError(f"{path}: the run died before its first line; start it anew")
    return Replay(replay.tracked, replay.loops, replay.keyframes, header, end)


def _whole_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    try:
        with path.open("rb") as file:
            for number, line in enumerate(file, start=1):
                if line.endswith(b"\n"):
                    yield number, line
    except OSError as error:
        raise DataError(f"{path}: the journal cannot be read: {error.strerror}") from error


def _header(values: Mapping[str, Any]) -> Header:
    if values["journal"] != _FORMAT:
        raise ValueError("another format of journal")
    return Header(dict(values["dataset"]), dict(values["config"]), str(values["version"]))


def _event(values: dict[str, Any]) -> Event:
    kind = _EVENTS[values.pop("event")]
    arrays = {
        key: np.array(value, dtype=np.float64) for key, value in values.items() if isinstance(value, list)
    }
    return kind(**{**values, **arrays})


def _remember(replay: Replay, event: Event) -> None:
    match event:
        case Tracked():
            replay.tracked[event.scan] = event
        case LoopChecked():
            replay.loops[(event.first, event.second)] = event
        case KeyframeAdded():
            replay.keyframes.add(event.keyframe)


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat.update(_flat(value, f"{prefix}{key}."))
        else:
            flat[prefix + key] = value
    return flat


def _line(values: Mapping[str, Any]) -> bytes:
    """A line of JSON; written in a tenth of the time that `json` takes, of which a run writes one for every scan."""
    line = orjson.dumps(values, _plain, orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_APPEND_NEWLINE)
    # It says null of a number that is none, or infinite; `json` has words for these.
    return _json(values) if b"null" in line else line


def _json(values: Mapping[str, Any]) -> bytes:
    return json.dumps(values, default=_plain).encode() + b"\n"


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in a journal")
