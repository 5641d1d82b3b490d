"""SLAM in random buildings, or outdoors: how good it is where nobody tuned it, and what it loses.

    python eval/benchmarks/buildings.py --first 0 --count 40 [--workers 2] [--json FILE] [--set KEY=VALUE ...]
        [--carried] [--outdoors]

A row per world of `random_buildings` or `random_grounds`: RMS of the absolute error at the end and while driving (m),
accepted loops and how many of them are false (off by more than 0.3 m), sessions that are not tied together at the end,
scans per second. Below them the geometric mean and the worst. `--carried`: the recording pauses in the middle, and the
robot is carried. `--outdoors`: campuses, parks and car parks.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from random_buildings import carried, world
from random_grounds import grounds

from hsslam.config import load_config
from hsslam.se2 import between
from hsslam.slam.pipeline import Slam
from hsslam.trajectory import Trajectory
from hsslam_eval.metrics import ate

FALSE = 0.3
"""A loop off by more than this (m) is false."""


def drive(number: int, settings: list[str], pausing: bool = False, outdoors: bool = False) -> dict[str, Any]:
    """One world, driven through and finished."""
    chosen = grounds(number) if outdoors else world(number)
    scans = list(chosen.scans())
    if pausing:
        scans = carried(scans)
    start = time.perf_counter()
    result = Slam(load_config(overrides=settings)).solve(scans)
    seconds = time.perf_counter() - start
    whole = chosen.dataset.truth()
    numbers = [scan.index for scan in scans]
    truth = Trajectory(whole.stamps[numbers], whole.poses[numbers], np.arange(len(numbers)))
    keyframes = whole.poses[[scan.index for scan in result.keyframes]]
    accepted = [loop for loop in result.loops if loop.accepted]
    off = [
        between(loop.relative, between(keyframes[loop.first], keyframes[loop.second])) for loop in accepted
    ]
    return {
        "world": number,
        "name": chosen.name,
        "scans": len(scans),
        "final": ate(result.trajectory, truth).summary()["translation_rmse_m"],
        "online": ate(result.online, truth).summary()["translation_rmse_m"],
        "loops": len(accepted),
        "false": sum(math.hypot(error[0], error[1]) > FALSE for error in off),
        "sessions": result.statistics["sessions"],
        "seconds": seconds,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--first", type=int, default=0, help="number of the first world")
    parser.add_argument("--count", type=int, default=40, help="how many worlds")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--carried", action="store_true")
    parser.add_argument("--outdoors", action="store_true")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args()
    numbers = range(arguments.first, arguments.first + arguments.count)
    rows = []
    print(" final m  online m   loops false  sessions  scans/s  world")
    with ProcessPoolExecutor(arguments.workers) as pool:
        job = partial(
            drive, settings=arguments.settings, pausing=arguments.carried, outdoors=arguments.outdoors
        )
        for row in pool.map(job, numbers):
            rows.append(row)
            print(
                f"{row['final']:8.4f}  {row['online']:8.4f}  {row['loops']:6} {row['false']:5}"
                f"  {row['sessions']:8}  {row['scans'] / row['seconds']:7.0f}  {row['name']} ({row['scans']} scans)",
                flush=True,
            )
    finals = np.array([row["final"] for row in rows])
    print(
        f"geometric mean {np.exp(np.log(finals).mean()):.4f} m, mean {finals.mean():.4f} m, "
        f"worst {finals.max():.2f} m, over 0.1 m {(finals > 0.1).sum()} of {len(finals)}, "
        f"false loops {sum(row['false'] for row in rows)}"
    )
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
