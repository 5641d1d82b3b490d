"""`hsslam run`, and `hsslam eval` of what it leaves."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from hsslam.cli import running
from hsslam.cli.main import app
from hsslam.config import load_config
from hsslam.slam.folder import FILES

SCANS = 560  # enough of the office for the robot to have come back to where it was
RUN = ("run", "office", "--matcher", "hide", "--scans", str(SCANS))
SAME = (
    "trajectory.tum",
    "odometry.tum",
    "graph.g2o",
    "map.pgm",
    "config.yaml",
    "journal.jsonl",
    "metrics.json",
)


def hsslam(*args: str | int | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run from beginning to end."""
    out = tmp_path_factory.mktemp("runs") / "whole"
    result = hsslam(*RUN, "--out", out, "--quiet")
    assert result.exit_code == 0, result.output
    assert result.output == ""
    return out


def test_a_run_leaves_every_file_and_its_figures(whole: Path) -> None:
    assert {path.name for path in whole.iterdir()} == set(FILES)
    metrics = json.loads((whole / "metrics.json").read_text())
    assert metrics["scans"] == SCANS
    assert metrics["loops_accepted"] > 0
    assert metrics["ate"]["translation_rmse_m"] < 0.05
    timings = json.loads((whole / "timings.json").read_text())
    assert timings["wall_s"] > 0.0
    assert not timings["resumed"]


def test_the_same_run_again_is_refused_and_touches_nothing(whole: Path) -> None:
    before = {path.name: path.stat().st_mtime_ns for path in whole.iterdir()}
    result = hsslam(*RUN, "--out", whole)
    assert result.exit_code == 3
    assert "holds a run already" in result.stderr
    assert {path.name: path.stat().st_mtime_ns for path in whole.iterdir()} == before


@pytest.mark.parametrize("share", [0.3, 0.9])
def test_a_resumed_run_is_the_whole_run(tmp_path: Path, whole: Path, share: float) -> None:
    journal = (whole / "journal.jsonl").read_bytes()
    (tmp_path / "journal.jsonl").write_bytes(journal[: int(len(journal) * share)])
    result = hsslam("run", "--resume", tmp_path)
    assert result.exit_code == 0, result.output
    for name in SAME:
        assert (tmp_path / name).read_bytes() == (whole / name).read_bytes(), name
    assert json.loads((tmp_path / "timings.json").read_text())["resumed"]


def test_ctrl_c_leaves_a_run_that_can_be_resumed(tmp_path: Path, whole: Path) -> None:
    out = tmp_path / "run"
    command = [sys.executable, "-c", "from hsslam.cli.main import main; main()", *RUN, "--out", str(out)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    journal = out / "journal.jsonl"
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline and (not journal.exists() or journal.stat().st_size < 50_000):
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert said.splitlines()[-1] == f"hsslam: interrupted; go on with: hsslam run --resume {out}"
    assert not (out / "trajectory.tum").exists()
    assert hsslam("run", "--resume", out, "--quiet").exit_code == 0
    assert (out / "trajectory.tum").read_bytes() == (whole / "trajectory.tum").read_bytes()


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (["hall"], "dataset.source was 'office', now 'hall'"),
        (["--scans", "20"], f"dataset.scans was {SCANS}, now 20"),
        (["--seed", "9"], "config.seed was 0, now 9"),
        (["--set", "matcher.memory_size=40"], "config.matcher.memory_size was 30, now 40"),
    ],
)
def test_another_run_is_not_resumed(whole: Path, args: list[str], said: str) -> None:
    before = (whole / "journal.jsonl").read_bytes()
    result = hsslam("run", *args, "--resume", whole)
    assert result.exit_code == 2
    assert said in result.stderr
    assert (whole / "journal.jsonl").read_bytes() == before


def test_a_log_file_runs_and_prints_a_summary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert hsslam("datasets", "simulate", "hall", "--scans", "40", "--out", "hall.clf.gz").exit_code == 0
    result = hsslam(
        "run", "hall.clf.gz", "--matcher", "hsl", "--set", "matcher.memory_size=20", "--seed", "3"
    )
    assert result.exit_code == 0, result.output
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.endswith("-hall-hsl")
    summary = dict(line.split("  ", 1) for line in result.stdout.splitlines() if "  " in line)
    assert summary["dataset"].strip().startswith("hall: 40 scans")
    assert summary["matcher"].strip().startswith("hsl: ")
    assert "ATE" in summary
    assert summary["output"].strip() == f"{folder.relative_to(tmp_path)}/"


@pytest.mark.parametrize(
    ("scans", "factor", "said"), [(1, 0.0, "2.0 s"), (40, 0.24, "2.0 s (0.24 times real time)")]
)
def test_speed_is_told_where_it_has_a_meaning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scans: int, factor: float, said: str
) -> None:
    times = running._timings
    known = {"wall_s": 2.0, "real_time_factor": factor}
    monkeypatch.setattr(running, "_timings", lambda *args: {**times(*args), **known})
    result = hsslam("run", "office", "--scans", scans, "--out", tmp_path / "run")
    summary = dict(line.split("  ", 1) for line in result.stdout.splitlines() if "  " in line)
    assert summary["wall time"].strip() == said


