"""Which matchers there are: entry points in the group ``hsslam.matchers``, plugin files, registered classes."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from pydantic import ValidationError

from hsslam.errors import HsslamError, MatcherUnavailableError, UnavailableError
from hsslam.matching.interface import Matcher, MatcherConfig
from hsslam.probe import CRASHES, tried
from hsslam.registry import Registry
from hsslam.validation import explain

GROUP = "hsslam.matchers"


def _fault(part: Any) -> str:
    if not (isinstance(part, type) and issubclass(part, Matcher)):
        return "is not a subclass of hsslam.matching.Matcher"
    if not (isinstance(part.Config, type) and issubclass(part.Config, MatcherConfig)):
        return "has a Config that is not a subclass of hsslam.matching.MatcherConfig"
    return ""


def _defined_in(module: ModuleType) -> Iterator[tuple[str, type[Matcher[Any]]]]:
    """Yield the matchers that a plugin file defines, by their classes' names in snake case."""
    for name, found in vars(module).items():
        if isinstance(found, type) and issubclass(found, Matcher) and found.__module__ == module.__name__:
            if name.startswith("_") or inspect.isabstract(found):
                continue
            yield re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower(), found


_matchers: Registry[type[Matcher[Any]]] = Registry("matcher", GROUP, fault=_fault, discover=_defined_in)


@dataclass(frozen=True)
class MatcherInfo:
    """One line of ``hsslam matchers``.

    Parameters
    ----------
    name : str
        What a config calls it.
    origin : str
        The distribution or the file that it comes from, or ``registered`` for one made known with `register`.
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
        If the name is taken by another matcher, or this is none.
    """
    _matchers.register(name, matcher)


def names() -> list[str]:
    """Names of all matchers, sorted, whether they run here or not; no package's module is imported."""
    return _matchers.names()


def origin(name: str) -> str:
    """The distribution or file that a matcher comes from; ``registered`` for one that a program registered."""
    return _matchers.origin(name)


def quarantine(wanted: Iterable[str]) -> None:
    """Import matchers of other packages in a process of their own first.

    One whose import crashes or hangs there is unavailable from then on, and does not do so here. Those that
    hsslam brings, and files that are named, are trusted.
    """
    for name in sorted(set(wanted) & set(names())):
        if not _matchers.is_foreign(name):
            continue
        _, fault = tried(f"from hsslam.matching import load; load({name!r})")
        if fault.startswith(CRASHES):
            _matchers.condemn(name, f"its import {fault}")


def load(name: str) -> type[Matcher[Any]]:
    """Return the class of a matcher; heavy dependencies are not imported yet.

    Raises
    ------
    ConfigError
        No matcher has this name.
    MatcherUnavailableError
        Its module cannot be imported, or is no matcher.
    """
    try:
        return _matchers.load(name)
    except UnavailableError as error:
        raise MatcherUnavailableError(error.name, error.reason, error.remedy) from error


def configure(name: str, parameters: Mapping[str, Any] | None = None, label: str = "") -> MatcherConfig:
    """Validate a matcher's parameters; ``label`` stands for its name in messages.

    Raises
    ------
    ConfigError
        Unknown name, unknown parameter, or a value out of its range.
    MatcherUnavailableError
        Its module cannot be imported, or its own checks of its parameters break.
    """
    model = load(name).Config
    try:
        return model.model_validate(dict(parameters or {}))
    except ValidationError as error:
        raise explain(error, model, prefix=label or name) from error
    except Exception as error:  # a plugin's own validators may fail in any way
        reason = f"its Config cannot be made: {type(error).__name__}: {error}"
        raise MatcherUnavailableError(name, reason, _matchers.remedy(name)) from error


def create(name: str, parameters: Mapping[str, Any] | None = None) -> Matcher[Any]:
    """Make a matcher from its name and parameters.

    Raises
    ------
    ConfigError
        Unknown name, unknown parameter, or a value out of its range.
    MatcherUnavailableError
        It cannot run here.
    """
    config = configure(name, parameters)
    return load(name)(config)


def describe(name: str) -> MatcherInfo:
    """Tell whether a matcher runs here; imports what it needs to find out. Never raises for a broken one."""
    source = origin(name)
    summary = ""
    try:
        cls = load(name)
        summary = cls.summary
        cls.check_available()
    except MatcherUnavailableError as error:
        return MatcherInfo(name, source, False, summary, error.reason, error.remedy)
    except HsslamError:
        raise
    except Exception as error:  # a plugin's own check may fail in any way; it costs that plugin only
        reason = f"{type(error).__name__}: {error}"
        return MatcherInfo(name, source, False, summary, reason, _matchers.remedy(name))
    return MatcherInfo(name, source, True, summary)
