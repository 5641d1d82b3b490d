"""Compiles the kernels of a run before it begins, side by side: the first run of an installation waits for numba.

Each process compiles some and leaves them in numba's cache, from which the run takes them. What the compiler
holds on to (a megabyte for every function) goes with the processes.
"""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import IO

from hsslam.environment import cores

MOST_PROCESSES = 4
"""More gain little: what the longest kernels call is compiled one after the other."""

KERNELS = {
    "hsslam.search.batch.settle_all": (
        "float64[:,::1], float64[:,::1], uint32[:,::1], float64[::1], uint8[:,::1], float64[::1], "
        "float64[:,::1], float64[:,::1], int64[::1], float64[:,::1], float64[:,::1], float64[::1], "
        "int64, float64, float64"
    ),
    "hsslam.slam.overlap.nearest_apart": ("float64[:,::1], int64[::1], int64[::1], float64, int64, int64"),
    "hsslam.kernels.correlative.best_of_lattice": (
        "uint8[:,:,::1], int64[::1], int64[::1], float64[::1], float32[::1], float32[::1], "
        "float64[::1], int64[::1], float64, int64, int64"
    ),
    "hsslam.search.hide.hide_search_all": (
        "uint8[:,::1], float64[::1], float64[:,::1], float64[:,::1], int64[::1], float64[:,::1], "
        "int64, float64[::1], int64, float64, UniTuple(float64, 2), float64[::1], float64[::1], "
        "int64, int64, float64, float64, float64, int64, int64[::1]"
    ),
    "hsslam.se2.wrap": "float64",
    "hsslam.se2.compose": "float64[::1], float64[::1]",
    "hsslam.se2.inverse": "float64[::1]",
    "hsslam.se2.between": "float64[::1], float64[::1]",
    "hsslam.se2.transform": "float64[::1], float64[:,::1]",
    "hsslam.se2.compose_many": "float64[:,::1], float64[:,::1]",
    "hsslam.se2.inverse_many": "float64[:,::1]",
    "hsslam.se2.between_many": "float64[:,::1], float64[:,::1]",
    "hsslam.kernels.joints.widths_of": "float64[:,::1], boolean[::1]",
    "hsslam.kernels.surface.all_finite": "float64[:,::1]",
    "hsslam.kernels.surface.bounds": "float64[:,::1]",
    "hsslam.kernels.surface.join": "float64[:,::1], float64, float64",
    "hsslam.kernels.surface.scan_lines": "float64[:,::1]",
    "hsslam.kernels.surface.rasterise_nearest": "float64[:,::1], float64, float64",
    "hsslam.kernels.surface.add_nearest": "float64[:,::1], int64, uint32[:,::1], float64[::1], float64",
    "hsslam.kernels.assess.measure": (
        "float64[:,::1], float64[:,::1], uint32[:,::1], float64[::1], float64[:,::1], float64[:,::1], "
        "float64[::1], float64[::1], float64"
    ),
    "hsslam.kernels.assess.explained": (
        "float64[:,::1], uint32[:,::1], float64[::1], float64[:,::1], float64[:,::1], float64[::1], float64"
    ),
    "hsslam.scan._returns": "float64[::1], float64[::1], float64[::1], float64, float64",
    "hsslam.slam.fusion.rotated": "float64[:,::1], float64",
    "hsslam.slam.fusion.squared_mahalanobis": "float64[::1], float64[:,::1]",
    "hsslam.slam.fusion.fuse": "float64[::1], float64[:,::1], float64[::1], float64[:,::1]",
    "hsslam.slam.fusion.is_positive_definite": "float64[:,::1]",
    "hsslam.slam.near.insert": "int64[::1], int64[::1], float64[:,::1], int64",
    "hsslam.slam.near.alike": "int64[::1], int64[::1], float64[:,::1], float64[::1]",
    "hsslam.slam.near.around": "int64[::1], int64[::1], float64[:,::1], float64[::1], int64, float64, int64",
    "hsslam.slam.uncertainty.least_variances": (
        "int64[::1], int64[:,::1], float64[:,::1], int64, int64[::1], float64[:,::1], float64[::1], "
        "float64[::1], int64[:,::1], int64"
    ),
    "hsslam.kernels.free_space.mark": (
        "uint8[:,::1], float64[::1], float64[:,::1], float64[::1], float64[::1]"
    ),
    "hsslam.kernels.free_space.in_free_space": "uint8[:,::1], float64[::1], float64[:,::1], float64[::1]",
    "hsslam.kernels.free_space.unseen": "uint8[:,::1], float64[::1], float64[:,::1], float64[::1]",
    "hsslam.kernels.raster.counts_sides": "float64[::1]",
    "hsslam.kernels.raster.marks_of": "float64[:,::1]",
    "hsslam.kernels.raster.blank": "float64[:,::1], float64, float64, float64",
    "hsslam.kernels.raster.stamp_field": "float64[:,::1], float64[::1], uint8[:,::1], float64, float64",
    "hsslam.kernels.raster.rasterise_squares": "float64[:,::1], uint8[::1], float64, float64",
    "hsslam.kernels.raster.stamp_squares": "float64[:,::1], uint8[::1], float64[::1], uint8[:,::1], float64",
    "hsslam.kernels.fitness.scale": "float64[:,::1], float64[:,::1], float64[::1], int64",
    "hsslam.search.slide.weak_direction": "float64[:,::1]",
    "hsslam.search.settle.settle": (
        "float64[:,::1], uint32[:,::1], float64[::1], uint8[:,::1], float64[::1], float64[:,::1], "
        "float64[:,::1], float64[::1], float64[::1], float64[::1], int64, float64"
    ),
    "hsslam.search.batch.lines_of_all": "float64[:,::1], int64[::1]",
    "hsslam.search.hide.hide_search": (
        "uint8[:,::1], float64[::1], float32[:,::1], int64, float64[::1], float64[::1], int64, "
        "float64, UniTuple(float64, 2), float64[::1], float64[::1], int64, int64, float64, float64, "
        "float64, int64, int64, float64[:,::1]"
    ),
    "hsslam.kernels.correlative.pool": "uint8[:,::1], int64[::1]",
    "hsslam.kernels.own_parts.watch": "float64[:,::1], float64[:,::1], float64[::1]",
    "hsslam.kernels.own_parts.ranges_of_parts": "float64[:,::1]",
    "hsslam.mapping.traversal.reach_of": (
        "float64[:,::1], float64[:,::1], float64[:,::1], float64[::1], float64[::1], float64, "
        "float64, float64, float64"
    ),
    "hsslam.mapping.traversal.count": (
        "int32[:,::1], int32[:,::1], int32[:,::1], int64, int64, float64, int64, int64, "
        "float64[:,::1], float64[:,::1], float64[:,::1], float64[::1], float64[::1], float64, "
        "float64, float64, float64"
    ),
}
"""Arguments of the kernels that a run with default settings calls, as numba writes types; the longest first."""


