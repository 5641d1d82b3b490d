"""Progress on stderr: a bar with rate and time left on a terminal, a plain line now and then elsewhere."""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Timer
from typing import Any, TextIO

from hsslam.cli import interrupt

COMPILING = "compiling kernels (first run only)"


class Progress(ABC):
    """How far something is; make one with `progress`. Ctrl-C takes effect where progress is told."""

    def stage(self, what: str, total: float | None = None, unit: str = "") -> None:
        """Begin something new: what it is, how many steps it takes (None: not known), what a step is."""
        interrupt.check()
        self._stage(what, total, unit)

    def update(self, done: float, note: str = "") -> None:
        """Tell how many steps are done."""
        interrupt.check()
        self._update(done, note)

    @abstractmethod
    def _stage(self, what: str, total: float | None, unit: str) -> None: ...

    @abstractmethod
    def _update(self, done: float, note: str) -> None: ...

    @abstractmethod
    def compiling(self, begins: bool) -> None:
        """Tell that the compiler begins or ends, which may hold everything up for seconds."""


class Silence(Progress):
    """Shows nothing."""

    def _stage(self, what: str, total: float | None, unit: str) -> None:
        pass

    def _update(self, done: float, note: str) -> None:
        pass

    def compiling(self, begins: bool) -> None:
        """Show nothing."""


class Lines(Progress):
    """A plain line for whatever takes over a second, and one every few seconds after."""

    def __init__(self, stream: TextIO, every: float = 5.0, patience: float = 1.0) -> None:
        self._stream = stream
        self._every = every
        self._patience = patience
        self._announcement: Timer | None = None
        self._told_of_compiling = False
        self._what, self._unit = "", ""
        self._total: float | None = None
        self._compiling_since: float | None = None
        self._started = self._printed = time.monotonic()

    def _stage(self, what: str, total: float | None, unit: str) -> None:
        self.close()
        self._announcement = Timer(self._patience, self._print, (f"{what} ...",))
        self._announcement.daemon = True
        self._announcement.start()
        self._what, self._total, self._unit = what, total, unit
        self._started = self._printed = time.monotonic()

    def _update(self, done: float, note: str) -> None:
        now = time.monotonic()
        if now - self._printed < self._every:
            return
        self._printed = now
        rate = done / max(now - self._started, 1e-3)
        line = f"{self._what}: {done:,.0f}"
        if self._total is not None:
            line += f" of {self._total:,.0f}"
        line += f"{' ' if self._unit else ''}{self._unit}, {rate:,.1f}/s"
        if self._total is not None and rate > 0.0:
            line += f", {_clock((self._total - done) / rate)} left"
        self._print(line + (f", {note}" if note else ""))

    def compiling(self, begins: bool) -> None:
        """Print that, once; what it takes is left out of the rate, and of the time left."""
        if begins and self._compiling_since is None:
            self._compiling_since = time.monotonic()
        elif not begins and self._compiling_since is not None:
            self._started += time.monotonic() - self._compiling_since
            self._compiling_since = None
        if begins and not self._told_of_compiling:
            self._told_of_compiling = True
            self._print(COMPILING)

    def close(self) -> None:
        """Announce nothing any more."""
        if self._announcement is not None:
            self._announcement.cancel()

    def _print(self, line: str) -> None:
        print(line, file=self._stream, flush=True)


class Bars(Progress):
    """A rich bar, gone when it is done."""

    def __init__(self, bars: Any) -> None:
        self._bars = bars
        self._task: Any = None
        self._what = ""

    def _stage(self, what: str, total: float | None, unit: str) -> None:
        if self._task is not None:
            self._bars.remove_task(self._task)
        self._what = what
        self._task = self._bars.add_task(what, total=total, unit=unit, note="")

    def _update(self, done: float, note: str) -> None:
        self._bars.update(self._task, completed=done, note=note)

    def compiling(self, begins: bool) -> None:
        """Say so in front of the bar as long as it lasts."""
        if self._task is not None:
            self._bars.update(self._task, description=COMPILING if begins else self._what)


@contextmanager
def progress(quiet: bool = False) -> Iterator[Progress]:
    """Show progress while the block runs: bars, lines or, if ``quiet``, nothing."""
    if quiet:
        yield Silence()
        return
    if not sys.stderr.isatty():
        lines = Lines(sys.stderr)
        try:
            yield lines
        finally:
            lines.close()
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        ProgressColumn,
        SpinnerColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as RichProgress
    from rich.text import Text

    class Count(ProgressColumn):
        def render(self, task: Task) -> Text:
            if task.total is not None:
                return Text(f"{task.completed:,.0f}/{task.total:,.0f}")
            return Text(f"{task.completed:,.0f}" if task.completed else "")

    class Rate(ProgressColumn):
        def render(self, task: Task) -> Text:
            speed = task.finished_speed or task.speed
            return Text("" if speed is None else f"{speed:,.0f} {task.fields['unit']}/s")

    with RichProgress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=30),
        Count(),
        Rate(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}", markup=False),
        console=Console(stderr=True),
        transient=True,
    ) as bars:
        yield Bars(bars)


@contextmanager
def watch_compiler(shown: Progress, ahead: bool = False) -> Iterator[None]:
    """Tell ``shown`` when numba compiles while the block runs: kernels come from its cache after the first run.

    With ``ahead`` all kernels of a run are compiled, side by side, when the first of them is to be.
    """
    from hsslam import jit
    from hsslam.ahead import KERNELS, compile_ahead

    waiting = set(KERNELS) if ahead else set()

    def before(name: str) -> None:
        if name in waiting:
            waiting.clear()
            compile_ahead()

    with jit.watch_compiler(shown.compiling, before):
        yield


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
