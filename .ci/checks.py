"""Checks of `.ci/run` on what a comparison and a run over Intel left behind; a line per problem."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path

MATCHERS = ("glasm", "hide", "hsl", "icp", "kiss_icp")
TABLES = ("trials.csv", "slam.csv")
REPORT_FILES = ("report.html", "report.md", *TABLES, "trials_raw.csv", "comparison.json")
MAX_TRANSLATION_M = 0.0145
MAX_ROTATION_DEG = 0.25
INTEL_SCANS = 13_631
INTEL_RELATIONS = 2_984


def comparison(folder: Path) -> Iterator[str]:
    """Every matcher has trials, SLAM and a map, and the report tells of it."""
    missing = [name for name in REPORT_FILES if not (folder / name).is_file()]
    if missing:
        yield f"{folder}: expected {', '.join(REPORT_FILES)}, missing {', '.join(missing)}"
        return
    compared = json.loads((folder / "comparison.json").read_text())["comparisons"]
    outcomes = {m["name"]: m for comparison in compared for m in comparison["matchers"]}
    rows = {name: csv.DictReader((folder / name).read_text().splitlines()) for name in TABLES}
    told = {name: {row["matcher"]: row["status"] for row in reader} for name, reader in rows.items()}
    html, markdown = ((folder / name).read_text() for name in ("report.html", "report.md"))
    for name in MATCHERS:
        outcome = outcomes.get(name)
        if outcome is None:
            yield f"{name}: not compared"
            continue
        for failure in outcome["failures"]:
            yield f"{name}: {failure['stage']}: {failure['reason']}"
        if not outcome["runs"]:
            yield f"{name}: no SLAM"
        for run in outcome["runs"]:
            if not (folder / run["folder"] / "map.png").is_file():
                yield f"{name}: no map in {run['folder']}"
        for table in TABLES:
            if told[table].get(name) != "done":
                yield f"{name}: {told[table].get(name, 'no row')} in {table}"
        if name not in html or name not in markdown:
            yield f"{name}: not in a report"


def intel(folder: Path) -> Iterator[str]:
    """Count the poses and the relations; errors are within the targets."""
    poses = len((folder / "trajectory.tum").read_text().splitlines())
    if poses != INTEL_SCANS:
        yield f"{folder}: {poses} poses of {INTEL_SCANS} scans"
    errors = json.loads((folder / "metrics.json").read_text())["relations"]
    print(json.dumps(errors))
    if errors["count"] != INTEL_RELATIONS:
        yield f"{errors['count']} relations of {INTEL_RELATIONS}"
    if not errors["translation_mean_m"] <= MAX_TRANSLATION_M:
        yield f"translation {errors['translation_mean_m']:.4f} m, at most {MAX_TRANSLATION_M} m"
    if not errors["rotation_mean_deg"] <= MAX_ROTATION_DEG:
        yield f"rotation {errors['rotation_mean_deg']:.3f} deg, at most {MAX_ROTATION_DEG} deg"


if __name__ == "__main__":
    check = {"comparison": comparison, "intel": intel}[sys.argv[1]]
    problems = list(check(Path(sys.argv[2])))
    for problem in problems:
        print(problem, file=sys.stderr)
    sys.exit(bool(problems))
