"""What is installed, what is missing, and the line that mends it."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Literal, TypeAlias

from hsslam.errors import HsslamError
from hsslam.probe import tried
from hsslam.version import __version__

Status: TypeAlias = Literal["ok", "missing", "broken"]

OWN = "hsslam"
"""The distribution whose matchers share a process; others may crash theirs."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Parameters
    ----------
    what : str
        Its name.
    status : {"ok", "missing", "broken"}
        ``missing``: optional, and not here. ``broken``: needed, or here and not working.
    detail : str
        One line.
    remedy : str
        The line to type that mends it; empty where nothing needs mending.
    """

    what: str
    status: Status
    detail: str
    remedy: str = ""


def examine(data_dir: Path | None = None) -> Iterator[Finding]:
    """Look at everything that hsslam stands on, in turn.

    Whatever may crash or hang is tried in a process of its own.

    Parameters
    ----------
    data_dir : path, optional
        Where real datasets are looked for; see `hsslam.datasets.catalogue.data_directory`.
    """
    yield _python()
    yield from _requirements()
    yield from _imports()
    yield _kernel_cache()
    yield from _matchers()
    yield _plugin_files()
    yield _bags()
    yield _sweeps()
    yield from _data(data_dir)
    yield _output()
    yield from _live()


def _bags() -> Finding:
    """Whether ROS bags can be read."""
    from hsslam.io.ros_bag import INSTALL

    try:
        return Finding("ROS bags", "ok", f"read by rosbags {metadata.version('rosbags')}")
    except metadata.PackageNotFoundError:
        return Finding("ROS bags", "missing", "rosbags is not installed", INSTALL)


def _sweeps() -> Finding:
    """Whether sweeps run; even on one machine they are scheduled by Dask."""
    try:
        return Finding("sweeps", "ok", f"run by distributed {metadata.version('distributed')}")
    except metadata.PackageNotFoundError:
        return Finding("sweeps", "missing", "distributed is not installed", "pip install 'hsslam[sweep]'")


def _live() -> Iterator[Finding]:
    """What can show a map while it grows; everything else is drawn without a display."""
    from hsslam.live.viewers import INSTALL, display

    try:
        yield Finding("live map", "ok", f"shown by rerun-sdk {metadata.version('rerun-sdk')}, or matplotlib")
    except metadata.PackageNotFoundError:
        detail = "rerun-sdk is not installed; windows of matplotlib only"
        yield Finding("live map", "missing", detail, INSTALL)
    found = display()
    detail = f"{found}, for --live" if found else "none, and none needed: --live does without, or records"
    yield Finding("display", "ok", detail)


def _python() -> Finding:
    version = ".".join(map(str, sys.version_info[:3]))
    place = Path(__file__).parent
    detail = f"{__version__} in {place}, Python {version} ({sys.executable})"
    if not (3, 11) <= sys.version_info[:2] < (3, 14):
        return Finding("hsslam", "broken", f"{detail}; it is made for Python 3.11 to 3.13", "sh try.sh")
    return Finding("hsslam", "ok", detail)


def _requirements() -> Iterator[Finding]:
    """Packages that hsslam cannot do without, at the versions that it asks for."""
    from packaging.requirements import Requirement

    try:
        declared = [Requirement(line) for line in metadata.requires(OWN) or ()]
    except metadata.PackageNotFoundError:
        yield Finding("packages", "broken", "hsslam is not installed, only on the path", "pip install -e .")
        return
    wanted = [need for need in declared if need.marker is None or need.marker.evaluate({"extra": ""})]
    wrong = 0
    for need in wanted:
        try:
            found = metadata.version(need.name)
        except metadata.PackageNotFoundError:
            wrong += 1
            yield Finding(need.name, "broken", "not installed", f"pip install '{need}'")
            continue
        if not need.specifier.contains(found, prereleases=True):
            wrong += 1
            detail = f"version {found}, needed is {need.specifier}"
            yield Finding(need.name, "broken", detail, f"pip install '{need}'")
    if not wrong:
        yield Finding("packages", "ok", f"all {len(wanted)} that hsslam needs")


def _imports() -> Iterator[Finding]:
    """The compiled packages, imported: a version that is installed may still not load."""
    for package in ("gtsam", "scipy.optimize", "matplotlib.figure"):
        _, fault = tried(f"import {package}")
        if fault:
            name = package.partition(".")[0]
            yield Finding(name, "broken", fault, f"pip install --force-reinstall {name}")


def _kernel_cache() -> Finding:
    """Where Numba keeps compiled kernels: without it every run compiles them anew."""
    found, fault = tried(
        "import json; from hsslam.se2 import compose as k\n"
        "import numpy as np; k(np.zeros(3), np.zeros(3))\n"
        "print(json.dumps(getattr(k._cache, 'cache_path', None)))"
    )
    if fault:
        return Finding("numba", "broken", fault, "pip install --force-reinstall numba")
    if found is None:
        detail = "no folder to keep compiled kernels in: every run compiles them anew, for half a minute"
        return Finding("kernel cache", "broken", detail, 'export NUMBA_CACHE_DIR="$HOME/.cache/numba"')
    if not os.access(found, os.W_OK):
        return Finding("kernel cache", "broken", f"{found} cannot be written", f"chmod u+w {found}")
    return Finding("kernel cache", "ok", str(found))


def _matchers() -> Iterator[Finding]:
    from hsslam.matching import registry

    try:
        origins = {name: registry.origin(name) for name in registry.names()}
    except HsslamError as error:
        yield Finding("matchers", "broken", str(error))
        return
    own = [name for name, origin in origins.items() if origin == OWN]
    for names in filter(None, [own, *([name] for name in origins if name not in own)]):
        told, fault = tried(
            "import json, sys; from dataclasses import asdict; from hsslam.matching import describe\n"
            f"print(json.dumps([asdict(describe(name)) for name in {names!r}]))"
        )
        if fault:
            origin = origins[names[0]]
            remedy = "" if origin.startswith("file ") else f"pip install --force-reinstall {origin}"
            yield Finding(f"matcher {', '.join(names)}", "broken", fault, remedy)
            continue
        for info in told:
            what, source = f"matcher {info['name']}", "" if info["origin"] == OWN else f" ({info['origin']})"
            if info["available"]:
                yield Finding(what, "ok", f"{info['summary']}{source}")
                continue
            optional = info["origin"] == OWN and "is not installed" in info["reason"]
            status: Status = "missing" if optional else "broken"
            yield Finding(what, status, f"{info['reason']}{source}", info["remedy"])


def _plugin_files() -> Finding:
    from hsslam import plugin_files

    named = plugin_files.named()
    if not named:
        return Finding("plugin files", "ok", f"none named (--plugin, ${plugin_files.VARIABLE})")
    try:
        plugin_files.modules()
    except HsslamError as error:
        return Finding("plugin files", "broken", str(error), f"unset {plugin_files.VARIABLE}")
    return Finding("plugin files", "ok", ", ".join(named))


def _data(data_dir: Path | None) -> Iterator[Finding]:
    from hsslam.datasets import catalogue
    from hsslam.errors import DataError

    folder = catalogue.data_directory(data_dir)
    standing = next(place for place in (folder, *folder.parents) if place.exists())
    if not (standing.is_dir() and os.access(standing, os.W_OK)):
        yield Finding(
            "data folder", "broken", f"{folder} cannot be written", "export HSSLAM_DATA=/a/folder/of/yours"
        )
    else:
        yield Finding("data folder", "ok", str(folder))
    try:
        known = catalogue.names()
    except HsslamError:  # plugin files are broken, which was told
        known = []
    for name in known:
        info = catalogue.describe(name)
        if info.kind == "unavailable":
            yield Finding(f"dataset {name}", "broken", info.description, catalogue.remedy(name))
    for name in catalogue.REAL:
        try:
            yield Finding(f"dataset {name}", "ok", str(catalogue.find_log(name, data_dir)))
        except DataError:
            remedy = catalogue.fetch_command(name, data_dir)
            yield Finding(f"dataset {name}", "missing", "not fetched", remedy)


def _output() -> Finding:
    """Runs go below the current folder where no --out is given."""
    here = Path.cwd()
    try:
        with tempfile.NamedTemporaryFile(dir=here, prefix=".hsslam-"):
            pass
    except OSError as error:
        detail = f"{here} cannot be written: {error.strerror}"
        return Finding("output", "broken", detail, "cd to a folder of yours, or give --out")
    return Finding("output", "ok", f"runs/ below {here}")