def test_no_colour_and_no_bars_where_there_is_no_terminal(tmp_path: Path) -> None:
    result = hsslam("run", "office", "--scans", "20", "--out", tmp_path / "run")
    assert result.exit_code == 0
    assert "\x1b" not in result.output


def test_a_malformed_line_stops_or_is_skipped(tmp_path: Path) -> None:
    log = tmp_path / "log.clf"
    assert hsslam("datasets", "simulate", "hall", "--scans", "12", "--out", log).exit_code == 0
    lines = log.read_text().splitlines(keepends=True)
    broken = next(number for number, line in enumerate(lines) if line.startswith("FLASER"))
    lines[broken] = "FLASER 180 1.0 2.0\n"
    log.write_text("".join(lines))
    (tmp_path / "log.truth.tum").unlink()
    result = hsslam("run", log, "--out", tmp_path / "stop")
    assert result.exit_code == 3
    assert f"log.clf:{broken + 1}:" in result.stderr
    result = hsslam("run", log, "--out", tmp_path / "skip", "--on-error", "skip")
    assert result.exit_code == 0
    assert "1 malformed lines" in result.stdout
    metrics = json.loads((tmp_path / "skip" / "metrics.json").read_text())
    assert (metrics["scans"], metrics["skipped_lines"]) == (11, 1)


def test_eval_agrees_with_the_run(whole: Path) -> None:
    result = hsslam("eval", whole / "trajectory.tum", "--dataset", "office", "--scans", SCANS, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    metrics = json.loads((whole / "metrics.json").read_text())
    assert found["ate"]["translation_rmse_m"] == pytest.approx(metrics["ate"]["translation_rmse_m"], abs=1e-6)
    assert found["poses"] == found["scans"] == SCANS


def test_eval_finds_the_scans_of_a_part_by_their_stamps(whole: Path, tmp_path: Path) -> None:
    lines = (whole / "trajectory.tum").read_text().splitlines(keepends=True)
    part = tmp_path / "part.tum"
    part.write_text("".join(lines[5:100:7]))
    found = json.loads(hsslam("eval", part, "--dataset", "office", "--scans", SCANS, "--json").stdout)
    assert found["ate"]["count"] == len(range(5, 100, 7))
    assert found["ate"]["translation_rmse_m"] < 0.05
    part.write_text("".join(reversed(lines[5:100:7])))
    result = hsslam("eval", part, "--dataset", "office", "--scans", SCANS)
    assert result.exit_code == 3
    assert "pose 2: no scan of the log after those before it" in result.stderr


def test_eval_of_a_peer_on_intel(shared_data: Path) -> None:
    peer = shared_data / "intel" / "peers" / "cartographer.csv"
    result = hsslam("eval", peer, "--dataset", "intel", "--data-dir", shared_data)
    assert result.exit_code == 0, result.output
    assert "0.0205 +- 0.0136 m, 0.530 " in result.stdout
    assert "CC-BY 3.0" in result.stdout


def test_refine_says_how_often_overlapping_keyframes_are_matched_again(tmp_path: Path) -> None:
    run = ("run", "corridor", "--scans", "40", "--quiet", "--out", tmp_path / "r")
    assert hsslam(*run, "--refine", "0").exit_code == 0
    assert load_config(tmp_path / "r" / "config.yaml").graph.refine_rounds == 0
    refused = hsslam("run", "corridor", "--refine", "-1")
    assert refused.exit_code == 2 and "--refine" in refused.output


def test_two_logs_in_a_row_are_two_sessions_of_one_map(tmp_path: Path) -> None:
    """Nobody says where the second begins; it is found by what it sees."""
    for name, scans, seed in (("monday", 500, 0), ("tuesday", 500, 2)):
        out = tmp_path / f"{name}.clf"
        assert hsslam("convert", "office", out, "--scans", scans, "--seed", seed).exit_code == 0
    both = tmp_path / "both.clf"
    both.write_bytes(b"".join((tmp_path / f"{name}.clf").read_bytes() for name in ("monday", "tuesday")))
    result = hsslam("run", both, "--out", tmp_path / "both")
    assert result.exit_code == 0, result.output
    (line,) = [line for line in result.output.splitlines() if line.startswith("sessions")]
    assert line.split("sessions", 1)[1].strip() == (
        "1 begun by a pause or by getting lost, the robot being elsewhere (scan 500); it was found again in each"
    )
    told = json.loads((tmp_path / "both" / "metrics.json").read_text())["statistics"]
    assert (told["paused_before"], told["sessions"]) == ([500], 1)
