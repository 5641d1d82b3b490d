"""Kernels that are compiled before a run: which, and that the run takes them from numba's cache."""

from __future__ import annotations

import inspect
import json
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from hsslam.ahead import KERNELS

DRIVE = """
from hsslam import Config, Slam, open_dataset
Slam(Config()).solve(open_dataset("office", scans=400).scans())
"""

LIST = """
import json, sys
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
from hsslam.ahead import KERNELS
known = {name: normalize_signature(f"({types},)")[0] for name, types in KERNELS.items()}
called = []
for module in [m for n, m in sorted(sys.modules.items()) if n.startswith("hsslam.")]:
    if module.__name__.startswith("hsslam.datasets"):
        continue  # the simulator's own
    for kernel in vars(module).values():
        if isinstance(kernel, CPUDispatcher) and kernel.py_func.__module__ == module.__name__:
            name = f"{module.__name__}.{kernel.py_func.__name__}"
            called += [[name, str(types), types == known.get(name)] for types in kernel.signatures]
print(json.dumps(called))
"""

TWO = """
import json
import hsslam.ahead
hsslam.ahead.KERNELS = {name: hsslam.ahead.KERNELS[name] for name in ("hsslam.se2.compose", "hsslam.se2.inverse")}
from hsslam.cli.progress import Silence, watch_compiler
from hsslam import se2
import numpy as np
pose = np.array([1.0, 2.0, 0.5])
with watch_compiler(Silence(), ahead=True):
    found = se2.compose(pose, se2.inverse(pose))
hits = [sum(kernel.stats.cache_hits.values()) for kernel in (se2.compose, se2.inverse)]
print(json.dumps([found.tolist(), hits]))
"""


def run(code: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", KERNELS)
def test_each_names_a_kernel_and_all_its_arguments(name: str) -> None:
    from numba.core.sigutils import normalize_signature

    module, _, function = name.rpartition(".")
    kernel = getattr(import_module(module), function)
    arguments, _ = normalize_signature(f"({KERNELS[name]},)")
    assert len(arguments) == len(inspect.signature(kernel.py_func).parameters)


def test_a_run_calls_none_but_these() -> None:
    """Run twice: what the first compiles the second has from the cache, so that only what Python calls is listed."""
    run("from hsslam.ahead import compile_ahead\ncompile_ahead()")
    run(DRIVE)
    called = json.loads(run(DRIVE + LIST))
    assert len(called) > 30
    missing = [f"{name}{types}" for name, types, known in called if not known]
    assert not missing, "add these to hsslam/ahead.py"


def test_a_kernel_is_taken_from_the_cache_once_all_were_compiled(tmp_path: Path) -> None:
    found, (composed, inverted) = json.loads(run(TWO, NUMBA_CACHE_DIR=str(tmp_path)))
    assert found == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert inverted == 0  # called first: it set the compiler off
    assert composed == 1
