"""Wheel odometry that slips and is calibrated badly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hsslam.se2 import Poses, between_many, compose, wrap


@dataclass(frozen=True)
class OdometryModel:
    """How measured motion differs from the true one.

    Random slip is a random walk: its variance grows in proportion to travel and turning, whatever the scan
    rate. Biases are the same at every step of a run.

    Parameters
    ----------
    slip_travel : float
        Standard deviation of the distance after 1 m of travel (m), along and, by half, across the motion.
    slip_heading : float
        Standard deviation of the heading after 1 m of travel (rad).
    slip_turn : float
        Standard deviation of the heading after turning by 1 rad (rad).
    scale_bias : float
        Share by which travel is measured too long.
    turn_bias : float
        Share by which turns are measured too wide.
    drift : float
        Heading measured without turning (rad per metre of travel).
    """

    slip_travel: float = 0.02
    slip_heading: float = 0.012
    slip_turn: float = 0.02
    scale_bias: float = 0.02
    turn_bias: float = 0.02
    drift: float = 0.004

    def measure(self, truth: Poses, rng: np.random.Generator) -> Poses:
        """Odometry of true poses (N, 3); both start at the same pose."""
        if len(truth) < 2:
            return truth.copy()
        steps = between_many(truth[:-1], truth[1:])
        travel = np.hypot(steps[:, 0], steps[:, 1])
        turning = np.abs(steps[:, 2])
        noise = rng.standard_normal((len(steps), 3))
        slip = self.slip_travel * np.sqrt(travel)
        steps[:, 0] = steps[:, 0] * (1.0 + self.scale_bias) + slip * noise[:, 0]
        steps[:, 1] = steps[:, 1] * (1.0 + self.scale_bias) + 0.5 * slip * noise[:, 1]
        heading_std = np.sqrt(self.slip_heading**2 * travel + self.slip_turn**2 * turning)
        steps[:, 2] += self.turn_bias * steps[:, 2] + self.drift * travel + heading_std * noise[:, 2]
        measured = np.empty_like(truth)
        measured[0] = truth[0]
        for i, step in enumerate(steps):
            step[2] = wrap(step[2])
            measured[i + 1] = compose(measured[i], step)
        return measured


EXACT = OdometryModel(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Odometry without error."""
