"""Which matchers there are: entry points in the group ``hsslam.matchers``, loaded when asked for."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from pydantic import ValidationError

from hsslam.errors import ConfigError, HsslamError, MatcherUnavailableError
from hsslam.matching.interface import Matcher
from hsslam.validation import explain

GROUP = "hsslam.matchers"

_registered: dict[str, type[Matcher[Any]]] = {}


@dataclass(frozen=True)
class MatcherInfo:
    """One line of ``hsslam matchers``.

    Parameters
    ----------
    name : str
        What a config calls it.
    origin : str
        The distribution that declares it, or ``registered`` for one made known with `register`.
    available : bool
        Whether it runs here.
    summary : str
        What it does, in a line; empty where its class could not be loaded.
    reason, remedy : str
        Why it is unavailable, and the line to type that mends it; empty where it is available.
    """

    name: str
    origin: str
    available: bool
    summary: str = ""
    reason: str = ""
    remedy: str = ""


def register(name: str, matcher: type[Matcher[Any]]) -> None:
    """Make a matcher known to this process without packaging it.

    Raises
    ------
    ConfigError
        If the name is taken by another matcher.
    """
    if name in _entry_points() or _registered.get(name, matcher) is not matcher:
        raise ConfigError(f"a matcher named {name!r} exists already; give yours another name")
    _registered[name] = matcher


def names() -> list[str]:
    """Names of all matchers, sorted, whether they run here or not; nothing is imported."""
    return sorted({*_entry_points(), *_registered})


def load(name: str) -> type[Matcher[Any]]:
    """Return the class of a matcher; heavy dependencies are not imported yet.

    Raises
    ------
    ConfigError
        No matcher has this name.
    MatcherUnavailableError
        Its module cannot be imported, or is no matcher.
    """
    if name in _registered:
        return _registered[name]
    declared = _entry_points().get(name)
    if declared is None:
        close = difflib.get_close_matches(name, names(), n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise ConfigError(f"no matcher is named {name!r}{hint} (there are: {', '.join(names())})")
    try:
        loaded = declared.load()
    except Exception as error:
        raise MatcherUnavailableError(
            name, f"{type(error).__name__}: {error}", _reinstall(declared)
        ) from error
    if not (isinstance(loaded, type) and issubclass(loaded, Matcher)):
        raise MatcherUnavailableError(
            name, f"{declared.value} is not a subclass of hsslam.matching.Matcher", _reinstall(declared)
        )
    return loaded


def create(name: str, parameters: Mapping[str, Any] | None = None) -> Matcher[Any]:
    """Make a matcher from its name and parameters.

    Raises
    ------
    ConfigError
        Unknown name, unknown parameter, or a value out of its range.
    MatcherUnavailableError
        It cannot run here.
    """
    cls = load(name)
    try:
        config = cls.Config.model_validate(dict(parameters or {}))
    except ValidationError as error:
        raise ConfigError(explain(error, cls.Config, prefix=name)) from error
    return cls(config)


def describe(name: str) -> MatcherInfo:
    """Tell whether a matcher runs here; imports what it needs to find out. Never raises for a broken one."""
    declared = _entry_points().get(name)
    origin = "registered"
    if declared is not None:
        origin = declared.dist.name if declared.dist is not None else "unknown"
    summary = ""
    try:
        cls = load(name)
        summary = cls.summary
        cls.check_available()
    except MatcherUnavailableError as error:
        return MatcherInfo(name, origin, False, summary, error.reason, error.remedy)
    except HsslamError:
        raise
    except Exception as error:  # a plugin's own check may fail in any way; it costs that plugin only
        reason = f"{type(error).__name__}: {error}"
        return MatcherInfo(name, origin, False, summary, reason, f"pip install --force-reinstall {origin}")
    return MatcherInfo(name, origin, True, summary)


def _entry_points() -> dict[str, EntryPoint]:
    found: dict[str, EntryPoint] = {}
    for entry in entry_points(group=GROUP):
        other = found.get(entry.name)
        if other is not None and other.value != entry.value:
            raise ConfigError(
                f"two installed packages declare a matcher named {entry.name!r}: {other.value} and {entry.value}; "
                "uninstall one of them"
            )
        found[entry.name] = entry
    return found


def _reinstall(entry: EntryPoint) -> str:
    name = entry.dist.name if entry.dist is not None else entry.value.split(".")[0]
    return f"pip install --force-reinstall {name}"
