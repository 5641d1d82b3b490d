"""What comes back: a plugin's estimate, the answer to a match, and the answers to several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Pose, Poses


@dataclass(frozen=True)
class Estimate:
    """What a plugin found.

    Parameters
    ----------
    pose : Pose
        Pose of the scan in the reference's frame.
    converged : bool
        Whether the method says of itself that it succeeded.
    evaluations : int
        Fitness evaluations or iterations spent, all included.
    covariance : float64 (3, 3), optional
        Of the pose, if the method has one of its own; else the framework computes one.
    diagnostics : mapping
        Anything else worth knowing; JSON types only.
    lines : float64 (N, 3), optional
        Of the scan's points, as `hsslam.search.scan_lines` makes them, if the method needed them: the framework, which
        does, too, need not make them again.
    """

    pose: Pose
    converged: bool = True
    evaluations: int = 0
    covariance: NDArray[np.float64] | None = None
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    lines: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class MatchResult:
    """The answer to one match.

    Parameters
    ----------
    pose : Pose
        Pose of the scan in the reference's frame. The guess itself where nothing better is known.
    covariance : float64 (3, 3)
        Of ``(x, y, theta)`` in the reference's frame (m, m, rad); always positive definite.
    score : float
        Share of the scan's points, in [0, 1], that lie within ``score_distance`` of the reference surface at
        ``pose``, on the side that they see: the same yardstick for every matcher.
    converged : bool
        False where the method failed, or its answer was rejected.
    evaluations : int
        Fitness evaluations or iterations spent.
    diagnostics : mapping
        ``rejected`` tells why an answer was refused, ``covariance_rejected`` why the method's own covariance was
        (the framework's stands in for it); ``degenerate_direction`` (rad, in the reference's frame) is
        there where the returns leave a direction open, such as that of a plain corridor; the rest is the
        method's own.
    """

    pose: Pose
    covariance: NDArray[np.float64]
    score: float
    converged: bool
    evaluations: int
    diagnostics: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Matches:
    """The answers to several matches against one reference: what `MatchResult` holds, in arrays.

    Parameters
    ----------
    poses : Poses
        (N, 3).
    covariances : float64 (N, 3, 3)
    scores : float64 (N,)
    converged : bool (N,)
    """

    poses: Poses
    covariances: NDArray[np.float64]
    scores: NDArray[np.float64]
    converged: NDArray[np.bool_]

    @classmethod
    def of(cls, results: Sequence[MatchResult]) -> Matches:
        """Those of single matches, in their order."""
        return cls(
            np.array([result.pose for result in results]).reshape(-1, 3),
            np.array([result.covariance for result in results]).reshape(-1, 3, 3),
            np.array([result.score for result in results], dtype=np.float64),
            np.array([result.converged for result in results], dtype=np.bool_),
        )

    def put(self, i: int, result: MatchResult) -> None:
        """Replace the answer to match ``i``."""
        self.poses[i], self.covariances[i] = result.pose, result.covariance
        self.scores[i], self.converged[i] = result.score, result.converged

    def only(self, these: NDArray[np.bool_]) -> Matches:
        """Those that ``these``, bool (N,), says."""
        return Matches(self.poses[these], self.covariances[these], self.scores[these], self.converged[these])
