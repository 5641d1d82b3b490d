"""What the pipeline remembers of every scan, packed: a log may have a million."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Points, Pose, Poses

_ROOM = 1024


class Rows:
    """Numbers, or arrays of one shape, appended one at a time and kept in one array that doubles when it is full.

    Parameters
    ----------
    *shape : int
        Of a row; none for single numbers.
    dtype : dtype
        Of its numbers.
    """

    def __init__(self, *shape: int, dtype: Any = np.float64) -> None:
        self._rows: NDArray[Any] = np.empty((_ROOM, *shape), dtype=dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, row: Any) -> None:
        """Add a row."""
        if self._count == len(self._rows):
            self._rows = np.concatenate((self._rows, np.empty_like(self._rows)))
        self._rows[self._count] = row
        self._count += 1

    @property
    def values(self) -> NDArray[Any]:
        """All rows, (N, *shape): a view, which rows that are added later may or may not show in."""
        return self._rows[: self._count]


class ScanTable:
    """A row per scan: when, where by odometry, where by SLAM, and its returns."""

    def __init__(self) -> None:
        self._stamps, self._odometry, self._online = Rows(), Rows(3), Rows(3)
        self._anchors, self._relatives = Rows(dtype=np.int64), Rows(3)
        self._motions, self._noises = Rows(3), Rows(3, 3)
        self.points: list[NDArray[np.float32]] = []
        """Returns (N_i, 2) of every scan in the robot's frame (m)."""

    def append(
        self,
        stamp: float,
        odometry: Pose,
        online: Pose,
        anchor: int,
        relative: Pose,
        motion: Pose,
        noise: NDArray[np.float64],
        points: Points,
    ) -> None:
        """Add a scan; the parameters are rows of the properties of the same names."""
        self._stamps.append(stamp)
        self._odometry.append(odometry)
        self._online.append(online)
        self._anchors.append(anchor)
        self._relatives.append(relative)
        self._motions.append(motion)
        self._noises.append(noise)
        self.points.append(points.astype(np.float32))

    def becomes_keyframe(self, keyframe: int) -> None:
        """Hang the newest scan on the keyframe that it became."""
        self.anchors[-1], self.relatives[-1] = keyframe, 0.0

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def stamps(self) -> NDArray[np.float64]:
        """As recorded (s), (S,)."""
        return self._stamps.values

    @property
    def odometry(self) -> Poses:
        """Raw odometry, (S, 3)."""
        return self._odometry.values

    @property
    def online(self) -> Poses:
        """The pose of each scan as it was known when it was the newest, (S, 3)."""
        return self._online.values

    @property
    def anchors(self) -> NDArray[np.int64]:
        """Number of the keyframe that each scan hangs on, (S,); ascending."""
        return self._anchors.values

    @property
    def relatives(self) -> Poses:
        """Each scan seen from that keyframe, (S, 3)."""
        return self._relatives.values

    @property
    def motions(self) -> Poses:
        """Predicted motion from the scan before to each, in the frame of the scan before, (S, 3)."""
        return self._motions.values

    @property
    def noises(self) -> NDArray[np.float64]:
        """Covariances of `motions` in the frame of the scan itself, (S, 3, 3)."""
        return self._noises.values
