"""How far a log's relations can be trusted: they against direct matches of their own two scans, and against a run.

    python eval/benchmarks/relations_noise.py mit-csail [--run RUN_FOLDER] [--data-dir DIR]

Below the error that two scans matched directly have, no trajectory can be told from a better one. With a run, its worst
relations are listed: the share of the second scan's returns within 5 cm of the first scan's surface, at the relation's
pose and at the run's.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

from hsslam.datasets.catalogue import open_dataset
from hsslam.io.tum import read_tum
from hsslam.kernels.assess import assess
from hsslam.matching import SearchWindow, create
from hsslam.se2 import Points, Pose, Poses, between, between_many, wrap

WINDOW = SearchWindow(0.3, 0.3, math.radians(10.0))
"""Around the relation."""

SOON = 30
"""Scans between the two of a relation, at most, if both are of the same visit."""

DISTANCE = 0.05
"""Returns within it of the surface are explained (m)."""


def errors(found: Poses, relations: Poses) -> tuple[np.ndarray, np.ndarray]:
    """Distances (m) and turns (deg) between relative poses (N, 3) and the relations."""
    off = found - relations
    return np.hypot(off[:, 0], off[:, 1]), np.degrees(np.abs([wrap(theta) for theta in off[:, 2]]))


def explained(first: Points, second: Points, relative: Pose) -> float:
    """Share of the second scan's returns near the surface of the first."""
    surface = create("hide").prepare(first).surface
    return float(assess(surface, second, np.ascontiguousarray(relative), WINDOW.half, DISTANCE)[0])


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset")
    parser.add_argument("--data-dir", type=Path)
    parser.add_argument("--run", type=Path, help="a run folder over the whole log")
    parser.add_argument("--matchers", nargs="+", default=["hide", "pl_icp", "csm", "icp"])
    parser.add_argument("--worst", type=int, default=8, help="relations of the run to list")
    arguments = parser.parse_args()
    log = open_dataset(arguments.dataset, data_dir=arguments.data_dir)
    relations = log.relations()
    if relations is None:
        parser.error(f"{arguments.dataset} has no relations")
    points = [scan.robot_points for scan in log.scans()]
    pairs = list(zip(relations.first.tolist(), relations.second.tolist(), strict=True))
    soon = relations.second - relations.first <= SOON
    print(
        f"{len(pairs)} relations, {soon.sum()} of one visit; mean distance m and turn deg from the relation"
    )
    print("who          one visit           two visits")

    def row(name: str, found: Poses) -> None:
        distance, turn = errors(found, relations.poses)
        cells = (f"{distance[m].mean():.4f} m {turn[m].mean():.3f} deg" for m in (soon, ~soon))
        print(f"{name:10}   " + "   ".join(cells), flush=True)

    for name in arguments.matchers:
        matcher, found = create(name), relations.poses.copy()
        for k, (first, second) in enumerate(pairs):
            reference, rng = matcher.prepare(points[first]), np.random.default_rng(k)
            found[k] = matcher.match(reference, points[second], relations.poses[k], WINDOW, rng).pose
        row(name, found)
    if arguments.run is None:
        return
    poses = read_tum(arguments.run / "trajectory.tum").poses
    found = between_many(poses[relations.first], poses[relations.second])
    row("the run", found)
    distance, _ = errors(found, relations.poses)
    print("\nrelation  scans            off m   explained by the relation, by the run")
    for k in np.argsort(-distance)[: arguments.worst]:
        first, second = pairs[k]
        relative = between(poses[first], poses[second])
        shares = [explained(points[first], points[second], pose) for pose in (relations.poses[k], relative)]
        print(f"{k:8}  {first:6} {second:6}   {distance[k]:7.3f}   {shares[0]:.2f}  {shares[1]:.2f}")


if __name__ == "__main__":
    main()
