"""Matching two scans in one call."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hsslam.matching import MatchResult, SearchWindow, create
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Pose, between, wrap

WINDOW = SearchWindow(0.3, 0.3, math.radians(15.0))
"""How far from the guess the truth may be, where nobody says."""


def match(
    scan_a: LaserScan | ArrayLike,
    scan_b: LaserScan | ArrayLike,
    method: str = "hide",
    *,
    guess: ArrayLike | None = None,
    window: SearchWindow | tuple[float, float, float] = WINDOW,
    seed: int = 0,
    **parameters: Any,
) -> MatchResult:
    """Find the pose of one scan seen from another.

    Parameters
    ----------
    scan_a, scan_b : LaserScan, or array (N, 2)
        The reference, and the scan whose pose is sought: points (m) in beam order, or scans, whose points are
        taken in the robot's frame.
    method : str
        A matcher that `hsslam matchers` lists.
    guess : array (3,), optional
        Where ``scan_b`` is thought to be, seen from ``scan_a`` (m, m, rad). Left out: what odometry says where both are
        `LaserScan`, else no motion.
    window : SearchWindow or (m, m, rad)
        Half sides of the box around the guess that holds the truth; 0.3 m, 0.3 m and 15 degrees if left out.
    seed : int
        Of every random choice.
    **parameters
        The matcher's own, e.g. ``evaluations=300``.

    Returns
    -------
    MatchResult
        Its ``pose`` is that of ``scan_b`` in the frame of ``scan_a`` (of the robot's, for `LaserScan`).

    Raises
    ------
    ConfigError
        Unknown method, unknown parameter, or a value out of its range.
    MatcherUnavailableError
        The method cannot run here.
    ValueError
        Points not of shape (N, 2), or a guess or window that is not three finite numbers.
    """
    if guess is not None:
        start: Pose = np.array(guess, dtype=np.float64)
        if start.shape == (3,):
            start[2] = wrap(start[2])
    elif isinstance(scan_a, LaserScan) and isinstance(scan_b, LaserScan):
        start = between(scan_a.odometry, scan_b.odometry)
    else:
        start = np.zeros(3)
    box = window if isinstance(window, SearchWindow) else SearchWindow(*_three(window))
    matcher = create(method, parameters)
    rng = np.random.default_rng(seed)
    return matcher.match(matcher.prepare(_points(scan_a)), _points(scan_b), start, box, rng)


def _points(scan: LaserScan | ArrayLike) -> Points:
    return scan.robot_points if isinstance(scan, LaserScan) else np.asarray(scan, dtype=np.float64)


def _three(window: ArrayLike) -> NDArray[np.float64]:
    half = np.asarray(window, dtype=np.float64)
    if half.shape != (3,) or not (np.isfinite(half).all() and (half > 0.0).all()):
        raise ValueError(f"a window is three positive numbers (m, m, rad), not {window!r}")
    return half
