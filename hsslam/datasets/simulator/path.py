"""How a differential-drive robot goes round a route."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.se2 import Points, Poses, wrap


@dataclass(frozen=True)
class DriveModel:
    """How the robot moves and how often it scans.

    Parameters
    ----------
    rate : float
        Scans per second.
    speed, turn_rate : float
        Largest speed (m/s) and turn rate (rad/s).
    acceleration : float
        Of the speed (m/s^2).
    lookahead : float
        The robot steers at a point of the route this far ahead (m); corners are cut accordingly.
    sway : float
        Standard deviation of the steering error (rad), which makes each round a little different.
    """

    rate: float = 4.0
    speed: float = 0.6
    turn_rate: float = 0.8
    acceleration: float = 0.8
    lookahead: float = 0.5
    sway: float = 0.06


def drive(route: Points, scans: int, rng: np.random.Generator, model: DriveModel | None = None) -> Poses:
    """Poses of the robot at each scan, (scans, 3).

    It starts at the first corner of the closed ``route`` (W, 2), headed for the second, follows it round
    after round, and stops to turn where the route bends sharply (pure pursuit: Coulter 1992,
    CMU-RI-TR-92-01).
    """
    model = model or DriveModel()
    return _follow(
        np.ascontiguousarray(route, dtype=np.float64),
        model.sway * rng.standard_normal(scans),
        model.rate,
        model.speed,
        model.turn_rate,
        model.acceleration,
        model.lookahead,
    )


_SUBSTEPS = 5
_SHARP = 0.9
_GAIN = 2.5


@kernel
def _follow(
    route: Points,
    sway: NDArray[np.float64],
    rate: float,
    top_speed: float,
    top_turn: float,
    acceleration: float,
    lookahead: float,
) -> Poses:
    corners = route.shape[0]
    poses = np.empty((sway.shape[0], 3))
    step = 1.0 / (rate * _SUBSTEPS)
    x, y = route[0]
    theta = math.atan2(route[1, 1] - y, route[1, 0] - x)
    leg, along = 0, 0.0
    speed, error = 0.0, 0.0
    for i in range(sway.shape[0]):
        poses[i, 0], poses[i, 1], poses[i, 2] = x, y, wrap(theta)
        # The steering error wanders: it forgets itself over about ten scans.
        error = 0.9 * error + 0.436 * sway[i]
        for _ in range(_SUBSTEPS):
            while True:
                a, b = route[leg], route[(leg + 1) % corners]
                length = math.hypot(b[0] - a[0], b[1] - a[1])
                share = min(along / length, 1.0)
                tx, ty = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
                if math.hypot(tx - x, ty - y) >= lookahead:
                    break
                along += 0.02
                if along >= length:
                    leg, along = (leg + 1) % corners, 0.0
            off = wrap(math.atan2(ty - y, tx - x) + error - theta)
            wanted = top_speed * math.cos(off) if abs(off) < _SHARP else 0.0
            speed += min(max(wanted - speed, -2.0 * acceleration * step), acceleration * step)
            turn = min(max(_GAIN * off, -top_turn), top_turn) * step
            x += speed * step * math.cos(theta + 0.5 * turn)
            y += speed * step * math.sin(theta + 0.5 * turn)
            theta += turn
    return poses
