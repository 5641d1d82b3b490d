"""A sequence of stamped robot poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Poses


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Robot poses in a fixed frame, in the order of the log.

    Parameters
    ----------
    stamps : float64 (N,)
        As recorded (s); they may repeat or step back.
    poses : Poses
        (N, 3) x m, y m, theta rad.
    indices : int64 (N,)
        Number of the scan that each pose belongs to, from 0, strictly increasing. A trajectory that covers
        every scan of a log has 0..N-1.
    """

    stamps: NDArray[np.float64]
    poses: Poses
    indices: NDArray[np.int64]

    def __post_init__(self) -> None:
        if not (len(self.stamps) == len(self.poses) == len(self.indices)):
            raise ValueError("stamps, poses and indices of a trajectory have one entry per pose")

    def __len__(self) -> int:
        return len(self.stamps)
