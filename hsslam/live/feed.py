"""What a run tells, turned into a map that grows before one's eyes."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType
from typing import ParamSpec

from hsslam.live.growth import Growth
from hsslam.live.link import Link
from hsslam.live.viewers import AUTO, choose
from hsslam.scan import LaserScan
from hsslam.slam.events import Event, Optimised
from hsslam.slam.pipeline import Slam

P = ParamSpec("P")

EVERY = 0.2
"""The map is shown anew after this time at the earliest (s)."""

SHARE = 0.05
"""And so seldom that a run spends no more than about this part of its time on it."""

PATIENCE = 30.0
"""How long a run's end waits for the viewer to have shown it (s)."""


def _complain(line: str) -> None:
    print(f"hsslam: {line}", file=sys.stderr)


class LiveMap:
    """Shows the map of a run while it grows.

    A viewer that cannot be opened, is closed or fails costs a line of text, not the run; nothing that it does
    changes a result. Use it as a context; its end shows the final map. A window stays until it is closed, also
    when the program that opened it has ended.

    Parameters
    ----------
    slam : Slam
        The run.
    viewer : str or None
        ``auto``, ``rerun`` or ``matplotlib`` (`VIEWERS`); None shows nothing.
    recording : path, optional
        Where rerun records to if there is no display.
    title : str
        Over the map.
    say : callable
        Told, in a line, what the user should know; prints to stderr where left out.

    Raises
    ------
    ConfigError, UnavailableError
        No viewer has this name, or what it needs is not installed.
    """

    def __init__(
        self,
        slam: Slam,
        viewer: str | None = AUTO,
        *,
        recording: Path | str | None = None,
        title: str = "hsslam",
        say: Callable[[str], None] = _complain,
    ) -> None:
        self.seconds = 0.0
        self._slam: Slam | None = slam
        self._say = say
        self._growth = Growth()
        self._link: Link | None = None
        self._next = 0.0
        if viewer is None:
            return
        choice = choose(viewer, Path(recording) if recording is not None else None)
        if choice.remark:
            say(f"live map: {choice.remark}")
        if choice.viewer is not None:
            self._guard(self._open, choice.viewer, title, choice.recording)

    def __enter__(self) -> LiveMap:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._guard(self._finish)
        elif self._link is not None:
            self._link.abandon()
        # What follows may need the memory of the run.
        self._slam, self._link, self._growth = None, None, Growth()

    def update(self, events: Iterable[Event], scan: LaserScan | None = None) -> None:
        """Take in what `Slam.process` or `Slam.finish` gave, and show it if it is time to.

        Parameters
        ----------
        events : iterable of Event
            What happened; iterated to its end.
        scan : LaserScan, optional
            The scan that was processed.
        """
        for event in events:
            if self._link is None:
                continue  # the events are to be had all the same: `Slam.finish` works as they are asked for
            self._guard(self._growth.add, (event,), scan)
            if isinstance(event, Optimised):
                self._guard(self._show)
        if self._link is not None and time.monotonic() >= self._next:
            self._guard(self._show)

    def _open(self, viewer: str, title: str, recording: Path | None) -> None:
        self._link = Link(viewer, title, str(recording.absolute()) if recording is not None else "")

    def _show(self) -> None:
        link, slam = self._link, self._slam
        if link is None or slam is None:
            return
        if fault := link.fault:
            self._drop(fault)
            return
        started = time.monotonic()
        if link.ready:
            link.send(self._growth.snapshot(slam.keyframe_poses))
        now = time.monotonic()
        self._next = now + max(EVERY, (now - started) / SHARE)

    def _finish(self) -> None:
        link, slam = self._link, self._slam
        if link is None or slam is None:
            return
        link.send(self._growth.snapshot(slam.keyframe_poses, final=True))
        if fault := link.finish(PATIENCE):
            self._drop(fault)

    def _guard(self, step: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Do something for the viewer's sake; what goes wrong turns the viewer off and is told."""
        started = time.perf_counter()
        try:
            step(*args, **kwargs)
        except Exception as error:  # whatever it is, it is not worth a run
            self._drop(f"{type(error).__name__}: {error}")
        self.seconds += time.perf_counter() - started

    def _drop(self, fault: str) -> None:
        if self._link is not None:
            self._link.abandon()
        self._link = None
        self._say(f"live map: {fault}; the run goes on without it")
