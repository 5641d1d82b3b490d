"""Work that falls into parts, on as many cores as there are."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from hsslam.environment import cores
from hsslam.matching.interface import Matcher

PartT = TypeVar("PartT")

MOST = 4
"""Threads, at most: what they do in the interpreter, one after the other, is more than a fifth of the work."""

STRETCH = 8
"""Parts that a thread takes at a time."""


def threads_for(matcher: Matcher[Any], wanted: int) -> int:
    """How many threads to match with: ``wanted``, or where it is 0 one for each core that may be used, up to `MOST`.

    One, where the matcher holds the interpreter's lock: threads would only wait for one another.
    """
    if not matcher.side_by_side:
        return 1
    return wanted or min(cores(), MOST)


def side_by_side(work: Callable[[int], PartT], count: int, threads: int) -> list[PartT]:
    """What ``work`` makes of the numbers from 0 to ``count - 1``, in their order, whichever thread did it when.

    An error in one of them ends the others, and is raised.
    """
    # To take from it is one step of the interpreter, which no other thread can come in between.
    waiting = deque(range(0, count, STRETCH))
    done: dict[int, list[PartT]] = {}

    def work_off() -> None:
        try:
            while True:
                try:
                    begin = waiting.popleft()
                except IndexError:
                    return
                done[begin] = [work(i) for i in range(begin, min(begin + STRETCH, count))]
        finally:
            waiting.clear()

    # The calling thread works, too: every other one costs memory of its own.
    with ThreadPoolExecutor(max(threads - 1, 1)) as pool:
        helpers = [pool.submit(work_off) for _ in range(threads - 1)]
        work_off()
    for helper in helpers:
        helper.result()
    return [part for begin in sorted(done) for part in done[begin]]
