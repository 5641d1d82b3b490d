"""A real log as other robots would have recorded it: how far from its laser and its odometry the defaults still do.

    python eval/benchmarks/other_lasers.py intel [--variants NAME ...] [--seeds N] [--workers 2] [--json FILE]

A row per variant: error of the relations at the end (mean m, deg, worst m) and while driving, accepted loops, scans per
second. Every variant follows from the recorded scans and from its seed; relations go along where the laser is mounted
elsewhere, scans are left out, or the log runs backwards.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import load_config
from hsslam.datasets.catalogue import open_dataset
from hsslam.io.relations import Relations
from hsslam.scan import LaserScan
from hsslam.se2 import Pose, between, compose, inverse, pose
from hsslam.slam.pipeline import Slam
from hsslam_eval.relations_metric import relations_errors

MOUNTED = pose(0.25, -0.1, math.radians(30.0))
"""Of the laser on the robot, in the variant ``mounted``."""


@dataclass(frozen=True)
class Recording:
    """Scans in their order, and relations between them."""

    scans: list[LaserScan]
    relations: Relations


Variant = Callable[[Recording, np.random.Generator], Recording]
Motion = Callable[[Pose, np.random.Generator], Pose]
Ranges = Callable[[LaserScan, NDArray[np.float64], np.random.Generator], NDArray[np.float64]]


def ranges(change: Ranges) -> Variant:
    """Other ranges, scan by scan."""

    def changed(log: Recording, rng: np.random.Generator) -> Recording:
        return replace(
            log, scans=[replace(scan, ranges=change(scan, scan.ranges.copy(), rng)) for scan in log.scans]
        )

    return changed


def noisy(deviation: float, _: LaserScan, r: NDArray[np.float64], rng: np.random.Generator) -> Any:
    """Normal noise on every range."""
    return r + rng.normal(0.0, deviation, len(r))


def rounded(step: float, _: LaserScan, r: NDArray[np.float64], __: np.random.Generator) -> Any:
    """Ranges in whole steps."""
    return step * np.round(r / step)


def dropped(share: float, _: LaserScan, r: NDArray[np.float64], rng: np.random.Generator) -> Any:
    """Beams that come back empty, each by itself."""
    r[rng.random(len(r)) < share] = np.inf
    return r


def blocked(share: float, _: LaserScan, r: NDArray[np.float64], rng: np.random.Generator) -> Any:
    """Somebody close by in some direction, another one each time."""
    width = int(share * len(r))
    first = rng.integers(0, len(r) - width)
    r[first : first + width] = np.minimum(r[first : first + width], rng.uniform(0.5, 1.5))
    return r


def cut(farthest: float, scan: LaserScan, r: NDArray[np.float64], _: np.random.Generator) -> Any:
    """A laser that sees less far."""
    return np.where(r < farthest, r, np.inf)


def strut(
    beams: float, distance: float, _: LaserScan, r: NDArray[np.float64], __: np.random.Generator
) -> Any:
    """A part of the robot in the view: degrees about 45 degrees to the left."""
    middle, half = 0.75 * len(r), 0.5 * beams / 180.0 * len(r)
    r[int(middle - half) : int(middle + half)] = distance
    return r


def sparse(step: int, log: Recording, _: np.random.Generator) -> Recording:
    """Every so many-th beam."""
    geometry = log.scans[0].geometry
    geometry = replace(
        geometry,
        angle_increment=step * geometry.angle_increment,
        time_increment=step * geometry.time_increment,
    )
    return replace(
        log,
        scans=[replace(scan, ranges=scan.ranges[::step].copy(), geometry=geometry) for scan in log.scans],
    )


def narrow(degrees: float, log: Recording, _: np.random.Generator) -> Recording:
    """The middle of the view."""
    geometry = log.scans[0].geometry
    angles = geometry.angles(len(log.scans[0].ranges))
    seen = np.abs(angles) <= math.radians(degrees) / 2
    geometry = replace(geometry, angle_min=float(angles[seen][0]))
    return replace(
        log, scans=[replace(scan, ranges=scan.ranges[seen], geometry=geometry) for scan in log.scans]
    )


def clockwise(log: Recording, _: np.random.Generator) -> Recording:
    """Beams from the left to the right."""
    geometry = log.scans[0].geometry
    last = float(geometry.angles(len(log.scans[0].ranges))[-1])
    geometry = replace(geometry, angle_min=last, angle_increment=-geometry.angle_increment)
    return replace(
        log, scans=[replace(scan, ranges=scan.ranges[::-1].copy(), geometry=geometry) for scan in log.scans]
    )


def mounted(log: Recording, _: np.random.Generator) -> Recording:
    """The laser where the robot's middle is not: the robot is where it was seen from the laser."""
    back = inverse(MOUNTED)
    scans = [replace(scan, laser_pose=MOUNTED, odometry=compose(scan.odometry, back)) for scan in log.scans]
    relations = log.relations
    poses = np.array([compose(compose(MOUNTED, relative), back) for relative in relations.poses])
    return Recording(scans, Relations(relations.first, relations.second, poses))


