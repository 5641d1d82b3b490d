"""The benchmark script runs as its README says and leaves figures that can be read."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[1] / "eval" / "benchmarks" / "match_time.py"


def test_match_time_prints_a_row_per_matcher_and_writes_json(tmp_path: Path) -> None:
    written = tmp_path / "figures.json"
    command = [
        sys.executable,
        str(SCRIPT),
        "--matchers",
        "hsl",
        "hide",
        "--count",
        "4",
        "--json",
        str(written),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("office: 4 simulated trials, seed 0")
    assert [line.split()[0] for line in lines[1:]] == ["matcher", "hsl", "hide"]
    record = json.loads(written.read_text(encoding="utf-8"))
    assert [summary["trials"] for summary in record["matchers"]] == [4, 4]
    assert record["config"]["seed"] == 0
    assert record["environment"]["cpu"]
