"""CPU time of ``hsslam --help`` and its like, in seconds: the median of several runs, interpreter included.

Run it with ``python eval/benchmarks/startup.py``; the target for ``hsslam --help`` is 0.3 s.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

VERBS = (["--help"], ["--version"], ["run", "--help"], ["compare", "--help"], ["matchers", "--help"])


def cpu_seconds(command: list[str]) -> float:
    """User and system time of a command and what it starts (s)."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(command)} failed: exit status {os.waitstatus_to_exitcode(status)}")
    process.returncode = 0
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Measure and print a line per verb."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=9, help="runs of each")
    runs: int = parser.parse_args().runs
    beside = Path(sys.executable).with_name("hsslam")
    hsslam = str(beside) if beside.exists() else shutil.which("hsslam")
    if hsslam is None:
        raise SystemExit("hsslam is not installed in this environment")
    interpreter = statistics.median(cpu_seconds([sys.executable, "-c", "pass"]) for _ in range(runs))
    print(f"{'python -c pass':24} {interpreter:.3f} s")
    for verb in VERBS:
        cpu_seconds([hsslam, *verb])  # byte code and disk caches
        times = sorted(cpu_seconds([hsslam, *verb]) for _ in range(runs))
        name = " ".join(["hsslam", *verb])
        print(f"{name:24} {statistics.median(times):.3f} s ({times[0]:.3f} to {times[-1]:.3f}, {runs} runs)")


if __name__ == "__main__":
    main()
