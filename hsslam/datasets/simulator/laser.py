"""Lasers: where their beams point and how their readings err."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hsslam.errors import ConfigError
from hsslam.scan import ScanGeometry


@dataclass(frozen=True)
class LaserModel:
    """A planar laser scanner.

    Parameters
    ----------
    name : str
        What the command line calls it.
    beams : int
        Beams of a scan.
    angle_min, angle_increment : float
        Angle of the first beam, and from a beam to the next (rad, counter-clockwise).
    range_min, range_max : float
        Nearest and farthest reading (m).
    range_noise : float
        Standard deviation of a reading (m) ...
    range_noise_share : float
        ... or this share of the range, where that is more.
    resolution : float
        Readings are whole multiples of it (m); 0 for no rounding.
    drop_out : float
        Probability that a beam gets no return although there is something to hit.
    time_increment : float
        Time from a beam to the next (s); 0 for all at once.
    no_return : float
        What a beam without a return reads (m), at least ``range_max``.

    Raises
    ------
    ConfigError
        A value that no laser can have.
    """

    name: str
    beams: int
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    range_noise: float
    range_noise_share: float = 0.0
    resolution: float = 0.0
    drop_out: float = 0.0
    no_return: float = math.inf
    time_increment: float = 0.0

    def __post_init__(self) -> None:
        around = self.angle_increment * (self.beams - 1)
        for right, what in (
            (self.beams >= 2, f"beams must be 2 or more, found {self.beams}"),
            (self.angle_increment > 0.0, f"angle_increment must be positive, found {self.angle_increment}"),
            (
                around <= 2.0 * math.pi + 1e-9,
                f"beams must not go more than once around, found {around:.3f} rad",
            ),
            (0.0 <= self.range_min < self.range_max, "range_min must be at least 0 and below range_max"),
            (
                min(self.range_noise, self.range_noise_share, self.resolution) >= 0.0,
                "noise cannot be negative",
            ),
            (self.time_increment >= 0.0, f"time_increment cannot be negative, found {self.time_increment}"),
            (0.0 <= self.drop_out <= 1.0, f"drop_out is a probability, found {self.drop_out}"),
            (self.no_return >= self.range_max, "no_return must be range_max or more"),
        ):
            if not right:
                raise ConfigError(f"laser {self.name!r}: {what}")

    @property
    def geometry(self) -> ScanGeometry:
        """The part of the model that a scan carries."""
        return ScanGeometry(
            self.angle_min, self.angle_increment, self.range_min, self.range_max, self.time_increment
        )

    @property
    def field_of_view(self) -> float:
        """Angle between the first and the last beam (rad)."""
        return self.angle_increment * (self.beams - 1)

    def with_beams(self, beams: int) -> LaserModel:
        """Return the same laser with ``beams`` beams spread evenly over the same field of view."""
        if beams < 2:
            raise ConfigError(f"laser {self.name!r}: beams must be 2 or more, found {beams}")
        time_increment = self.time_increment * self.beams / beams
        return replace(
            self,
            beams=beams,
            angle_increment=self.field_of_view / (beams - 1),
            time_increment=time_increment,
        )

    def measure(self, distances: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        """Turn true distances (any shape, m; infinite where there is nothing to hit) into readings."""
        finite = np.where(np.isfinite(distances), distances, 0.0)
        deviation = np.maximum(self.range_noise, self.range_noise_share * finite)
        readings = finite + deviation * rng.standard_normal(distances.shape)
        if self.resolution > 0.0:
            # Dividing by the whole number of steps a metre gives the double nearest to the decimal figure.
            steps = 1.0 / self.resolution
            readings = np.rint(readings * steps) / steps
        lost = rng.random(distances.shape) < self.drop_out
        lost |= (distances < self.range_min) | (distances >= self.range_max)
        lost |= (readings < self.range_min) | (readings >= self.range_max)
        readings[lost] = self.no_return
        return readings


SICK_LMS200 = LaserModel(
    name="sick-lms200",
    beams=180,
    angle_min=-math.pi / 2,
    angle_increment=math.radians(1.0),
    range_min=0.05,
    range_max=80.0,
    range_noise=0.01,
    resolution=0.01,
    drop_out=0.005,
    no_return=81.91,
)
"""SICK LMS200 in its 80 m mode: a beam each degree, whole centimetres, 81.91 m for no return.

Figures after SICK's technical description of the LMS2xx (range at most 80 m; resolution 10 mm; statistical
error of one standard deviation 5 mm in the millimetre mode below 8 m, 10 mm taken here for the
centimetre mode) and after the logs that CARMEN recorded with it (180 beams, -90 to +89 degrees). The share of
lost beams is our choice.
"""

URG_04LX = LaserModel(
    name="urg-04lx",
    beams=682,
    angle_min=-340.5 * 2.0 * math.pi / 1024.0,
    angle_increment=2.0 * math.pi / 1024.0,
    range_min=0.06,
    range_max=4.0,
    range_noise=0.01,
    range_noise_share=0.01,
    resolution=0.001,
    drop_out=0.01,
    no_return=4.095,
)
"""Hokuyo URG-04LX: 682 beams over 240 degrees (1024 steps a turn), 0.06 to 4 m.

Figures after Hokuyo's specification: accuracy 10 mm up to 1 m and 1 % of the range beyond, taken here as one
standard deviation, which is on the noisy side; resolution 1 mm. The share of lost beams is our choice.
"""

RPLIDAR_A2 = LaserModel(
    name="rplidar-a2",
    beams=360,
    angle_min=-math.pi,
    angle_increment=math.radians(1.0),
    range_min=0.15,
    range_max=12.0,
    range_noise=0.01,
    range_noise_share=0.005,
    resolution=0.001,
    drop_out=0.02,
    time_increment=0.1 / 360.0,
)
"""A spinning laser like Slamtec's RPLIDAR A2: a turn in 0.1 s, so a robot that moves distorts what it sees.

Reach and rate after its specification; the errors and the share of lost beams are our choice.
"""

LASERS = {laser.name: laser for laser in (SICK_LMS200, URG_04LX, RPLIDAR_A2)}
"""Presets by name."""


def laser_model(laser: str | LaserModel) -> LaserModel:
    """Look up a preset by its name; a model is returned as it is.

    Raises
    ------
    ConfigError
        No preset has this name.
    """
    if isinstance(laser, LaserModel):
        return laser
    if laser not in LASERS:
        raise ConfigError(f"no laser is named {laser!r} (there are: {', '.join(sorted(LASERS))})")
    return LASERS[laser]
