"""Plugins in a file of their own: tried without packaging them, also in the processes that this one starts.

The files are named in ``$HSSLAM_PLUGINS``, which child processes inherit: a worker of a comparison knows what its
parent knows. ``--plugin FILE`` puts a file there.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from hsslam.errors import ConfigError

VARIABLE = "HSSLAM_PLUGINS"
"""Environment variable: paths of files, separated as in ``$PATH``."""

_modules: dict[str, ModuleType] = {}
_loading: list[str] = []


def use(path: Path | str) -> None:
    """Load a file, here and in every process that this one starts from now on.

    What the file registers is known from then on; a matcher that it only defines is known by its class's name in
    snake case (``MyMatcher``: ``my_matcher``).

    Raises
    ------
    ConfigError
        There is no such file, or running it fails: says where.
    """
    full = str(Path(path).expanduser().resolve())
    _load(full)
    known = named()
    if full not in known:
        os.environ[VARIABLE] = os.pathsep.join([*known, full])


def modules() -> dict[str, ModuleType]:
    """Load what is not loaded yet of the files that are named: path to module, in the order of their naming.

    Raises
    ------
    ConfigError
        As `use`.
    """
    return {path: _load(path) for path in named()}


def fingerprints() -> dict[str, str]:
    """Return the sha256 sum of every named file, by its name: what a result was computed with."""
    return {Path(path).name: hashlib.sha256(Path(path).read_bytes()).hexdigest() for path in modules()}


def loading() -> str:
    """Path of the file that is being loaded; empty where none is."""
    return _loading[-1] if _loading else ""


def named() -> list[str]:
    """Paths of the files that are named."""
    return [path for path in os.environ.get(VARIABLE, "").split(os.pathsep) if path]


@contextmanager
def origin_of(path: str) -> Iterator[None]:
    """Count what is registered inside as coming from a file."""
    _loading.append(path)
    try:
        yield
    finally:
        _loading.pop()


def _load(path: str) -> ModuleType:
    if path in _modules:
        return _modules[path]
    file = Path(path)
    if file.is_dir():
        held = file / f"{file.name}.py"
        hint = f": {held}" if held.is_file() else ""
        raise ConfigError(f"plugin {path}: expected a Python file, found a folder; name the file in it{hint}")
    if not file.is_file():
        raise ConfigError(f"plugin {path}: no such file")
    # The path is in the module's name: two files of one name must not take each other's place.
    sign = hashlib.sha256(path.encode()).hexdigest()[:8]
    name = f"hsslam_plugin_{re.sub(r'[^0-9A-Za-z_]', '_', file.stem)}_{sign}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise ConfigError(f"plugin {path}: expected a Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    # Known before it runs: dataclasses and pickle look their module up, and it may ask for other matchers.
    sys.modules[name] = _modules[path] = module
    try:
        with origin_of(path):
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name], _modules[path]
        if isinstance(error, ConfigError):
            raise
        raise ConfigError(
            f"plugin {_place(error, path)}: cannot be loaded: {type(error).__name__}: {error}"
        ) from error
    return module


def _place(error: BaseException, path: str) -> str:
    """The file, and the line in it that failed."""
    if isinstance(error, SyntaxError) and error.filename == path:
        return f"{path}:{error.lineno}"
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
    return f"{path}:{lines[-1]}" if lines else path
