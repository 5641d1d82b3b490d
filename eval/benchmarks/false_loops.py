"""What false loops do to a map: SLAM with and without them, for every way to distrust loops.

    python eval/benchmarks/false_loops.py office [--count 50] [--seeds 3] [--set KEY=VALUE ...]
    python eval/benchmarks/false_loops.py intel --data-dir DIR

The log is driven through once; then false loops are put among the true ones before the final optimisation, and the
run is finished: with a Cauchy loss, with graduated non-convexity, and with no loss. ``random`` loops join any two
keyframes by any relative pose; ``groups`` of five tell the same falsehood, as a corridor taken for another one does.
All claim to be as good as a true loop. The error is that of the finished trajectory: against the relations where the
dataset has some, else the RMS of the absolute error against the exact truth. Within 10 % of the clean run is the aim.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from hsslam.config import Config, load_config
from hsslam.datasets.catalogue import open_dataset
from hsslam.datasets.dataset import Dataset
from hsslam.scan import LaserScan
from hsslam.se2 import Poses, between, compose, pose
from hsslam.slam.events import Edge, Optimised, SlamResult
from hsslam.slam.pipeline import Slam
from hsslam_eval.accuracy import measure

GROUP = 5
"""False loops that tell the same."""

STRIDE = 2
"""Keyframes from one loop of a group to the next."""

REACH = 3.0
"""A false loop puts its keyframes this near to one another (m), as a true one does."""

CONFIDENT = np.diag([0.01**2, 0.01**2, math.radians(0.25) ** 2])
"""The covariance false loops claim."""

CONSISTENCY = np.array([0.01, 0.01, math.radians(0.25)])
"""How well the loops of a group agree (m, m, rad)."""


def random_loops(poses: Poses, count: int, rng: np.random.Generator) -> list[Edge]:
    """Loops between any two keyframes, each with a relative pose of its own."""
    ends = [np.sort(rng.choice(len(poses), 2, replace=False)) for _ in range(count)]
    return [Edge(int(a), int(b), _anywhere(rng), CONFIDENT, "loop") for a, b in ends]


def grouped_loops(poses: Poses, count: int, rng: np.random.Generator) -> list[Edge]:
    """Loops in groups of `GROUP`: a stretch of the way is taken for another stretch, by all of a group alike."""
    edges: list[Edge] = []
    length = GROUP * STRIDE
    while len(edges) < count:
        first = int(rng.integers(0, len(poses) - 2 * length))
        second = int(rng.integers(first + length, len(poses) - length))
        moved = compose(poses[first], _anywhere(rng))
        for k in range(0, length, STRIDE):
            there = compose(moved, between(poses[second], poses[second + k]))
            relative = between(poses[first + k], there) + CONSISTENCY * rng.standard_normal(3)
            edges.append(Edge(first + k, second + k, pose(*relative), CONFIDENT, "loop"))
    return edges[:count]


KINDS: dict[str, Callable[[Poses, int, np.random.Generator], list[Edge]]] = {
    "random": random_loops,
    "groups": grouped_loops,
}


def _anywhere(rng: np.random.Generator) -> Poses:
    x, y = rng.uniform(-REACH, REACH, 2)
    return pose(x, y, rng.uniform(-math.pi, math.pi))


class Unfinished:
    """A run that has seen all its scans and can be finished many times, with other loops and another loss."""

    def __init__(self, config: Config, scans: Iterable[LaserScan]) -> None:
        self._config = config
        self._slam = Slam(config)
        for scan in scans:
            self._slam.process(scan)
        before = self._slam.result()
        self.poses: Poses = before.keyframe_poses
        self._edges = list(before.edges)
        self._relatives = self._slam._scans.relatives.copy()

    @property
    def true_loops(self) -> int:
        """Loops that the run itself closed."""
        return sum(edge.kind == "loop" for edge in self._edges)

    def finish(self, robust: str, false: list[Edge]) -> tuple[SlamResult, int]:
        """Finish with these loops among the true ones; the result, and how many loops it disbelieves."""
        config = self._config.model_copy(
            update={"graph": self._config.graph.model_copy(update={"robust": robust})}
        )
        slam, graph = self._slam, self._slam._require_graph()
        slam._config, graph._config = config, config.graph
        slam._scans.relatives[:] = self._relatives
        graph.edges = list(self._edges)
        graph.poses[:] = self.poses
        for edge in false:
            graph.add_edge(edge)
        rejected = [event.rejected_loops for event in slam.finish() if isinstance(event, Optimised)]
        return slam.result(), rejected[-1]


def error_of(result: SlamResult, dataset: Dataset) -> float:
    """Mean error of the relations (m), or RMS of the absolute error against the truth (m)."""
    found = measure(result.trajectory, result.odometry, dataset.truth(), dataset.relations())
    if "relations" in found:
        return found["relations"]["translation_mean_m"]
    return found["ate"]["translation_rmse_m"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset", nargs="?", default="office")
    parser.add_argument("--data-dir", type=Path)
    parser.add_argument("--scans", type=int, help="only so many scans")
    parser.add_argument("--count", type=int, default=50, help="false loops")
    parser.add_argument("--seeds", type=int, default=3, help="draws of false loops")
    parser.add_argument("--robust", default="cauchy,gnc,none")
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE")
    arguments = parser.parse_args()
    dataset = open_dataset(arguments.dataset, data_dir=arguments.data_dir, scans=arguments.scans)
    run = Unfinished(load_config(overrides=arguments.settings), dataset.scans())
    print(
        f"{arguments.dataset}: {len(run.poses)} keyframes, {run.true_loops} true loops, {arguments.count} false ones"
    )
    print("loss    loops    clean m  median m   worst m  worst/clean  disbelieved", flush=True)
    for robust in arguments.robust.split(","):
        clean = error_of(run.finish(robust, [])[0], dataset)
        for kind, draw in KINDS.items():
            errors, rejected = [], []
            for seed in range(arguments.seeds):
                false = draw(run.poses, arguments.count, np.random.default_rng([seed, arguments.count]))
                result, disbelieved = run.finish(robust, false)
                errors.append(error_of(result, dataset))
                rejected.append(disbelieved)
            print(
                f"{robust:7} {kind:7} {clean:8.4f}  {statistics.median(errors):8.4f}  {max(errors):8.4f}"
                f"  {max(errors) / clean:11.3f}  {min(rejected)}-{max(rejected)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
