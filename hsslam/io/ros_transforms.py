"""Where a laser sits on its robot, from the transforms of a bag."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.se2 import Pose

Matrix = NDArray[np.float64]

_UPRIGHT = math.cos(math.radians(30.0))


class TiltedError(ValueError):
    """The laser's plane is not the floor's."""


def rotation(q: Any) -> Matrix:
    """Rotation matrix (3, 3) of a ROS quaternion; raises `ValueError` where it has no length."""
    x, y, z, w = float(q.x), float(q.y), float(q.z), float(q.w)
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if not (math.isfinite(norm) and norm > 1e-6):
        raise ValueError(f"expected a quaternion of length 1, found x {x:g} y {y:g} z {z:g} w {w:g}")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def planar(position: Any, orientation: Any) -> Pose:
    """Pose in the plane of a ROS position and orientation (m, m, rad in [-pi, pi)).

    Raises
    ------
    ValueError
        Numbers that are not finite, or a quaternion without length.
    """
    turn = rotation(orientation)
    return _pose(float(position.x), float(position.y), math.atan2(turn[1, 0], turn[0, 0]))


def frame_name(name: str) -> str:
    """A frame's name without the slash that old recordings begin it with."""
    return name.lstrip("/")


@dataclass
class TransformTree:
    """Transforms between frames, as first seen: child by child, its parent and its pose there (4, 4)."""

    parents: dict[str, tuple[str, Matrix]] = field(default_factory=dict)

    def add(self, message: Any) -> None:
        """Take in a TFMessage; raises `ValueError` at a transform that is none."""
        for stamped in message.transforms:
            child, parent = frame_name(stamped.child_frame_id), frame_name(stamped.header.frame_id)
            if child in self.parents or child == parent:
                continue
            t = stamped.transform.translation
            matrix = np.eye(4)
            matrix[:3, :3] = rotation(stamped.transform.rotation)
            matrix[:3, 3] = t.x, t.y, t.z
            self.parents[child] = (parent, matrix)

    def ancestors(self, frame: str) -> list[str]:
        """The frame, its parent, and so on up to the root."""
        chain = [frame]
        while chain[-1] in self.parents and len(chain) <= len(self.parents):
            chain.append(self.parents[chain[-1]][0])
        return chain

    def find(self, base: str, frame: str) -> Matrix | None:
        """Pose of ``frame`` in ``base`` (4, 4), where transforms lead from one to the other."""
        up, down = self.ancestors(base), self.ancestors(frame)
        common = next((name for name in up if name in down), None)
        if common is None:
            return None
        return np.asarray(np.linalg.inv(self._from(common, base)) @ self._from(common, frame))

    def _from(self, ancestor: str, frame: str) -> Matrix:
        out = np.eye(4)
        while frame != ancestor:
            frame, matrix = self.parents[frame]
            out = matrix @ out
        return out


@dataclass(frozen=True, eq=False)
class Mounting:
    """A laser on its robot: its pose there, and whether it hangs upside down (its beams then run clockwise)."""

    pose: Pose
    flipped: bool = False

    @classmethod
    def of(cls, matrix: Matrix) -> Mounting:
        """Project a pose in space to the floor.

        Raises
        ------
        TiltedError
            The laser looks up or down by more than 30 degrees.
        """
        if abs(matrix[2, 2]) < _UPRIGHT:
            degrees = math.degrees(math.acos(max(-1.0, min(1.0, matrix[2, 2]))))
            raise TiltedError(f"the laser is tilted by {degrees:.0f} degrees; expected one that scans level")
        theta = math.atan2(matrix[1, 0], matrix[0, 0])
        return cls(_pose(float(matrix[0, 3]), float(matrix[1, 3]), theta), bool(matrix[2, 2] < 0.0))


def _pose(x: float, y: float, theta: float) -> Pose:
    if not all(map(math.isfinite, (x, y, theta))):
        raise ValueError(f"expected a finite pose, found {x:g} {y:g} {theta:g}")
    return np.array([x, y, -math.pi if theta >= math.pi else theta])
