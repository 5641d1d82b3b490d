"""How well a pose graph knows two keyframes relative to one another: along the path that knows it best."""

from __future__ import annotations

import heapq
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Poses

MOST_LINKS = 12
"""Links of a keyframe; once it has so many, paths lead from it to no later keyframe but the next.

Where a robot comes by every day, an old keyframe is tied to ever more new ones, and each path through it would look at
all. To leave some out can only make what is known seem less known.
"""

_ROOM = 4096

_Number = TypeVar("_Number", np.int64, np.float64)


class RelativeUncertainty:
    """Variances of earlier keyframes seen from the newest one, from the constraints between them.

    The true covariance is never larger than that along any one path of constraints, so the path along which it
    is smallest bounds it (the Dijkstra projection of Bosse et al., "Simultaneous localization and map building
    in large-scale cyclic environments using the Atlas framework", 2004), at a small part of the cost of
    inverting the information matrix.
    """

    def __init__(self) -> None:
        self._first_link = np.full(_ROOM, -1, dtype=np.int64)
        self._links = np.empty((_ROOM, 2), dtype=np.int64)
        self._variances = np.empty((_ROOM, 2))
        self._degrees = np.zeros(_ROOM, dtype=np.int64)
        self._count = 0
        self._search = _Scratch(_ROOM)

    def add(self, first: int, second: int, variance_xy: float, variance_theta: float) -> None:
        """Add a constraint between two keyframes: variances of its position (m^2) and heading (rad^2)."""
        self._first_link = _with_room(self._first_link, max(first, second) + 1, -1)
        self._links = _with_room(self._links, self._count + 2, -1)
        self._variances = _with_room(self._variances, self._count + 2, 0)
        self._degrees = _with_room(self._degrees, max(first, second) + 1, 0)
        for here, there in ((first, second), (second, first)):
            if here < there - 1 and self._degrees[here] >= MOST_LINKS:
                continue
            self._degrees[here] += 1
            self._links[self._count] = there, self._first_link[here]
            self._variances[self._count] = variance_xy, variance_theta
            self._first_link[here] = self._count
            self._count += 1

    def seen_from(self, newest: int, targets: NDArray[np.int64], poses: Poses) -> NDArray[np.float64]:
        """Variances of position and heading of keyframes seen from the newest one.

        Parameters
        ----------
        newest : int
            The keyframe that looks.
        targets : int64 (T,)
            The keyframes it looks at; near to it, so that a heading's error on the way moves them as it moves it.
        poses : Poses
            (K, 3) of all keyframes.

        Returns
        -------
        float64 (T, 2)
            m^2 and rad^2; infinite where no path leads.
        """
        if len(self._search.best) < len(poses):
            self._search = _Scratch(len(self._first_link))
        search = self._search
        search.number += 1
        return least_variances(
            self._first_link,
            self._links,
            self._variances,
            newest,
            targets,
            poses,
            search.best,
            search.heading,
            search.marks,
            search.number,
        )


class _Scratch:
    """What a search writes on: kept, for to clear it would cost more than the search, once keyframes are many."""

    def __init__(self, size: int) -> None:
        self.best = np.empty(size)
        self.heading = np.empty(size)
        self.marks = np.zeros((size, 3), dtype=np.int64)
        self.number = 0


@kernel
def least_variances(
    first_link: NDArray[np.int64],
    links: NDArray[np.int64],
    variances: NDArray[np.float64],
    newest: int,
    targets: NDArray[np.int64],
    poses: Poses,
    best: NDArray[np.float64],
    heading: NDArray[np.float64],
    marks: NDArray[np.int64],
    number: int,
) -> NDArray[np.float64]:
    """Sums of variances along the shortest paths from ``newest`` to ``targets``, (T, 2); Dijkstra's algorithm.

    The length of a link is the position variance that it adds at ``newest``: its own, and that of its heading
    times the squared distance. The search ends when every target is reached. ``best``, ``heading`` and ``marks``
    (seen, done, wanted) hold anything at first, but no mark that equals ``number``.
    """
    left = 0
    for k in range(len(targets)):
        if marks[targets[k], 2] != number:
            marks[targets[k], 2] = number
            left += 1
    best[newest], heading[newest] = 0.0, 0.0
    marks[newest, 0] = number
    heap = [(0.0, newest)]
    while len(heap) > 0 and left > 0:
        cost, here = heapq.heappop(heap)
        if marks[here, 1] == number:
            continue
        marks[here, 1] = number
        if marks[here, 2] == number:
            left -= 1
        dx, dy = poses[here, 0] - poses[newest, 0], poses[here, 1] - poses[newest, 1]
        squared = dx * dx + dy * dy
        link = first_link[here]
        while link >= 0:
            there = links[link, 0]
            reached = cost + variances[link, 0] + variances[link, 1] * squared
            if marks[there, 0] != number or reached < best[there]:
                marks[there, 0] = number
                best[there] = reached
                heading[there] = heading[here] + variances[link, 1]
                heapq.heappush(heap, (reached, there))
            link = links[link, 1]
    out = np.full((len(targets), 2), np.inf)
    for k in range(len(targets)):
        if marks[targets[k], 0] == number:
            out[k, 0], out[k, 1] = best[targets[k]], heading[targets[k]]
    return out


def _with_room(array: NDArray[_Number], size: int, fill: int) -> NDArray[_Number]:
    if size <= len(array):
        return array
    return np.concatenate((array, np.full_like(array, fill)))
