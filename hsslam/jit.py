"""The one way hsslam compiles a kernel."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile a function of plain arrays and scalars, and cache the result on disk.

    Numba's decorator has no types, so under ``mypy --strict`` it would erase those of the kernel; this keeps
    them. Division follows NumPy (no exception), and the kernel releases the interpreter lock, so that threads
    may match side by side.
    """
    options = {"error_model": "numpy", "nogil": True}
    try:
        return cast(_F, numba.njit(cache=True, **options)(function))
    except RuntimeError:  # no folder that a cache could lie in; `hsslam doctor` tells what mends that
        return cast(_F, numba.njit(**options)(function))
