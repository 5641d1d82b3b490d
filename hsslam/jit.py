"""The one way hsslam compiles a kernel."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

import numba
from numba.core import event

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile a function of plain arrays and scalars, and cache the result on disk.

    Numba's decorator has no types, so under ``mypy --strict`` it would erase those of the kernel; this keeps
    them. Division follows NumPy (no exception), and the kernel releases the interpreter lock, so that threads
    may match side by side. Nobody calls it from C, for which numba would compile a second entry (5 % of the time).
    """
    options = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
    try:
        return cast(_F, numba.njit(cache=True, **options)(function))
    except RuntimeError:  # no folder that a cache could lie in; `hsslam doctor` tells what mends that
        return cast(_F, numba.njit(**options)(function))


@contextmanager
def watch_compiler(
    tell: Callable[[bool], None], before: Callable[[str], None] = lambda name: None
) -> Iterator[None]:
    """Call ``tell`` with True where numba begins to compile while the block runs, and with False where it ends.

    ``before`` gets the name (``module.function``) of a kernel that numba would leave in its cache, before it is
    compiled; what it leaves in the cache is used for the kernels that the kernel calls.
    """

    class Listener(event.Listener):  # type: ignore[misc]
        depth = 0  # a kernel compiles the kernels it calls

        def on_start(self, event: Any) -> None:
            self.depth += 1
            if self.depth == 1:
                tell(True)
                function = event.data["dispatcher"]
                if function.stats.cache_path:
                    before(f"{function.py_func.__module__}.{function.py_func.__name__}")

        def on_end(self, event: Any) -> None:
            self.depth -= 1
            if self.depth == 0:
                tell(False)

    listener = Listener()
    event.register("numba:compile", listener)
    try:
        yield
    finally:
        event.unregister("numba:compile", listener)
