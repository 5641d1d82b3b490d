"""What a result was computed with: versions, processor, system."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from hsslam import plugin_files
from hsslam.version import __version__

_PACKAGES = ("numpy", "numba", "scipy", "gtsam", "pydantic", "matplotlib", "kiss-icp", "open3d", "open3d-cpu")

_GROUPS = ("hsslam.matchers", "hsslam.fitness", "hsslam.readers", "hsslam.datasets")


def environment() -> dict[str, Any]:
    """Describe this machine and installation; imports nothing of what it reports.

    Returns
    -------
    dict
        ``hsslam``, ``python``, ``packages`` (name to version, of those installed), ``plugins`` (packages that
        extend hsslam, name to version; files of plugins, name to sha256 sum), ``cpu`` (model), ``cores`` (that
        this process may use), ``system``, ``machine``; JSON types only.
    """
    return {
        "hsslam": __version__,
        "python": platform.python_version(),
        "packages": _versions(),
        "plugins": _plugins(),
        "cpu": cpu_model(),
        "cores": cores(),
        "system": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
    }


def cpu_model() -> str:
    """Name of the processor; the architecture where the system does not tell."""
    if sys.platform == "darwin":
        asked = subprocess.run(
            ["sysctl", "-n", "machdep.cpu.brand_string"], capture_output=True, text=True, check=False
        )
        return asked.stdout.strip() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def cores() -> int:
    """How many cores this process may use."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _versions() -> dict[str, str]:
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _plugins() -> dict[str, str]:
    declared = [entry.dist for group in _GROUPS for entry in metadata.entry_points(group=group)]
    packages = {dist.name: dist.version for dist in declared if dist is not None and dist.name != "hsslam"}
    return {**dict(sorted(packages.items())), **plugin_files.fingerprints()}


def peak_memory_mb() -> float:
    """Largest resident memory of this process so far (10^6 bytes)."""
    if sys.platform == "linux":
        # getrusage keeps the peak of the process that started this one; the kernel's own mark begins afresh.
        for line in Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines():
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) * 1024.0 / 1e6
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024.0 / 1e6
