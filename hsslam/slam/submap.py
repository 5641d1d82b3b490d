"""Submaps: the points of several keyframes in the frame of one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hsslam.se2 import Points, Poses, between, transform


def merge(points: Sequence[Points], poses: Poses, origin: int) -> Points:
    """Points of all keyframes in the frame of number ``origin``.

    Parameters
    ----------
    points : sequence of Points
        One (N_i, 2) array per keyframe, in its own frame, beams in order.
    poses : Poses
        (K, 3), one per keyframe, all in one frame.
    origin : int
        Which keyframe's frame the result is in.

    Returns
    -------
    Points
        (sum of N_i, 2) m, keyframe after keyframe, so that beams stay in order.
    """
    return np.concatenate(
        [transform(between(poses[origin], pose), p) for p, pose in zip(points, poses, strict=True)]
    )
