"""Rounds of corridor hundreds of metres long: how far SLAM drifts on the way, and whether it closes the round.

    python eval/benchmarks/long_corridors.py --first 0 --count 8 [--odometry good,bad] [--set KEY=VALUE ...]

Bare corridors, 120 to 220 m by 80 to 160 m, doors every few metres and boxes along the walls, a SICK LMS 200, five
scans a second at 0.6 m/s, one round and a quarter. A row per drive: RMS of the absolute error at the end, the largest
while driving (m), loops, and the keyframe that the first of them closed at.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from random_buildings import ODOMETRY, corridor_ring

from hsslam.config import load_config
from hsslam.datasets.simulator import FloorPlan, SimulatedDataset, laser_model
from hsslam.datasets.simulator.path import DriveModel
from hsslam.datasets.simulator.solids import box
from hsslam.slam.pipeline import Slam
from hsslam_eval.metrics import ate

SPEED, RATE = 0.6, 5.0
"""Of the robot (m/s), and of its laser (1/s)."""

ROUNDS = 1.25
TURNING = 1.15
"""Times as long as the way alone takes, since the robot turns at corners."""


def ring(number: int, odometry: str) -> SimulatedDataset:
    """The drive of a number, round a building that follows from it."""
    rng = np.random.default_rng([number, 7])
    width, height = rng.uniform(120.0, 220.0), rng.uniform(80.0, 160.0)
    wide, every = rng.uniform(2.0, 3.2), rng.uniform(3.0, 9.0)
    solids, route = corridor_ring(rng, width, height, wide, every)
    for _ in range(int(rng.integers(20, 80))):
        off, along = rng.choice([0.25, wide - 0.25]), rng.uniform(0.05, 0.95)
        x, y = [
            (along * width, off),
            (along * width, height - off),
            (off, along * height),
            (width - off, along * height),
        ][int(rng.integers(4))]
        solids.append(box(x, y, rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.6), 0.0))
    length = 2.0 * (width + height)
    return SimulatedDataset(
        FloorPlan("long corridors", f"{width:.0f} x {height:.0f} m", tuple(solids), route),
        seed=number,
        scans=int(ROUNDS * TURNING * length / SPEED * RATE),
        laser=laser_model("sick-lms200"),
        odometry=ODOMETRY[odometry],
        motion=DriveModel(rate=RATE, speed=SPEED, turn_rate=0.8),
    )


def drive(number: int, odometry: str, settings: list[str]) -> str:
    """The row of a drive."""
    log = ring(number, odometry)
    result = Slam(load_config(overrides=settings)).solve(log.scans())
    truth = log.truth()
    online = np.hypot(*(result.online.poses - truth.poses)[:, :2].T).max()
    loops = [loop.second for loop in result.loops if loop.accepted]
    return (
        f"{ate(result.trajectory, truth).summary()['translation_rmse_m']:8.3f}  {online:8.2f}  {len(loops):6}"
        f"  {min(loops, default=-1):5} of {len(result.keyframes):5}"
        f"  {number:3} {log.plan.description}, {odometry} odometry, {len(truth.poses)} scans"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--odometry", default="good,bad")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.count)
    drives = [(number, odometry) for odometry in arguments.odometry.split(",") for number in numbers]
    print(" final m  driving m   loops  first at keyframe  building")
    with ProcessPoolExecutor(arguments.workers) as pool:
        for row in pool.map(drive, *zip(*drives, strict=True), [arguments.settings] * len(drives)):
            print(row, flush=True)


if __name__ == "__main__":
    main()