def compile_ahead() -> None:
    """Compile all of them into numba's cache, in processes side by side.

    What fails, for whatever reason, is left to be compiled when it is called.
    """
    names: SimpleQueue[str] = SimpleQueue()
    for name in KERNELS:
        names.put(name)
    count = min(cores(), MOST_PROCESSES)
    with ThreadPoolExecutor(count) as threads:
        for _ in range(count):
            threads.submit(_feed, names)


def _feed(names: SimpleQueue[str]) -> None:
    """Give names to a process, the next where it has done the one before."""
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "hsslam.ahead"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        bufsize=1,
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            while True:
                process.stdin.write(names.get_nowait() + "\n")
                if not process.stdout.readline():
                    return
        except (Empty, BrokenPipeError):
            return


def compile_some(names: IO[str], done: IO[str]) -> None:
    """Compile the kernels whose names come, a line each, and answer with a line when each is done."""
    from numba.core import sigutils

    for line in names:
        module, _, name = line.strip().rpartition(".")
        arguments, _ = sigutils.normalize_signature(f"({KERNELS[line.strip()]},)")
        # Types, not text: numba keeps what it compiles under what it was given.
        getattr(import_module(module), name).compile(arguments)
        print(name, file=done, flush=True)


if __name__ == "__main__":
    compile_some(sys.stdin, sys.stdout)
