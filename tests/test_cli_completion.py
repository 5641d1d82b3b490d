"""The shell completes verbs, options, matchers and datasets, and nothing heavy is loaded for that."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


def completed(line: str, after: str = "") -> list[str]:
    """Ask the way bash does; ``after`` is run in the same process when it is done."""
    code = f"import atexit, sys\natexit.register(lambda: exec({after!r}))\nfrom hsslam.cli.main import main\n"
    words = {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)}
    done = subprocess.run(
        [sys.executable, "-c", f"{code}sys.argv = ['hsslam']\nmain()"],
        env={**os.environ, "_HSSLAM_COMPLETE": "complete_bash", **words},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return done.stdout.split()


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("hsslam com", ["compare"]),
        ("hsslam plugin ", ["check", "new"]),
        ("hsslam run --loop", ["--loop-matcher"]),
        ("hsslam run --matcher hi", ["hide"]),
        ("hsslam run --loop-matcher gl", ["glasm"]),
        ("hsslam run --preset urg", ["urg-04lx"]),
        ("hsslam compare off", ["office"]),
        ("hsslam compare office --matchers kiss", ["kiss_icp"]),
        ("hsslam compare --matchers hide h", ["hide", "hsl"]),
        ("hsslam compare office --matchers hide gl", ["glasm"]),
        ("hsslam compare --matchers hide,gl", ["hide,glasm"]),
        ("hsslam compare --matchers hsl hide --datasets office cor", ["corridor"]),
        ("hsslam compare office cor", ["corridor"]),
        ("hsslam compare corridor --matchers hide --see", ["--seed", "--seeds"]),
        ("hsslam compare corridor --seeds 2 --dataset off", ["office"]),
        ("hsslam matchers describe hs", ["hsl"]),
    ],
)
def test_completion_offers(line: str, offered: list[str]) -> None:
    assert sorted(completed(line)) == offered


@pytest.mark.parametrize("line", ["hsslam run --matcher h", "hsslam compare off"])
def test_completion_loads_nothing_heavy(line: str) -> None:
    heavy = "print(*{'numpy', 'numba', 'yaml', 'rich', 'gtsam', 'scipy'} & set(sys.modules))"
    assert completed(line, f"import sys; print('loaded:'); {heavy}")[-1] == "loaded:"
