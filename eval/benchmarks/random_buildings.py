"""Buildings, robots and troubles that nobody has tuned for: everything about a world follows from its number.

Three kinds of building: rooms behind doors, rings of corridor, halls. Eight lasers, some of them off the robot's
middle, one that spins; odometry from good to useless, that jumps, stops telling, or is not there; people who cross the
way, or walk along with the robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hsslam.datasets.simulator import FloorPlan, LaserModel, OdometryModel, SimulatedDataset, laser_model
from hsslam.datasets.simulator.path import DriveModel
from hsslam.datasets.simulator.solids import box, pillar, room, wall
from hsslam.scan import LaserScan
from hsslam.se2 import Points, Poses, between, compose, pose

DOOR = 0.95
"""Width of a door (m)."""

LASERS = (
    laser_model("sick-lms200"),
    replace(laser_model("sick-lms200"), name="half-degree", beams=361, angle_increment=math.radians(0.5)),
    replace(laser_model("sick-lms200"), name="eight-metres", range_max=8.0, no_return=8.19),
    laser_model("urg-04lx"),
    laser_model("rplidar-a2"),
    LaserModel(
        "utm-30lx", 1081, math.radians(-135.0), math.radians(0.25), 0.1, 30.0, 0.01, 0.003, 0.001, 0.01
    ),
    LaserModel("s300", 541, math.radians(-135.0), math.radians(0.5), 0.1, 29.9, 0.02, 0.0, 0.01, 0.01),
    LaserModel("cheap", 360, -math.pi, math.radians(1.0), 0.12, 6.0, 0.01, 0.02, 0.001, 0.03),
)

ODOMETRY = {
    "good": OdometryModel(),
    "bad": OdometryModel(0.06, 0.04, 0.06, 0.05, 0.06, 0.012),
    "worst": OdometryModel(0.15, 0.1, 0.15, 0.12, 0.15, 0.03),
}

JUMP = (0.8, math.radians(40.0))
"""Standard deviations of a jump of odometry (m, rad)."""


@dataclass(frozen=True)
class World:
    """A drive through a random building.

    Attributes
    ----------
    number : int
        Everything follows from it.
    dataset : SimulatedDataset
        Building, laser, robot; odometry before `trouble`.
    trouble : str
        What befalls odometry: ``""``, ``jumps``, ``outages``, ``none`` (there is no odometry).
    crossing, along : int
        People who cross the robot's way, and who walk along with it.
    """

    number: int
    dataset: SimulatedDataset
    trouble: str
    crossing: int
    along: int

    @property
    def name(self) -> str:
        """What is hard about it, for a table."""
        d = self.dataset
        people = f"{self.crossing}+{self.along} people" if self.crossing or self.along else ""
        words = (d.plan.name, d.laser.name, d.plan.description, self.trouble, people)
        return f"{self.number:4} " + " ".join(word for word in words if word)

    def scans(self) -> Iterator[LaserScan]:
        """The drive, scan by scan."""
        rng = np.random.default_rng([self.number, 1])
        odometry = troubled(self.dataset.odometry, self.trouble, rng)
        people = people_around(self.dataset.poses, self.crossing, self.along, rng)
        for scan in self.dataset.scans():
            ranges = scan.ranges.copy()
            laser = compose(self.dataset.poses[scan.index], scan.laser_pose)
            for person in people[scan.index]:
                stand(ranges, scan, laser, person, rng)
            yield replace(scan, ranges=ranges, odometry=odometry[scan.index].copy())


def carried(scans: list[LaserScan]) -> list[LaserScan]:
    """A recording without the tenth in its middle, during which the robot was carried: odometry does not know of it."""
    first, stop = int(0.45 * len(scans)), int(0.55 * len(scans))
    before, after = scans[first - 1].odometry, scans[stop].odometry
    return scans[:first] + [
        replace(scan, odometry=compose(before, between(after, scan.odometry))) for scan in scans[stop:]
    ]


def world(number: int) -> World:
    """Draw the world of a number."""
    rng = np.random.default_rng(number)
    kind = rng.choice(["rooms", "rooms", "ring", "hall"])
    laser = LASERS[int(rng.integers(len(LASERS)))]
    quality = str(rng.choice(["good", "good", "bad", "worst"]))
    trouble = str(rng.choice(["", "", "", "jumps", "outages", "none"]))
    crossing, along = (int(rng.integers(1, 5)), 0) if rng.random() < 0.3 else (0, 0)
    if rng.random() < 0.15:
        along = int(rng.integers(1, 4))
    mounted = pose(0.0, 0.0, 0.0)
    if rng.random() < 0.5:
        mounted = pose(rng.uniform(-0.3, 0.3), rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1))
    rate = float(rng.choice([2.0, 4.0, 5.0, 10.0]))
    speed = float(rng.uniform(0.3, 1.0))
    if laser.time_increment > 0.0:
        rate = min(rate, 0.999 / (laser.time_increment * laser.beams))
    plan = {"rooms": _rooms, "ring": _ring, "hall": _hall}[kind](rng)
    plan = replace(plan, description=f"{len(plan.solids)} solids, {quality} odometry, {rate:.0f}/s")
    legs = np.diff(np.vstack((plan.route, plan.route[:1])), axis=0)
    length = float(np.hypot(legs[:, 0], legs[:, 1]).sum())
    # One and a half rounds: all of the building, and enough of it twice.
    scans = int(min(1.6 * length / speed * rate * 1.35 + 50, 3000))
    dataset = SimulatedDataset(
        plan,
        seed=number,
        scans=scans,
        laser=laser,
        odometry=ODOMETRY[quality],
        laser_pose=mounted,
        motion=DriveModel(rate=rate, speed=speed, turn_rate=float(rng.uniform(0.5, 1.2))),
    )
    return World(number, dataset, trouble, crossing, along)


def _rooms(rng: np.random.Generator) -> FloorPlan:
    """A grid of rooms; a tree of doors joins all of them, a few more make rounds of it."""
    columns, rows = int(rng.integers(2, 7)), int(rng.integers(1, 5))
    xs = np.concatenate(([0.0], np.cumsum(rng.uniform(2.8, 8.0, columns))))
    ys = np.concatenate(([0.0], np.cumsum(rng.uniform(2.8, 7.0, rows))))
    cells = [(i, j) for i in range(columns) for j in range(rows)]
    walls = [((i, j), (i + 1, j)) for i, j in cells if i + 1 < columns]
    walls += [((i, j), (i, j + 1)) for i, j in cells if j + 1 < rows]
    order = rng.permutation(len(walls))
    group = {cell: cell for cell in cells}

    def top(cell: tuple[int, int]) -> tuple[int, int]:
        while group[cell] != cell:
            cell = group[cell]
        return cell

    open_walls = set()
    for k in order:
        a, b = walls[k]
        if top(a) != top(b) or rng.random() < 0.35:
            group[top(a)] = top(b)
            open_walls.add((a, b))
    solids = room(0.0, 0.0, float(xs[-1]), float(ys[-1]))
    gates: dict[tuple[tuple[int, int], tuple[int, int]], tuple[float, float]] = {}
    for a, b in walls:
        (i, j), across = a, b[0] > a[0]
        low, high = (ys[j], ys[j + 1]) if across else (xs[i], xs[i + 1])
        middle = float(rng.uniform(low + 0.8, high - 0.8))
        state = "open" if (a, b) in open_walls else "closed"
        axis, level = ("y", float(xs[i + 1])) if across else ("x", float(ys[j + 1]))
        solids += wall(axis, level, float(low), float(high), [(middle, DOOR, state)])  # type: ignore[arg-type,list-item]
        if state == "open":
            gates[a, b] = gates[b, a] = (level, middle) if across else (middle, level)
    middles = {(i, j): (0.5 * (xs[i] + xs[i + 1]), 0.5 * (ys[j] + ys[j + 1])) for i, j in cells}
    route = _tour(cells, gates, middles)
    solids += _furniture(rng, route, (float(xs[-1]), float(ys[-1])), int(rng.integers(0, 6)) * len(cells))
    return FloorPlan("rooms", "", tuple(solids), route)


def _tour(
    cells: list[tuple[int, int]],
    gates: dict[tuple[tuple[int, int], tuple[int, int]], tuple[float, float]],
    middles: dict[tuple[int, int], tuple[float, float]],
) -> Points:
    """Through every open door and back, depth first."""
    route: list[tuple[float, float]] = [middles[cells[0]]]
    seen: set[object] = set()

    def through(a: tuple[int, int], b: tuple[int, int]) -> None:
        x, y = gates[a, b]
        dx, dy = (0.6, 0.0) if a[0] != b[0] else (0.0, 0.6)
        side = 1.0 if b > a else -1.0
        route.extend([(x - side * dx, y - side * dy), (x + side * dx, y + side * dy), middles[b]])

    def visit(cell: tuple[int, int]) -> None:
        seen.add(cell)
        for a, b in gates:
            if a == cell and (a, b) not in seen:
                seen.update({(a, b), (b, a)})
                through(a, b)
                if b not in seen:
                    visit(b)
                through(b, a)

    visit(cells[0])
    return np.array(route[:-1] if len(route) > 3 else [*route, (route[0][0] + 1.0, route[0][1])])


def _ring(rng: np.random.Generator) -> FloorPlan:
    """A round of corridor, perhaps with a way across; niches and open rooms here and there."""
    width, height = rng.uniform(12.0, 70.0), rng.uniform(10.0, 40.0)
    wide, every = rng.uniform(1.6, 3.2), rng.uniform(2.0, 9.0)
    solids, route = corridor_ring(rng, width, height, wide, every)
    solids += _furniture(rng, route, (width, height), int(rng.integers(0, 25)), least=0.75)
    return FloorPlan("ring", "", tuple(solids), route)


def corridor_ring(
    rng: np.random.Generator, width: float, height: float, wide: float, every: float
) -> tuple[list[Points], Points]:
    """Walls of a round of corridor, ``wide`` (m), with closed doors ``every`` few metres, and the route along it."""

    def doors(low: float, high: float) -> list[tuple[float, float, str]]:
        middles = np.arange(low + 1.2, high - 1.2, every)
        middles = middles + rng.uniform(-0.3 * every, 0.3 * every, len(middles))
        return [(float(m), 0.9, "closed") for m in middles if low + 0.8 < m < high - 0.8]

    solids = []
    for inset in (0.0, wide):
        x1, y1, x2, y2 = inset, inset, width - inset, height - inset
        for axis, level, low, high in (
            ("x", y1, x1, x2),
            ("x", y2, x1, x2),
            ("y", x1, y1, y2),
            ("y", x2, y1, y2),
        ):
            solids += wall(axis, float(level), float(low), float(high), doors(low, high))  # type: ignore[arg-type]
    m = 0.5 * wide
    return solids, np.array([(m, m), (width - m, m), (width - m, height - m), (m, height - m)])


def _hall(rng: np.random.Generator) -> FloorPlan:
    """One large room with pillars and clutter."""
    width, height = rng.uniform(8.0, 40.0), rng.uniform(8.0, 25.0)
    solids = room(0.0, 0.0, width, height)
    route = np.column_stack((rng.uniform(1.5, width - 1.5, 9), rng.uniform(1.5, height - 1.5, 9)))
    solids += _furniture(rng, route, (width, height), int(rng.integers(3, 50)))
    return FloorPlan("hall", "", tuple(solids), route)


def _furniture(
    rng: np.random.Generator, route: Points, size: tuple[float, float], count: int, least: float = 0.7
) -> list[Points]:
    """Boxes and pillars that leave the route free by ``least`` (m)."""
    out = []
    ends = np.roll(route, -1, axis=0)
    shares = np.linspace(0.0, 1.0, 60)[:, None, None]
    way = (route + shares * (ends - route)).reshape(-1, 2)
    for _ in range(count):
        x, y = rng.uniform(0.3, size[0] - 0.3), rng.uniform(0.3, size[1] - 0.3)
        w, h = rng.uniform(0.2, 1.6), rng.uniform(0.2, 0.9)
        if np.hypot(way[:, 0] - x, way[:, 1] - y).min() < least + 0.5 * math.hypot(w, h):
            continue
        angle = float(rng.choice([0.0, 90.0, rng.uniform(0.0, 180.0)]))
        out.append(pillar(x, y, 0.5 * h, 10) if rng.random() < 0.2 else box(x, y, w, h, angle))
    return out


def troubled(odometry: Poses, trouble: str, rng: np.random.Generator) -> Poses:
    """Odometry after what befell it."""
    if trouble == "none":
        return np.zeros_like(odometry)
    if not trouble:
        return odometry
    out = odometry.copy()
    stop = 0
    for i in range(1, len(odometry)):
        step = between(odometry[i - 1], odometry[i])
        if trouble == "jumps" and rng.random() < 1.0 / 150.0:
            step = compose(step, pose(*(rng.standard_normal(3) * (JUMP[0], JUMP[0], JUMP[1]))))
        elif trouble == "outages":
            stop = int(rng.integers(5, 60)) if stop == 0 and rng.random() < 1.0 / 150.0 else max(stop - 1, 0)
            step = step if stop == 0 else np.zeros(3)
        out[i] = compose(out[i - 1], step)
    return out


def people_around(poses: Poses, crossing: int, along: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Where people stand at every scan, (S, P, 2) m."""
    out = np.empty((len(poses), crossing + along, 2))
    for p in range(crossing):
        away = math.inf
        for i, here in enumerate(poses):
            if away > 8.0:
                bearing, heading = rng.uniform(-math.pi, math.pi, 2)
                at = here[:2] + 6.0 * np.array([math.cos(bearing), math.sin(bearing)])
                step = rng.uniform(0.1, 0.4) * np.array([math.cos(heading), math.sin(heading)])
            at = at + step
            away = float(np.hypot(*(at - here[:2])))
            out[i, p] = at
    for p in range(crossing, crossing + along):
        bearing, distance = rng.uniform(-1.4, 1.4), rng.uniform(0.7, 2.0)
        for i, here in enumerate(poses):
            bearing += 0.02 * rng.standard_normal()
            distance = float(np.clip(distance + 0.02 * rng.standard_normal(), 0.6, 2.5))
            out[i, p] = here[:2] + distance * np.array(
                [math.cos(here[2] + bearing), math.sin(here[2] + bearing)]
            )
    return out


def stand(
    ranges: NDArray[np.float64],
    scan: LaserScan,
    laser: NDArray[np.float64],
    person: NDArray[np.float64],
    rng: np.random.Generator,
    radius: float = 0.2,
) -> None:
    """Put a person in the way of a scan's beams, in place."""
    dx, dy = person - laser[:2]
    distance = math.hypot(dx, dy)
    if distance <= radius + 0.05:
        return
    angles = scan.geometry.angles(len(ranges)) + laser[2] - math.atan2(dy, dx)
    across = distance * np.sin(angles)
    hit = (np.abs(across) < radius) & (np.cos(angles) > 0.0)
    front = distance * np.cos(angles[hit]) - np.sqrt(radius**2 - across[hit] ** 2)
    front = front + 0.01 * rng.standard_normal(len(front))
    nearer = (
        (front < ranges[hit])
        & (front > max(scan.geometry.range_min, 0.05))
        & (front < scan.geometry.range_max)
    )
    ranges[hit] = np.where(nearer, front, ranges[hit])
