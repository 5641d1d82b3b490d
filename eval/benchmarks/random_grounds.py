"""Grounds outdoors that nobody has tuned for: everything about them follows from their number.

Buildings seen from outside, trees, bushes that beams go some way into, cars; ground so rough that beams end on it. Six
lasers, most of them of long range; odometry, troubles and people as in `random_buildings`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from random_buildings import ODOMETRY, people_around, stand, troubled

from hsslam.datasets.simulator import FloorPlan, LaserModel, SimulatedDataset, laser_model
from hsslam.datasets.simulator.path import DriveModel
from hsslam.datasets.simulator.raycast import raycast
from hsslam.datasets.simulator.solids import box, pillar
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Poses, compose_many, pose

LASERS = (
    laser_model("sick-lms200"),
    replace(laser_model("sick-lms200"), name="half-degree", beams=361, angle_increment=math.radians(0.5)),
    replace(laser_model("sick-lms200"), name="lms-30m", range_max=30.0),
    LaserModel(
        "utm-30lx", 1081, math.radians(-135.0), math.radians(0.25), 0.1, 30.0, 0.01, 0.003, 0.001, 0.01
    ),
    LaserModel("lms1xx", 541, math.radians(-135.0), math.radians(0.5), 0.5, 20.0, 0.012, 0.0, 0.001, 0.01),
    LaserModel("round-25", 720, -math.pi, math.radians(0.5), 0.15, 25.0, 0.02, 0.002, 0.001, 0.03),
)

HEIGHT = 0.6
"""Of the laser above the ground (m)."""

INTO_LEAVES = 0.08
"""How far a beam goes into a bush on average (m)."""

THROUGH_LEAVES = 0.1
"""Share of the beams that go through a bush."""

LASTING = 0.8
"""Share of a tilt that is left a scan later."""

DENSITY = {"campus": 0.004, "park": 0.012, "parking": 0.002}
"""Trees per square metre, about."""

CAR = (1.8, 4.4)
"""Width and length (m)."""


@dataclass(frozen=True)
class Grounds:
    """A drive outdoors.

    Attributes
    ----------
    number : int
        Everything follows from it.
    dataset : SimulatedDataset
        What is hard to beams; laser, robot; odometry before `trouble`.
    leaves : FloorPlan
        What beams go into.
    trouble : str
        What befalls odometry, as in `random_buildings`.
    crossing : int
        People who cross the robot's way.
    rough : float
        Standard deviation of the robot's pitch and roll (rad).
    """

    number: int
    dataset: SimulatedDataset
    leaves: FloorPlan
    trouble: str
    crossing: int
    rough: float

    @property
    def name(self) -> str:
        """What is hard about it, for a table."""
        d = self.dataset
        people = f"{self.crossing} people" if self.crossing else ""
        words = (d.plan.name, d.laser.name, d.plan.description, self.trouble, people)
        return f"{self.number:4} " + " ".join(word for word in words if word)

    def scans(self) -> Iterator[LaserScan]:
        """The drive, scan by scan."""
        d, rng = self.dataset, np.random.default_rng([self.number, 1])
        geometry, beams = d.laser.geometry, d.laser.beams
        odometry = troubled(d.odometry, self.trouble, rng)
        people = people_around(d.poses, self.crossing, 0, rng)
        lasers = compose_many(d.poses, np.tile(d.laser_pose, (len(d.poses), 1)))
        angles, tilt = geometry.angles(beams), np.zeros(2)
        for i, laser in enumerate(lasers):
            leaves = raycast(self.leaves.segments, laser, geometry, beams)
            leaves = leaves + rng.exponential(INTO_LEAVES, beams)
            leaves[rng.random(beams) < THROUGH_LEAVES] = math.inf
            distances = np.minimum(raycast(d.plan.segments, laser, geometry, beams), leaves)
            if self.rough > 0.0:
                fresh = math.sqrt(1.0 - LASTING**2) * self.rough * rng.standard_normal(2)
                tilt = LASTING * tilt + fresh
                distances = np.minimum(distances, _to_ground(angles, tilt, rng))
            ranges = d.laser.measure(distances, rng)
            scan = LaserScan(
                stamp=float(d.stamps[i]),
                ranges=ranges,
                geometry=geometry,
                odometry=odometry[i].copy(),
                laser_pose=d.laser_pose,
                index=i,
            )
            for person in people[i]:
                stand(ranges, scan, laser, person, rng)
            yield scan


def grounds(number: int) -> Grounds:
    """Draw the grounds of a number."""
    rng = np.random.default_rng([77, number])
    kind = str(rng.choice(["campus", "park", "parking"]))
    size = float(rng.uniform(40.0, 130.0))
    hard, leaves, route = _laid_out(kind, size, rng)
    laser = LASERS[int(rng.integers(len(LASERS)))]
    quality = str(rng.choice(["good", "good", "bad", "worst"]))
    trouble = str(rng.choice(["", "", "", "", "jumps", "outages", "none"]))
    crossing = int(rng.integers(1, 5)) if rng.random() < 0.3 else 0
    rough = math.radians(float(rng.choice([0.0, 0.0, 0.3, 0.6])))
    mounted = pose(0.0, 0.0, 0.0)
    if rng.random() < 0.5:
        mounted = pose(rng.uniform(-0.3, 0.3), rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1))
    rate, speed = float(rng.choice([4.0, 5.0, 10.0])), float(rng.uniform(0.5, 1.5))
    legs = np.diff(np.vstack((route, route[:1])), axis=0)
    length = float(np.hypot(legs[:, 0], legs[:, 1]).sum())
    words = (
        f"{len(hard)} + {len(leaves)} solids",
        f"{quality} odometry",
        f"{rate:.0f}/s",
        f"rough by {math.degrees(rough):.1f}",
    )
    dataset = SimulatedDataset(
        FloorPlan(kind, ", ".join(words), tuple(hard), route),
        seed=number,
        # One and a half rounds, as in `random_buildings`.
        scans=int(min(1.6 * length / speed * rate * 1.2 + 50, 4000)),
        laser=laser,
        odometry=ODOMETRY[quality],
        laser_pose=mounted,
        motion=DriveModel(rate=rate, speed=speed, turn_rate=float(rng.uniform(0.5, 1.2))),
    )
    return Grounds(number, dataset, FloorPlan("leaves", "", tuple(leaves), route), trouble, crossing, rough)


def _laid_out(kind: str, size: float, rng: np.random.Generator) -> tuple[list[Points], list[Points], Points]:
    """What is hard, what is leafy, and the route between them."""
    corners = int(rng.integers(5, 10))
    bearings = np.sort(rng.uniform(0.0, 2.0 * math.pi, corners))
    away = size * rng.uniform(0.2, 0.48, corners)
    route = np.column_stack((away * np.cos(bearings), away * np.sin(bearings)))
    shares = np.linspace(0.0, 1.0, 200)[:, None, None]
    way = (route + shares * (np.roll(route, -1, axis=0) - route)).reshape(-1, 2)

    def free(place: NDArray[np.float64], least: float) -> bool:
        return bool(np.hypot(*(way - place).T).min() > least)

    def clear(outline: Points, least: float) -> bool:
        edges = [outline + t * (np.roll(outline, -1, axis=0) - outline) for t in np.arange(8) / 8.0]
        apart = np.vstack(edges)[:, None, :] - way[None]
        inside = FloorPlan("one", "", (outline,), route).inside_solid(way)
        return bool((apart**2).sum(axis=-1).min() > least**2 and not inside.any())

    hard: list[Points] = []
    buildings = {"campus": int(rng.integers(2, 9)), "park": 0, "parking": 2}[kind]
    for _ in range(20 * buildings):
        outline = _building(rng, 0.7 * size)
        if clear(outline, 2.0):
            hard.append(outline)
        if len(hard) == buildings:
            break
    trees = int(DENSITY[kind] * (1.4 * size) ** 2 * rng.uniform(0.3, 1.5))
    places = rng.uniform(-0.75 * size, 0.75 * size, (trees, 2))
    hard += [pillar(x, y, rng.uniform(0.06, 0.35), 10) for x, y in places if free(np.array([x, y]), 1.2)]
    leaves = []
    for _ in range(int(0.3 * trees * rng.uniform(0.0, 1.5))):
        place, extent = rng.uniform(-0.75 * size, 0.75 * size, 2), float(rng.uniform(0.4, 1.5))
        if free(place, 1.0 + 1.1 * extent):
            leaves.append(_bush(rng, place, extent))
    hard += [car for car in _cars(kind, size, rng) if clear(car, 1.0)]
    # Far out of sight, so that there is always something.
    return hard or [pillar(500.0, 0.0, 0.2)], leaves or [pillar(-500.0, 0.0, 0.2)], route


def _building(rng: np.random.Generator, farthest: float) -> Points:
    """A rectangle whose sides have recesses: windows and doors."""
    x, y = rng.uniform(-farthest, farthest, 2)
    width, depth = rng.uniform(8.0, 40.0), rng.uniform(8.0, 25.0)
    turned = float(rng.choice([0.0, 0.0, rng.uniform(0.0, 1.5)]))
    corners = 0.5 * np.array([[-width, -depth], [width, -depth], [width, depth], [-width, depth]])
    outline: list[NDArray[np.float64]] = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.hypot(*(b - a)))
        along = (b - a) / length
        inward = np.array([-along[1], along[0]])
        outline.append(a)
        at = float(rng.uniform(1.0, 4.0))
        while at < length - 2.0:
            wide, deep = rng.uniform(0.8, 2.0), rng.uniform(0.1, 0.4)
            first, last = a + at * along, a + (at + wide) * along
            outline += [first, first + deep * inward, last + deep * inward, last]
            at += wide + rng.uniform(1.0, 5.0)
    c, s = math.cos(turned), math.sin(turned)
    placed: Points = np.array([x, y]) + np.array(outline) @ np.array([[c, s], [-s, c]])
    return placed


def _bush(rng: np.random.Generator, place: NDArray[np.float64], extent: float) -> Points:
    """An irregular outline."""
    corners = int(rng.integers(9, 16))
    bearings = np.sort(rng.uniform(0.0, 2.0 * math.pi, corners))
    away = extent * rng.uniform(0.55, 1.1, corners)
    outline: Points = place + np.column_stack((away * np.cos(bearings), away * np.sin(bearings)))
    return outline


def _cars(kind: str, size: float, rng: np.random.Generator) -> Iterator[Points]:
    """In rows on a car park, here and there on a campus."""
    if kind == "parking":
        for row in np.arange(-0.6 * size, 0.6 * size, rng.uniform(9.0, 14.0)):
            for x in np.arange(-0.6 * size, 0.6 * size, 2.7):
                if rng.random() < 0.7:
                    yield box(float(x), float(row), *CAR, float(rng.normal(0.0, 2.0)))
    elif kind == "campus":
        for _ in range(int(rng.integers(0, 20))):
            x, y = rng.uniform(-0.6 * size, 0.6 * size, 2)
            yield box(float(x), float(y), *CAR, float(rng.uniform(0.0, 180.0)))


def _to_ground(
    angles: NDArray[np.float64], tilt: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """Distances at which beams meet the ground, the robot's pitch and roll being ``tilt`` (rad)."""
    down = tilt[0] * np.cos(angles) + tilt[1] * np.sin(angles)
    distances = np.where(down > 1e-4, HEIGHT / np.tan(np.maximum(down, 1e-4)), math.inf)
    uneven: Poses = distances * (1.0 + 0.02 * rng.standard_normal(len(angles)))
    return uneven
