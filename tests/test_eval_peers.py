"""The benchmark against peers: rows for what is installed, reasons for what is not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[1] / "eval" / "benchmarks" / "peers.py"


def test_rows_for_ours_for_peers_and_for_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "karto_scanmatcher.py").write_text("raise ImportError('no such thing here')\n")
    figures, table = tmp_path / "figures.json", tmp_path / "table.md"
    command = [sys.executable, str(SCRIPT), "--count", "4", "--matchers", "hide", "pl_icp"]
    command += ["--peers", "scipy", "karto-scanmatcher", "--json", str(figures), "--markdown", str(table)]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout == table.read_text(encoding="utf-8")
    rows = {line.split(" | ")[0][2:]: line for line in done.stdout.splitlines() if line.startswith("| ")}
    rows.pop("---")
    assert set(rows) == {"matcher", "hide", "pl_icp", "scipy DE, paper's fitness (peer)", "Karto (peer)"}
    assert "not installed: no such thing here" in rows["Karto (peer)"]
    assert len({row.count("|") for row in rows.values()}) == 1
    record = json.loads(figures.read_text(encoding="utf-8"))
    assert record["config"]["protocol"] == "simulated"
    by_name = {summary["matcher"]: summary for summary in record["matchers"]}
    assert by_name["scipy DE, paper's fitness (peer)"]["failures"] == {}
    assert by_name["scipy DE, paper's fitness (peer)"]["success"]["10cm_2deg"]["successes"] >= 3