def thinned(step: int, log: Recording, _: np.random.Generator) -> Recording:
    """Every so many-th scan; relations between those that are left."""
    first, second = log.relations.first, log.relations.second
    left = (first % step == 0) & (second % step == 0)
    relations = Relations(first[left] // step, second[left] // step, log.relations.poses[left])
    scans = [replace(scan, index=i) for i, scan in enumerate(log.scans[::step])]
    return Recording(scans, relations)


def backwards(log: Recording, _: np.random.Generator) -> Recording:
    """The drive from its end to its beginning; odometry smoothed, for messages that were late would come early."""
    last, end = len(log.scans) - 1, log.scans[-1].stamp
    before = log.scans[::-1]
    motions = [between(a.odometry, b.odometry) for a, b in pairwise(before)]
    there, scans = np.zeros(3), []
    for i, scan in enumerate(before):
        if i > 0:
            there = compose(there, np.mean(motions[max(i - 3, 0) : i + 2], axis=0))
        scans.append(replace(scan, index=i, stamp=end - scan.stamp, odometry=there))
    relations = log.relations
    return Recording(scans, Relations(last - relations.first, last - relations.second, relations.poses))


def by_odometry(
    change: Callable[[Pose, np.random.Generator], Pose], log: Recording, rng: np.random.Generator
) -> Recording:
    """Other odometry, motion by motion."""
    there, scans = log.scans[0].odometry, [log.scans[0]]
    for before, scan in pairwise(log.scans):
        there = compose(there, change(between(before.odometry, scan.odometry), rng))
        scans.append(replace(scan, odometry=there))
    return replace(log, scans=scans)


def held(step: int, log: Recording, _: np.random.Generator) -> Recording:
    """Odometry that comes less often than scans: the last message again, until there is a new one."""
    scans = [replace(scan, odometry=log.scans[i - i % step].odometry) for i, scan in enumerate(log.scans)]
    return replace(log, scans=scans)


def delayed(scans: int, log: Recording, _: np.random.Generator) -> Recording:
    """Odometry that comes so many scans late."""
    late = [replace(scan, odometry=log.scans[max(i - scans, 0)].odometry) for i, scan in enumerate(log.scans)]
    return replace(log, scans=late)


def interrupted(
    every: int, length: int, carried: bool, log: Recording, rng: np.random.Generator
) -> Recording:
    """A recording that pauses: of every so many scans, so many are missing; ``carried``: odometry does not know."""
    scans, relations = log.scans, log.relations
    left = np.ones(len(scans), dtype=np.bool_)
    for middle in range(every // 2, len(scans) - length - 1, every):
        first = middle + int(rng.integers(0, every // 4))
        left[first : first + length] = False
    numbers = np.flatnonzero(left).tolist()
    there, kept = scans[0].odometry, [scans[0]]
    for before, i in pairwise(numbers):
        if not (carried and i > before + 1):
            there = compose(there, between(scans[before].odometry, scans[i].odometry))
        kept.append(replace(scans[i], index=len(kept), odometry=there))
    known = left[relations.first] & left[relations.second]
    now = np.cumsum(left) - 1
    first, second = now[relations.first[known]], now[relations.second[known]]
    return Recording(kept, Relations(first, second, relations.poses[known]))


def none(motion: Pose, _: np.random.Generator) -> Pose:
    """No odometry."""
    return np.zeros(3)


def slipping(motion: Pose, rng: np.random.Generator) -> Pose:
    """Wheels a tenth too small that slip by a third, and turn by it."""
    return pose(*(1.1 * motion * (1.0 + rng.normal(0.0, 0.3, 3)) + (0.0, 0.0, 0.1 * motion[0])))


def jumping(motion: Pose, rng: np.random.Generator) -> Pose:
    """One motion in two hundred is something else."""
    return compose(motion, pose(*rng.normal(0.0, (0.5, 0.5, 0.5)))) if rng.random() < 0.005 else motion


VARIANTS: dict[str, tuple[str, Variant]] = {
    "recorded": ("as it was recorded", lambda log, _: log),
    "second-beams": ("every second beam", partial(sparse, 2)),
    "third-beams": ("every third beam", partial(sparse, 3)),
    "sixth-beams": ("every sixth beam", partial(sparse, 6)),
    "narrow-120": ("the middle 120 degrees", partial(narrow, 120.0)),
    "narrow-90": ("the middle 90 degrees", partial(narrow, 90.0)),
    "clockwise": ("beams from the left to the right", clockwise),
    "range-8": ("sees 8 m far", ranges(partial(cut, 8.0))),
    "range-4": ("sees 4 m far", ranges(partial(cut, 4.0))),
    "noise-3cm": ("3 cm of noise on every range", ranges(partial(noisy, 0.03))),
    "noise-6cm": ("6 cm of noise on every range", ranges(partial(noisy, 0.06))),
    "rounded-10cm": ("ranges in steps of 10 cm", ranges(partial(rounded, 0.1))),
    "dropped-half": ("half of the beams lost", ranges(partial(dropped, 0.5))),
    "blocked-third": ("somebody before a third of the view", ranges(partial(blocked, 1.0 / 3.0))),
    "strut-10": ("a strut of 10 degrees at 30 cm", ranges(partial(strut, 10.0, 0.3))),
    "strut-30": ("a box of 30 degrees at 60 cm", ranges(partial(strut, 30.0, 0.6))),
    "mounted": ("laser off the middle and turned", mounted),
    "second-scans": ("every second scan", partial(thinned, 2)),
    "third-scans": ("every third scan", partial(thinned, 3)),
    "backwards": ("from the end to the beginning, smooth odometry", backwards),
    "no-odometry": ("no odometry", partial(by_odometry, none)),
    "slipping": ("odometry 10 % too long, 30 % noise", partial(by_odometry, slipping)),
    "held-2": ("odometry with every second scan", partial(held, 2)),
    "held-4": ("odometry with every fourth scan", partial(held, 4)),
    "delayed-1": ("odometry a scan late", partial(delayed, 1)),
    "delayed-3": ("odometry three scans late", partial(delayed, 3)),
    "paused-30": ("30 scans in 2,000 missing", partial(interrupted, 2000, 30, False)),
    "paused-100": ("100 scans in 2,000 missing", partial(interrupted, 2000, 100, False)),
    "carried-10": ("10 in 2,000 missing, carried meanwhile", partial(interrupted, 2000, 10, True)),
    "carried-100": ("100 in 2,000 missing, carried meanwhile", partial(interrupted, 2000, 100, True)),
    "carried-often": ("30 in 500 missing, carried meanwhile", partial(interrupted, 500, 30, True)),
    "jumping": ("odometry that jumps every 200 scans", partial(by_odometry, jumping)),
}
"""What is done to the log, in words and in code."""


def drive(
    dataset: str, data_dir: Path | None, variant: str, seed: int, settings: list[str]
) -> dict[str, Any]:
    """One variant, driven through, finished and judged."""
    source = open_dataset(dataset, data_dir=data_dir)
    relations = source.relations()
    assert relations is not None
    change = VARIANTS[variant][1]
    log = change(Recording(list(source.scans()), relations), np.random.default_rng(seed))
    start = time.perf_counter()
    result = Slam(load_config(overrides=[f"seed={seed}", *settings])).solve(log.scans)
    seconds = time.perf_counter() - start
    final = relations_errors(result.trajectory, None, log.relations).summary()
    online = relations_errors(result.online, None, log.relations).summary()
    return {
        "dataset": dataset,
        "variant": variant,
        "seed": seed,
        "relations": len(log.relations),
        "final_m": final["translation_mean_m"],
        "final_deg": final["rotation_mean_deg"],
        "worst_m": final["translation_max_m"],
        "online_m": online["translation_mean_m"],
        "loops": sum(loop.accepted for loop in result.loops),
        "scans_per_second": len(log.scans) / seconds,
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset")
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--data-dir", type=Path)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args()
    if open_dataset(arguments.dataset, data_dir=arguments.data_dir).relations() is None:
        parser.error(f"{arguments.dataset} has no relations to judge it by")
    tasks = [(variant, seed) for variant in arguments.variants for seed in range(arguments.seeds)]
    job = partial(drive, arguments.dataset, arguments.data_dir)
    rows = []
    print(" final m  final deg  worst m  online m  loops  relations  scans/s  seed  variant")
    with ProcessPoolExecutor(arguments.workers) as pool:
        for row in pool.map(job, *zip(*tasks, strict=True), [arguments.settings] * len(tasks)):
            rows.append(row)
            print(
                f"{row['final_m']:8.4f}  {row['final_deg']:9.3f}  {row['worst_m']:7.3f}  {row['online_m']:8.4f}"
                f"  {row['loops']:5}  {row['relations']:9}  {row['scans_per_second']:7.0f}  {row['seed']:4}"
                f"  {row['variant']} ({VARIANTS[row['variant']][0]})",
                flush=True,
            )
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
