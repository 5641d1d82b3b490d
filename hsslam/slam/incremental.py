"""iSAM2 over the newest keyframes: loops move those; what is older stands, unless a loop says that it must not."""

from __future__ import annotations

from typing import Any

import gtsam
import numpy as np

from hsslam.se2 import Pose, Poses
from hsslam.slam.events import Edge
from hsslam.slam.factors import GraphError, between_factor, pose2, prior_factor, pull_factor

ACTIVE = 500
"""Keyframes that a loop may move, at least; with twice as many the older half is frozen.

iSAM2 touches every pose that it knows whenever it is asked, so what it knows must be bounded if the work per scan
is to be.
"""


class Incremental:
    """The estimate while a run goes on.

    Parameters
    ----------
    start : Pose
        Of keyframe 0.
    robust_scale : float or None
        Of the loss on loops; None for squares.
    """

    def __init__(self, start: Pose, robust_scale: float | None) -> None:
        self._start = start
        self._robust_scale = robust_scale
        self._edges: list[Edge] = []
        self._waiting = 0
        self._thaws = False
        self._first = 0
        """The first keyframe that is not frozen."""
        self._known = 0
        """Keyframes that iSAM2 knows, the frozen among them."""
        self._isam = _isam()

    def add(self, edge: Edge, *, reaches_back: bool = False) -> None:
        """Add a constraint; it counts from the next `solve` on, which sets all keyframes free if it reaches back."""
        self._edges.append(edge)
        self._waiting += 1
        self._thaws = self._thaws or reaches_back

    def solve(self, poses: Poses) -> None:
        """Bring ``poses`` (K, 3), of all keyframes, up to date in place.

        Raises
        ------
        GraphError
            The solution is not finite, or constraints leave a pose open.
        """
        news = self._edges[len(self._edges) - self._waiting :]
        frozen = len(poses) - ACTIVE if len(poses) - self._first > 2 * ACTIVE else self._first
        if self._thaws:
            frozen = 0
        if frozen != self._first:
            self._isam, self._first, self._known = _isam(), frozen, frozen
            news = self._edges
        try:
            self._isam.update(self._factors(news, poses), self._values(poses))
        except RuntimeError:
            self._start_over(poses)
        self._waiting, self._thaws, self._known = 0, False, len(poses)
        solution = gtsam.utilities.extractPose2(self._isam.calculateEstimate())  # in the order of their keys
        if not np.isfinite(solution).all():
            raise GraphError(
                "the pose graph's solution is not finite; a constraint or its covariance is unusable"
            )
        poses[self._first :] = solution

    def _start_over(self, poses: Poses) -> None:
        """Solve all anew by QR: iSAM2's usual factors lose digits where a loop pulls far, and it then gives up."""
        self._isam, self._known = _isam("QR"), self._first
        try:
            self._isam.update(self._factors(self._edges, poses), self._values(poses))
        except RuntimeError as error:
            raise GraphError(f"the constraints do not fix every pose: {error}") from error

    def _factors(self, edges: list[Edge], poses: Poses) -> Any:
        graph = gtsam.NonlinearFactorGraph()
        if self._known == 0:
            graph.add(prior_factor(self._start))
        for edge in edges:
            if edge.second < self._first:
                continue
            if edge.first >= self._first:
                graph.add(between_factor(edge, self._robust_scale))
            else:
                graph.add(pull_factor(edge, poses[edge.first], self._robust_scale))
        return graph

    def _values(self, poses: Poses) -> Any:
        values = gtsam.Values()
        for key in range(self._known, len(poses)):
            values.insert(key, pose2(poses[key]))
        return values


def _isam(factorisation: str = "CHOLESKY") -> Any:
    params = gtsam.ISAM2Params()
    params.setFactorization(factorisation)
    params.relinearizeSkip = 1  # updates are rare: only loops cause them, and a loop moves a lot
    return gtsam.ISAM2(params)
