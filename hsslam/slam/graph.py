"""Back end: the GTSAM pose graph of keyframes."""

from __future__ import annotations

import math
from typing import Any

import gtsam
import numpy as np
from numpy.typing import NDArray

from hsslam.config import GraphSection
from hsslam.se2 import Pose, Poses, between, compose, compose_many
from hsslam.slam.events import Edge
from hsslam.slam.factors import GraphError, between_factor, body_covariance, pose2, prior_factor
from hsslam.slam.fusion import rotated
from hsslam.slam.incremental import Incremental
from hsslam.slam.near import NearIndex
from hsslam.slam.uncertainty import RelativeUncertainty

NEXT_TO_NOTHING_XY = 0.02
NEXT_TO_NOTHING_THETA = math.radians(0.3)
"""A loop that disagrees with the estimate by less than this (m, rad) is left to the optimisation at the end.

A robot that drives the same rounds closes a loop at nearly every keyframe. Were they all in iSAM2, the work per scan
would grow with the log. An error that is still too small to matter grows until a loop shows it.
"""


REACHES_BACK_XY = 0.10
REACHES_BACK_THETA = math.radians(2.0)
REACHES_BACK_STD = 0.05
"""A loop that disagrees by more than this (m, rad) over a way that was not known to this deviation (m) moves all.

One that contradicts what the graph is sure of is more likely to be false than to be news of long ago.
"""


