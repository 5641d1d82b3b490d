"""Named parts that anybody may add: matchers, fitness functions, datasets, readers, all through the same two doors.

An installed package declares an entry point in the kind's group; a file is named with ``--plugin`` (or in
``$HSSLAM_PLUGINS``, see `hsslam.plugin_files`) and registers what it defines. A part that cannot be loaded is
listed with its reason, and takes nothing else down.
"""

from __future__ import annotations

import difflib
import importlib.util
import sys
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, TypeVar

from hsslam import plugin_files
from hsslam.errors import ConfigError, UnavailableError

T = TypeVar("T")


class Registry(Generic[T]):
    """The parts of one kind, by name.

    Parameters
    ----------
    kind : str
        What messages call one of them.
    group : str
        Entry points in this group declare them.
    fault : callable
        Tells why a loaded object is no such part (``"is not a ..."``); an empty text where it is one.
    builtin : mapping, optional
        What hsslam brings; matchers come through entry points instead.
    discover : callable, optional
        Finds parts that a plugin file defines without registering them.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        *,
        fault: Callable[[Any], str],
        builtin: Mapping[str, T] | None = None,
        discover: Callable[[ModuleType], Iterator[tuple[str, T]]] | None = None,
    ) -> None:
        self.kind = kind
        self.group = group
        self._fault = fault
        self._builtin: dict[str, T] = dict(builtin or {})
        self._discover = discover
        self._registered: dict[str, T] = {}
        self._files: dict[str, str] = {}
        self._condemned: dict[str, str] = {}
        self._searched: set[str] = set()
        self._loaded: dict[tuple[str, tuple[str, ...]], T] = {}

    def names(self) -> list[str]:
        """All names, the built-in ones first, else sorted; no plugin but the named files is imported."""
        self._search_files()
        others = {*self._entry_points(), *self._known()} - set(self._builtin)
        return [*self._builtin, *sorted(others)]

    def register(self, name: str, part: T) -> None:
        """Make a part known to this process without packaging it.

        Raises
        ------
        ConfigError
            The name is taken by another part, or this is no such part.
        """
        if fault := self._fault(part):
            raise ConfigError(f"{self.kind} {name!r} {fault}")
        declared, file = self._entry_points().get(name), plugin_files.loading()
        if declared is not None and file and _lies_in(declared, file):
            return  # an editable package and its own file: they are the same
        if declared is not None:
            mend = "leave out --plugin, or uninstall it" if file else "give yours another name"
            raise ConfigError(
                f"a {self.kind} named {name!r} exists already (from {self.origin(name)}); {mend}"
            )
        if name in self._builtin or self._known().get(name, part) is not part:
            raise ConfigError(f"a {self.kind} named {name!r} exists already; give yours another name")
        self._registered[name] = part
        self._files[name] = plugin_files.loading()

    def load(self, name: str) -> T:
        """Return the part of that name.

        Raises
        ------
        ConfigError
            There is none; with the name that was probably meant.
        UnavailableError
            Its module cannot be imported, or holds something else.
        """
        self._search_files()
        if name in self._builtin:
            return self._builtin[name]
        known = self._known()
        if name in known:
            return known[name]
        # Looking through the installed packages takes a millisecond; a search asks at every reference.
        here = (name, tuple(sys.path))
        if here in self._loaded:
            return self._loaded[here]
        declared = self._entry_points().get(name)
        if declared is None:
            raise ConfigError(f"no {self.kind} is named {name!r}{self.suggest(name)}", ("name",), name)
        if name in self._condemned:
            raise UnavailableError(name, self._condemned[name], self.remedy(name), self.kind)
        try:
            loaded = declared.load()
        except (Exception, SystemExit) as error:  # a plugin's import may fail in any way
            reason = f"{type(error).__name__}: {error}"
            raise UnavailableError(name, reason, self.remedy(name), self.kind) from error
        if fault := self._fault(loaded):
            reason = f"{declared.value} {fault}"
            raise UnavailableError(name, reason, self.remedy(name), self.kind)
        self._loaded[here] = loaded
        return self._loaded[here]

    def is_foreign(self, name: str) -> bool:
        """Whether a part comes from an installed package other than hsslam."""
        return name in self._entry_points() and self.origin(name) != "hsslam"

    def condemn(self, name: str, reason: str) -> None:
        """Never import a part in this process: it was seen to crash or hang another."""
        self._condemned[name] = reason

    def origin(self, name: str) -> str:
        """The distribution or file that a part comes from; ``registered`` for one that a program registered."""
        if name in self._builtin:
            return "hsslam"
        declared = self._entry_points().get(name)
        if declared is not None:
            return declared.dist.name if declared.dist is not None else "unknown"
        file = self._files.get(name)
        return f"file {Path(file).name}" if file else "registered"

    def remedy(self, name: str) -> str:
        """The line to type where a part is broken, not merely short of something."""
        declared = self._entry_points().get(name)
        if declared is None:
            return f"correct {self.origin(name)}"
        package = declared.dist.name if declared.dist is not None else declared.value.split(".")[0]
        return f"pip install --force-reinstall {package}"

    def suggest(self, name: str) -> str:
        """What follows "no such name": the name that was probably meant, and those there are."""
        known = self.names()
        close = difflib.get_close_matches(name, known, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        return f"{hint} (there are: {', '.join(known)})"

    def _search_files(self) -> None:
        for path, module in plugin_files.modules().items():
            if path in self._searched or self._discover is None:
                continue
            self._searched.add(path)
            with plugin_files.origin_of(path):
                for name, part in self._discover(module):
                    if all(part is not known for known in self._registered.values()):
                        self.register(name, part)

    def _known(self) -> dict[str, T]:
        """What was registered, but for what comes from a file that is named no more."""
        named = {"", *plugin_files.named()}
        return {name: part for name, part in self._registered.items() if self._files[name] in named}

    def _entry_points(self) -> dict[str, EntryPoint]:
        found: dict[str, EntryPoint] = {}
        for entry in entry_points(group=self.group):
            other = found.get(entry.name)
            if other is not None and other.value != entry.value:
                raise ConfigError(
                    f"two installed packages declare a {self.kind} named {entry.name!r}: {other.value} and "
                    f"{entry.value}; uninstall one of them"
                )
            found[entry.name] = entry
        return found


def _lies_in(entry: EntryPoint, file: str) -> bool:
    """Whether an entry point's module is this very file."""
    try:
        spec = importlib.util.find_spec(entry.module)
    except (ImportError, ValueError):
        return False
    return spec is not None and spec.origin is not None and Path(spec.origin).resolve() == Path(file)
