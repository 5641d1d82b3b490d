"""The state of a growing map at one moment, as it is handed to a viewer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Snapshot:
    """What a viewer draws.

    Parameters
    ----------
    points : float32 (N, 2)
        Returns of the keyframes (m), each in the robot's frame of its keyframe, keyframe after keyframe.
    owners : int32 (N,)
        Number of the keyframe of each point.
    poses : float64 (K, 3)
        Poses of the keyframes as they are known now.
    loops : int64 (L, 2)
        Numbers of the keyframes that each accepted loop ties together.
    scan_points : float32 (M, 2)
        Returns of the newest scan (m), in the robot's frame.
    scan_pose : float64 (3,)
        Where the robot was then.
    scan : int
        Number of the newest scan.
    stamp : float
        Seconds from the first scan to the newest.
    stage : str
        What the run is doing.
    final : bool
        Nothing comes after it.
    """

    points: NDArray[np.float32]
    owners: NDArray[np.int32]
    poses: NDArray[np.float64]
    loops: NDArray[np.int64]
    scan_points: NDArray[np.float32]
    scan_pose: NDArray[np.float64]
    scan: int
    stamp: float
    stage: str
    final: bool = False

    @property
    def trajectory(self) -> NDArray[np.float64]:
        """(K + 1, 2) m: the way of the robot through its keyframes to where it is."""
        return np.vstack((self.poses[:, :2], self.scan_pose[None, :2]))

    @property
    def ties(self) -> NDArray[np.float64]:
        """(L, 2, 2) m: the two ends of every accepted loop."""
        return self.poses[self.loops.reshape(-1), :2].reshape(-1, 2, 2)

    @property
    def status(self) -> str:
        """A line that says how far the run is."""
        counts = f"{len(self.poses):,} keyframes, {len(self.loops):,} loops accepted"
        return f"{self.stage}: scan {self.scan + 1:,}, {counts}"


def placed(
    points: NDArray[np.float32], owners: NDArray[np.int32], poses: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Points in the frame of the map.

    Parameters
    ----------
    points : float32 (N, 2)
        In the frames of their owners (m).
    owners : int32 (N,)
        Which of the poses each belongs to.
    poses : float64 (K, 3)
        Poses in the map.

    Returns
    -------
    float32 (N, 2)
        In the map (m).
    """
    # In numpy, not by the kernels of `hsslam.se2`: a viewer's process would compile or load Numba for this alone.
    cosines, sines = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x, y = points[:, 0], points[:, 1]
    c, s = cosines[owners], sines[owners]
    moved = np.column_stack((c * x - s * y, s * x + c * y)) + poses[owners, :2]
    return moved.astype(np.float32)
