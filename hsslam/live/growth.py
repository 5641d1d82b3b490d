"""What is remembered of a run so that its map can be shown at any moment."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from hsslam.live.snapshot import Snapshot
from hsslam.scan import LaserScan
from hsslam.slam.events import Event, KeyframeAdded, LoopChecked, Optimised, Tracked

MOST_POINTS = 200_000
"""Of the keyframes together; beyond it every other point is forgotten, as often as it takes."""


class Growth:
    """Follows the events of a run; its memory is bounded but for the poses and the loops.

    Parameters
    ----------
    most_points : int
        How many points of keyframes to remember at most.
    """

    def __init__(self, most_points: int = MOST_POINTS) -> None:
        self.keyframes = 0
        self._most = most_points
        self._step = 1
        self._points = np.empty((4096, 2), dtype=np.float32)
        self._owners = np.empty(4096, dtype=np.int32)
        self._count = 0
        self._loops: list[tuple[int, int]] = []
        self._newest: NDArray[np.floating] = np.empty((0, 2))
        self._pose = np.zeros(3)
        self._scan = -1
        self._stamps = (0.0, 0.0)
        self._stage = "tracking"

    def add(self, events: Iterable[Event], scan: LaserScan | None = None) -> None:
        """Take in what happened; ``scan`` is the one it happened to."""
        for event in events:
            if isinstance(event, Tracked):
                self._stamps = (self._stamps[0] if self._scan >= 0 else event.stamp, event.stamp)
                self._scan, self._pose = event.scan, event.pose
                if scan is not None:
                    self._newest = scan.robot_points
            elif isinstance(event, KeyframeAdded):
                self.keyframes += 1
                if scan is not None:
                    self._keep(event.keyframe, scan.robot_points)
            elif isinstance(event, LoopChecked) and event.accepted:
                self._loops.append((event.first, event.second))
            elif isinstance(event, Optimised):
                self._stage = event.stage

    def snapshot(self, poses: NDArray[np.float64], *, final: bool = False) -> Snapshot:
        """The map now.

        Parameters
        ----------
        poses : float64 (K, 3)
            Of the keyframes, as they are known now.
        final : bool
            The run is over.
        """
        return Snapshot(
            points=self._points[: self._count].copy(),
            owners=self._owners[: self._count].copy(),
            poses=np.array(poses, dtype=np.float64),
            loops=np.array(self._loops, dtype=np.int64).reshape(-1, 2),
            scan_points=self._newest[: 0 if final else None].astype(np.float32),
            scan_pose=np.array(poses[-1] if final and len(poses) else self._pose),
            scan=self._scan,
            stamp=self._stamps[1] - self._stamps[0],
            stage="finished" if final else self._stage,
            final=final,
        )

    def _keep(self, keyframe: int, points: NDArray[np.float64]) -> None:
        points = points[:: self._step]
        while self._count + len(points) > self._most:
            points_kept, owners_kept = self._points[: self._count : 2], self._owners[: self._count : 2]
            self._count = len(points_kept)
            self._points[: self._count], self._owners[: self._count] = points_kept.copy(), owners_kept.copy()
            self._step *= 2
            points = points[::2]
        end = self._count + len(points)
        while end > len(self._points):
            self._points = np.concatenate((self._points, np.empty_like(self._points)))
            self._owners = np.concatenate((self._owners, np.empty_like(self._owners)))
        self._points[self._count : end] = points
        self._owners[self._count : end] = keyframe
        self._count = end
