"""Does SLAM slow down? The simulated office driven round and round, and the time each scan takes.

    python eval/benchmarks/long_run.py [--scans 100000] [--block 1000] [--set KEY=VALUE ...] [--png FILE] [--json FILE]

Prints a row per block of scans: processor time per scan (median and mean), that of a fixed piece of work, time per
stage, keyframes, loops and peak memory; at the end how much longer a scan of the last tenth took than one of the first,
as it is and over the fixed piece of work: where other programs run, they slow both. Kernels are compiled before
the clock starts. The online pass alone is timed: what `finish` does runs once.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from hsslam.config import Config, load_config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.slam.events import KeyframeAdded, LoopChecked
from hsslam.slam.pipeline import Slam
from hsslam.slam.windows import search_window


@dataclass(frozen=True)
class Block:
    """What some scans in a row cost: processor time per scan and of the yardstick (ms), wall time by stage (s)."""

    last_scan: int
    median_ms: float
    mean_ms: float
    yardstick_ms: float
    seconds: dict[str, float]
    keyframes: int
    loops: int
    accepted: int
    peak_mb: float


class Yardstick:
    """A fixed piece of work, much like a scan's, measured again and again: how fast the machine is just now."""

    EVERY = 10
    """Scans between two measurements."""

    def __init__(self, config: Config) -> None:
        first, *_, last = SimulatedDataset("office", scans=40).scans()
        self._matcher = config.matcher.create()
        self._first, self._last = first.robot_points, last.robot_points
        self._config = config
        self.measure()

    def measure(self) -> float:
        """Processor time (ms) of it."""
        began = time.process_time()
        window = search_window(self._config.tracker.window)
        reference = self._matcher.prepare(self._first)
        self._matcher.match(reference, self._last, np.zeros(3), window, np.random.default_rng(0))
        return 1e3 * (time.process_time() - began)


def drive(config: Config, scans: int, block: int, seed: int) -> Iterator[Block]:
    """Run the online pass over the office, driven round until there are enough scans; a `Block` at a time."""
    warm = Slam(config)
    for scan in SimulatedDataset("office", seed=seed + 1, scans=400).scans():
        warm.process(scan)
    slam = Slam(config)
    yardstick = Yardstick(config)
    times: list[float] = []
    pieces: list[float] = []
    keyframes = loops = accepted = 0
    before: dict[str, float] = {}
    for scan in SimulatedDataset("office", seed=seed, scans=scans).scans():
        began = time.process_time()
        events = slam.process(scan)
        times.append(1e3 * (time.process_time() - began))
        if scan.index % Yardstick.EVERY == 0:
            pieces.append(yardstick.measure())
        keyframes += sum(isinstance(event, KeyframeAdded) for event in events)
        checked = [event for event in events if isinstance(event, LoopChecked)]
        loops, accepted = loops + len(checked), accepted + sum(loop.accepted for loop in checked)
        if len(times) == block:
            now = slam.result().seconds
            stages = {stage: seconds - before.get(stage, 0.0) for stage, seconds in now.items()}
            before = now
            yield Block(
                scan.index,
                statistics.median(times),
                statistics.fmean(times),
                statistics.fmean(pieces),
                stages,
                keyframes,
                loops,
                accepted,
                peak_megabytes(),
            )
            times, pieces = [], []


def peak_megabytes() -> float:
    """Largest resident memory of this process so far (MB)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1 << 20) if sys.platform == "darwin" else peak / 1024


def growth(blocks: list[Block]) -> dict[str, float]:
    """Time per scan of the last tenth over that of the first: of medians, of means, and of means in yardsticks."""
    tenth = max(len(blocks) // 10, 1)
    start, end = blocks[:tenth], blocks[-tenth:]

    def ratio(time_of: Callable[[Block], float]) -> float:
        return statistics.fmean(map(time_of, end)) / statistics.fmean(map(time_of, start))

    mean = ratio(lambda b: b.mean_ms)
    return {
        "median": ratio(lambda b: b.median_ms),
        "mean": mean,
        "mean in yardsticks": mean / ratio(lambda b: b.yardstick_ms),
    }


def draw(blocks: list[Block], path: Path) -> None:
    """Plot time per scan, whole and by stage, against the number of scans."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 6), layout="constrained")
    whole, stages = figure.subplots(2, 1, sharex=True)
    scans = [(block.last_scan + 1) / 1e3 for block in blocks]
    whole.plot(scans, [block.mean_ms for block in blocks], label="mean")
    whole.plot(scans, [block.median_ms for block in blocks], label="median")
    whole.plot(
        scans, [block.yardstick_ms for block in blocks], label="a fixed piece of work", linestyle="dotted"
    )
    whole.set(ylabel="processor time per scan (ms)", ylim=(0, None))
    whole.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    size = blocks[0].last_scan + 1
    for stage in sorted({stage for block in blocks for stage in block.seconds}):
        stages.plot(scans, [1e3 * block.seconds.get(stage, 0.0) / size for block in blocks], label=stage)
    stages.set(xlabel="thousand scans", ylabel="wall time per scan by stage (ms)", ylim=(0, None))
    stages.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    figure.savefig(path, dpi=72)


def main() -> None:
    """Run, print the table, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", type=int, default=100_000)
    parser.add_argument("--block", type=int, default=1000, help="scans per row")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--png", type=Path, help="where to plot")
    parser.add_argument("--json", type=Path, help="where to keep the figures")
    arguments = parser.parse_args()
    config = load_config(overrides=[f"seed={arguments.seed}", *arguments.settings])
    blocks: list[Block] = []
    print("   scans median ms mean ms yardstick keyframes   loops accepted peak MB  stages (ms per scan)")
    for block in drive(config, arguments.scans, arguments.block, arguments.seed):
        blocks.append(block)
        stages = " ".join(
            f"{stage} {1e3 * seconds / arguments.block:.3f}"
            for stage, seconds in sorted(block.seconds.items())
        )
        print(
            f"{block.last_scan + 1:8} {block.median_ms:9.3f} {block.mean_ms:7.3f} {block.yardstick_ms:9.3f} "
            f"{block.keyframes:9} {block.loops:7} {block.accepted:8} {block.peak_mb:7.0f}  {stages}",
            flush=True,
        )
    if not blocks:
        raise SystemExit(f"--scans {arguments.scans} is less than one block of {arguments.block}")
    ratios = growth(blocks)
    told = ", ".join(f"{name} x {ratio:.2f}" for name, ratio in ratios.items())
    print(f"last tenth over first tenth: {told} (seed {arguments.seed})")
    if arguments.png:
        draw(blocks, arguments.png)
    if arguments.json:
        figures = {"seed": arguments.seed, "ratios": ratios}
        arguments.json.write_text(
            json.dumps({**figures, "blocks": [asdict(block) for block in blocks]}, indent=1), encoding="utf-8"
        )


if __name__ == "__main__":
    main()
