"""CPU time of ``hsslam --help`` and of completion, in seconds: the median of several runs, interpreter included.

Run it with ``python eval/benchmarks/startup.py``; the target for each is 0.25 s. ``--check`` makes it the exit code.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

TARGET = 0.25
VERBS = (["--help"], ["--version"], ["run", "--help"], ["compare", "--help"], ["plugin", "--help"])
TYPED = ("hsslam ", "hsslam run --mat", "hsslam run --matcher h", "hsslam compare off")
"""Lines whose end the shell asks hsslam to complete."""


def cpu_seconds(command: list[str], environment: dict[str, str] | None = None) -> float:
    """User and system time of a command and what it starts (s)."""
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **(environment or {})},
    )
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(command)} failed: exit status {os.waitstatus_to_exitcode(status)}")
    process.returncode = 0
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Measure and print a line per verb."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=9, help="runs of each")
    parser.add_argument("--check", action="store_true", help="exit code 1 where one takes longer")
    options = parser.parse_args()
    runs: int = options.runs
    beside = Path(sys.executable).with_name("hsslam")
    hsslam = str(beside) if beside.exists() else shutil.which("hsslam")
    if hsslam is None:
        raise SystemExit("hsslam is not installed in this environment")
    interpreter = statistics.median(cpu_seconds([sys.executable, "-c", "pass"]) for _ in range(runs))
    print(f"{'python -c pass':28} {interpreter:.3f} s")
    cases: list[tuple[str, list[str], dict[str, str]]] = [
        *((" ".join(["hsslam", *verb]), [hsslam, *verb], {}) for verb in VERBS),
        *((f"{line}<Tab>", [hsslam], completion(line)) for line in TYPED),
    ]
    slow = 0
    for name, command, environment in cases:
        cpu_seconds(command, environment)  # byte code and disk caches
        times = sorted(cpu_seconds(command, environment) for _ in range(runs))
        median = statistics.median(times)
        slow += median > TARGET
        print(f"{name:28} {median:.3f} s ({times[0]:.3f} to {times[-1]:.3f}, {runs} runs)")
    if options.check and slow:
        raise SystemExit(f"{slow} of {len(cases)} take longer than {TARGET} s of processor time")


def completion(line: str) -> dict[str, str]:
    """Set what bash sets when it asks how a line may go on."""
    words = line.split(" ")
    return {"_HSSLAM_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}


if __name__ == "__main__":
    main()
