"""What the pipeline reports while it runs, and what it hands over at the end."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hsslam.scan import LaserScan
from hsslam.se2 import Pose
from hsslam.trajectory import Trajectory


@dataclass(frozen=True)
class Tracked:
    """A scan got its pose.

    ``pose`` is the best known at that moment; ``relative`` is the scan seen from keyframe ``keyframe``;
    ``matched`` is False where odometry had to stand in.
    """

    scan: int
    stamp: float
    pose: Pose
    keyframe: int
    relative: Pose
    covariance: NDArray[np.float64]
    score: float
    matched: bool
    evaluations: int


@dataclass(frozen=True)
class KeyframeAdded:
    """A scan became keyframe number ``keyframe``."""

    keyframe: int
    scan: int
    pose: Pose


@dataclass(frozen=True)
class LoopChecked:
    """A loop candidate was tried and judged: ``second`` seen from ``first`` (keyframes), accepted or why not.

    ``expected_std`` (m) is how well the graph knew the two relative to one another before; ``surprise`` is the
    match's squared Mahalanobis distance from that; ``agreeing`` counts the other loops that say the same; and
    ``ambiguity`` is the score of the best answer elsewhere in the window over that of the answer, where it was
    looked for. The verdict may come some keyframes after the match.
    """

    first: int
    second: int
    accepted: bool
    reason: str
    relative: Pose
    covariance: NDArray[np.float64]
    score: float
    evaluations: int
    converged: bool = True
    expected_std: float = 0.0
    surprise: float = 0.0
    agreeing: int = 0
    ambiguity: float = 0.0

    @property
    def contested(self) -> bool:
        """Refused although the match itself was good: ambiguous, or the only one to say so."""
        return not self.accepted and (self.agreeing > 0 or self.ambiguity > 0.0 or "agree" in self.reason)


@dataclass(frozen=True)
class Optimised:
    """The whole graph was optimised: nonlinear error before and after; ``stage`` says which pass."""

    stage: str
    error_before: float
    error_after: float
    rejected_loops: int = 0


Event: TypeAlias = Tracked | KeyframeAdded | LoopChecked | Optimised


@dataclass(frozen=True)
class Edge:
    """A relative pose between two keyframes: ``kind`` is ``odometry``, ``loop`` or ``overlap``."""

    first: int
    second: int
    relative: Pose
    covariance: NDArray[np.float64]
    kind: str


@dataclass(frozen=True)
class SlamResult:
    """The outcome of a run.

    Parameters
    ----------
    trajectory : Trajectory
        A robot pose for every scan.
    online : Trajectory
        The pose of each scan as it was known when that scan was the newest.
    odometry : Trajectory
        The raw odometry of every scan.
    keyframes : list of LaserScan
        The keyframes' scans, in order.
    keyframe_poses : float64 (K, 3)
        Their final poses.
    edges : list of Edge
        Every constraint of the graph.
    loops : list of LoopChecked
        Every loop candidate tried.
    matched : int
        Scans whose pose came from a match, not from odometry.
    statistics : dict
        ``evaluations`` of all matches in tracking and loops; ``guessed``, of how many scans neither a match nor
        odometry told the pose; ``first_guessed``, the first of them, or None; ``paused_before``, scans that do not fit
        where the robot was before the recording paused or it got lost; ``sessions``, how many parts of the log,
        between such pauses, are not tied to one another at the end; ``own_parts_deg``, how much of the laser's view
        parts of the robot hide (deg).
    seconds : dict
        Wall time by stage (s), such as ``track``, ``submap``, ``loops``, ``graph``, ``final``, ``rescan``.
    covariances : float64 (K, 3, 3), optional
        Of the keyframes' poses in the axes of the map, where ``graph.marginals`` asked for them.
    """

    trajectory: Trajectory
    online: Trajectory
    odometry: Trajectory
    keyframes: list[LaserScan]
    keyframe_poses: NDArray[np.float64]
    edges: list[Edge]
    loops: list[LoopChecked]
    matched: int
    seconds: dict[str, float] = field(default_factory=dict)
    statistics: dict[str, Any] = field(default_factory=dict)
    covariances: NDArray[np.float64] | None = None