class PoseGraph:
    """Keyframe poses and the constraints between them.

    While a run goes on, iSAM2 keeps the estimate; constraints of kind ``odometry`` alone do not move earlier
    poses, so it is brought up to date only when something else was added.

    Parameters
    ----------
    config : GraphSection
        The robust loss and its scale.
    start : Pose
        Pose of keyframe 0.
    """

    def __init__(self, config: GraphSection, start: Pose) -> None:
        self._config = config
        self._start = start
        self.uncertainty = RelativeUncertainty()
        self._loop_waits = False
        self.edges: list[Edge] = []
        self._poses = np.empty((1024, 3))
        self._poses[0] = start
        self._count = 1
        self._robust_scale = config.robust_scale if config.robust != "none" else None
        self._incremental: Incremental | None = Incremental(start, self._robust_scale)
        self.near = NearIndex()
        self.near.add(start)

    def __len__(self) -> int:
        return self._count

    @property
    def poses(self) -> Poses:
        """(K, 3) current estimate; a view, not to be written to."""
        return self._poses[: self._count]

    def add_keyframe(self, relative: Pose, covariance: NDArray[np.float64]) -> None:
        """Append a keyframe, seen from the newest one."""
        newest = self._count - 1
        self._add(Edge(newest, newest + 1, relative, covariance, "odometry"))
        if self._count == len(self._poses):
            self._poses = np.concatenate((self._poses, np.empty_like(self._poses)))
        self._poses[self._count] = compose(self._poses[newest], relative)
        self._count += 1
        self.near.add(self._poses[self._count - 1])

    def move(self, moving: NDArray[np.bool_], motion: Pose) -> None:
        """Move some keyframes (K,) as one, by a pose in the axes of the map: where they lie was not known."""
        those = self.poses[moving]
        self.poses[moving] = compose_many(np.tile(motion, (len(those), 1)), those)
        self._incremental = None
        self.near.rebuild(self.poses)

    def add_edge(self, edge: Edge) -> None:
        """Add a constraint between two keyframes that exist, the earlier one first."""
        if not 0 <= edge.first < edge.second < self._count:
            raise GraphError(f"a constraint names keyframes {edge.first} and {edge.second}, of {self._count}")
        self._add(edge)

    @property
    def wants_update(self) -> bool:
        """Whether a loop that came since the last `update` changes the estimate enough to be worth one."""
        return self._loop_waits

    def update(self) -> None:
        """Bring the estimate up to date with iSAM2."""
        self._loop_waits = False
        if self._incremental is None:
            self._incremental = Incremental(self._start, self._robust_scale)
            for edge in self.edges:
                self._incremental.add(edge)
        self._incremental.solve(self.poses)
        self.near.rebuild(self.poses)

    def optimise(self, *, robust: bool = True) -> tuple[float, float, NDArray[np.bool_]]:
        """Optimise all poses at once (Levenberg-Marquardt; graduated non-convexity if the config asks for it).

        What iSAM2 keeps is let go: it knows neither these poses nor all constraints. An `update` that comes
        later starts it anew, from both.

        Returns
        -------
        (float, float, bool (E,))
            Nonlinear error before and after, and which of `edges` the solution does not believe.
        """
        self._incremental = None
        loss = self._config.robust if robust else "none"
        graph, values = self._problem(loss == "cauchy")
        before = graph.error(values)
        solution = self._solve(graph, values, loss)
        self._take(solution)
        return before, graph.error(solution), self._disbelieved()

    def marginal_covariances(self) -> NDArray[np.float64]:
        """Covariance of every keyframe's pose in the axes of the map, (K, 3, 3), all other poses being unknown.

        Raises
        ------
        GraphError
            The constraints leave a pose open.
        """
        graph, values = self._problem(self._config.robust == "cauchy")
        try:
            marginals = gtsam.Marginals(graph, values)
            found = [marginals.marginalCovariance(key) for key in range(self._count)]
        except RuntimeError as error:
            raise GraphError(f"the constraints do not fix every pose: {error}") from error
        # GTSAM speaks of the frame of the pose itself.
        return np.array(
            [rotated(c, -theta) for c, theta in zip(found, self.poses[:, 2], strict=True)]
        ).reshape(-1, 3, 3)

    def _problem(self, robust: bool) -> tuple[Any, Any]:
        graph = gtsam.NonlinearFactorGraph()
        graph.add(prior_factor(self._start))
        for edge in self.edges:
            graph.add(between_factor(edge, self._config.robust_scale if robust else None))
        values = gtsam.Values()
        for key, pose in enumerate(self.poses):
            values.insert(key, pose2(pose))
        return graph, values

    def _solve(self, graph: Any, values: Any, loss: str) -> Any:
        lm = gtsam.LevenbergMarquardtParams()
        if loss != "gnc":
            return gtsam.LevenbergMarquardtOptimizer(graph, values, lm).optimize()
        params = gtsam.GncLMParams(lm)
        trusted = [0, *(1 + i for i, edge in enumerate(self.edges) if edge.kind == "odometry")]
        params.setKnownInliers(trusted)
        optimiser = gtsam.GncLMOptimizer(graph, values, params)
        optimiser.setInlierCostThresholds(0.5 * 11.34)  # chi-square, 3 degrees of freedom, 99 %
        return optimiser.optimize()

    def _disbelieved(self) -> NDArray[np.bool_]:
        out = np.zeros(len(self.edges), dtype=np.bool_)
        for i, edge in enumerate(self.edges):
            if edge.kind == "odometry":
                continue
            error = between(edge.relative, between(self._poses[edge.first], self._poses[edge.second]))
            distance = error @ np.linalg.solve(body_covariance(edge), error)
            out[i] = distance > 25.0 * self._config.robust_scale**2
        return out

    def _take(self, values: Any) -> None:
        poses = gtsam.utilities.extractPose2(values)  # in the order of their keys
        if not np.isfinite(poses).all():
            raise GraphError(
                "the pose graph's solution is not finite; a constraint or its covariance is unusable"
            )
        self._poses[: self._count] = poses
        self.near.rebuild(self.poses)

    def _add(self, edge: Edge) -> None:
        self.edges.append(edge)
        covariance = body_covariance(edge)
        news = edge.kind != "loop" or self._says_something(edge)
        reaches_back = edge.kind == "loop" and news and self._reaches_back(edge)
        if edge.kind != "overlap":
            spread = 0.5 * (covariance[0, 0] + covariance[1, 1])
            self.uncertainty.add(edge.first, edge.second, spread, covariance[2, 2])
        if not news:
            return
        self._loop_waits = self._loop_waits or edge.kind == "loop"
        if self._incremental is not None:
            self._incremental.add(edge, reaches_back=reaches_back)

    def _says_something(self, edge: Edge) -> bool:
        distance, turn = self._disagreement(edge)
        return distance >= NEXT_TO_NOTHING_XY or turn >= NEXT_TO_NOTHING_THETA

    def _reaches_back(self, edge: Edge) -> bool:
        distance, turn = self._disagreement(edge)
        if distance < REACHES_BACK_XY and turn < REACHES_BACK_THETA:
            return False
        ((variance, _),) = self.uncertainty.seen_from(edge.second, np.array([edge.first]), self.poses)
        return bool(variance > REACHES_BACK_STD**2)

    def _disagreement(self, edge: Edge) -> tuple[float, float]:
        """How far an edge is from the estimate (m, rad)."""
        error = between(edge.relative, between(self._poses[edge.first], self._poses[edge.second]))
        return math.hypot(error[0], error[1]), abs(error[2])
