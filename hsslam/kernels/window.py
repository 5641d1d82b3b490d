"""Search windows inside kernels, as `hsslam.matching.SearchWindow` has them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Pose, wrap

TOLERANCE = 1e-9
"""A pose this far outside is still inside (m, m, rad)."""


@kernel
def inside(guess: Pose, half: NDArray[np.float64], pose: Pose) -> bool:
    """Whether a pose is inside the window of half sides ``half`` (3,) around ``guess``; not finite is not."""
    turned = abs((pose[2] - guess[2] + math.pi) % math.tau - math.pi)
    within: bool = (
        abs(pose[0] - guess[0]) <= half[0] + TOLERANCE
        and abs(pose[1] - guess[1]) <= half[1] + TOLERANCE
        and turned <= half[2] + TOLERANCE
    )
    return within


@kernel
def kept(guess: Pose, half: NDArray[np.float64], pose: Pose, slack: float) -> Pose:
    """A pose that is outside by up to a share ``slack`` of the half sides, on the edge; any other as it is."""
    if inside(guess, half, pose):
        return pose
    offset = pose - guess
    offset[2] = wrap(offset[2])
    for d in range(3):
        if not abs(offset[d]) <= (1.0 + slack) * half[d]:
            return pose
    return guess + np.minimum(np.maximum(offset, -half), half)
