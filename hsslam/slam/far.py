"""Places that may be metres away from where they are thought to be: every pose of a lattice is looked at.

After a long way round, a window as wide as the graph is unsure is more than any matcher was made for. A coarse
raster of the place, searched by branch and bound, tells where in it the matcher should look.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.matching.interface import SearchWindow
from hsslam.se2 import Points, Pose, wrap
from hsslam.search.exhaustive import ExhaustiveReference, lattice_search
from hsslam.search.fitness import HitFitness

CELL = 0.1
"""Side of a raster cell, step of the search, and standard deviation of the likelihood around a surface (m)."""

RANGE = 30.0
"""Points farther from the robot than this (m) take no part: a turn moves them over too many cells."""

MOST_POINTS = 120
"""Points of the scan that are looked at, spread over it."""

BUDGET = 200_000
"""Blocks and poses looked at, at most: where so many seem as good, none of them is the answer."""

NEAR = SearchWindow(0.5, 0.5, math.radians(5.0))
"""Where the matcher looks, around an answer of the coarse search; so wide that a direction that is open shows."""


class FarSearch:
    """The coarse raster of a place.

    Parameters
    ----------
    points : Points
        (N, 2) m, in the frame of the place.
    """

    def __init__(self, points: Points) -> None:
        self._reference = ExhaustiveReference(_in_range(points), "likelihood", CELL, CELL)

    def best(self, points: Points, guess: Pose, window: SearchWindow) -> Pose:
        """The pose of a window around ``guess`` where the (N, 2) points of a scan fit best, to within a cell."""
        return self.look(points, guess, window)[0]

    def look(
        self, points: Points, guess: Pose, window: SearchWindow, least: float = 0.0
    ) -> tuple[Pose, float]:
        """As `best`, and how well they fit there, in [0, 1]: the guess and 0 if nowhere as well as ``least``."""
        points = _in_range(points)
        if len(points) == 0 or len(self._reference.points) == 0:
            return guess.copy(), 0.0
        fitness = HitFitness.of(self._reference.raster, points, MOST_POINTS)
        found = lattice_search(self._reference, fitness, guess, window, BUDGET, least)
        pose = found.pose.copy()
        pose[2] = wrap(pose[2])
        return pose, found.fitness

    def elsewhere(
        self, points: Points, answer: Pose, window: SearchWindow, apart: SearchWindow
    ) -> list[Pose]:
        """The best pose on each side of an answer, where a window around it reaches that far.

        Parameters
        ----------
        points : Points
            (N, 2) m of the scan.
        answer : Pose
            In the frame of the place.
        window : SearchWindow
            What is searched around it.
        apart : SearchWindow
            Poses outside of this are other answers.
        """
        boxes = _around(window.half, apart.half)
        return [
            self.best(points, answer + 0.5 * (low + high), SearchWindow(*(0.5 * (high - low))))
            for low, high in boxes
        ]


def _in_range(points: Points) -> Points:
    return points[np.hypot(points[:, 0], points[:, 1]) <= RANGE]


def _around(
    outer: NDArray[np.float64], inner: NDArray[np.float64]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Lowest and highest corners of boxes that fill the outer box but for the inner one, both around the origin."""
    boxes = []
    low, high = -outer, outer.copy()
    # Of what earlier axes have left, the two ends along each axis.
    for axis in range(3):
        if outer[axis] > inner[axis]:
            below, above = high.copy(), low.copy()
            below[axis], above[axis] = -inner[axis], inner[axis]
            boxes += [(low.copy(), below), (above, high.copy())]
            low[axis], high[axis] = -inner[axis], inner[axis]
    return boxes
