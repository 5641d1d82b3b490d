"""Sweeps as their users start them: local processes, a cluster of two commands, workers that die."""

from __future__ import annotations

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from hsslam import plugin_files
from hsslam.cli.main import app
from hsslam_eval import sweep_pool
from hsslam_eval.sweep_table import Row, read_tables

PATIENCE = 240.0
"""No test waits that long (s) unless something is broken, however slow the machine."""

PLUGIN = '''
import ctypes, os, signal, time
from pathlib import Path
from hsslam.matching import Estimate, Matcher

class SweepSegfault(Matcher):
    def estimate(self, reference, points, guess, window, rng):
        ctypes.string_at(0)

class SweepKillsWorkers(Matcher):
    """Takes the worker down that started its process, whenever it is tried."""
    def estimate(self, reference, points, guess, window, rng):
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(3600)

class SweepWaitsOnce(Matcher):
    """Writes its worker's process down and waits for it to be killed; at the second try it goes on."""
    def estimate(self, reference, points, guess, window, rng):
        marker = Path(os.environ["SWEEP_MARKER"])
        if not marker.exists():
            marker.write_text(str(os.getppid()))
            time.sleep(3600)
        return Estimate(guess)
'''

SWEEP: dict[str, Any] = {
    "datasets": [{"name": "office", "scans": 30}],
    "matchers": [
        {"name": "hide", "search_points": 24, "grid": {"memory_size": [6, 8]}},
    ],
    "seed": 1,
    "trials": {"count": 3, "warm_up": 1, "resamples": 100},
}
"""Two trials and two SLAM runs."""


def write(path: Path, **changes: Any) -> Path:
    path.write_text(yaml.safe_dump({**SWEEP, **changes}))
    return path


@contextmanager
def process(*command: str, **variables: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process and its children for as long as the block lasts."""
    started = subprocess.Popen(
        [sys.executable, *command],
        env={**os.environ, **variables},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        yield started
    finally:
        if started.poll() is None:
            started.terminate()
            try:
                started.wait(20)
            except subprocess.TimeoutExpired:
                os.killpg(started.pid, signal.SIGKILL)
        started.wait()


def sweep(*args: str | Path) -> str:
    result = CliRunner().invoke(app, ["sweep", *map(str, args)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def compare(address: str, out: Path) -> None:
    """The first point of the sweep's grid, as a comparison."""
    options = ["compare", "office", "--scans", "30", "--matchers", "hide", "--seed", "1", "--trials", "3"]
    for setting in (
        "trials.warm_up=1",
        "trials.resamples=100",
        "hide.search_points=24",
        "hide.memory_size=6",
    ):
        options += ["--set", setting]
    options += ["--scheduler", address, "--out", str(out)]
    result = CliRunner().invoke(app, options, catch_exceptions=False)
    assert result.exit_code == 0, result.output


def rows(out: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((out / "sweep.json").read_text())
    return found


def figures(out: Path, *matchers: str) -> list[dict[str, Any]]:
    """What must be the same wherever a job was done."""
    machine = ("seconds", "host", "costs")
    return [
        {key: value for key, value in row.items() if key not in machine}
        for row in rows(out)
        if row["matcher"] in matchers
    ]


def jobs_at_work(scratch: Path) -> list[str]:
    """Processes of jobs in the folder of a cluster's workers."""
    listed = subprocess.run(["ps", "-A", "-ww", "-o", "args"], capture_output=True, text=True, check=True)
    return [
        line for line in listed.stdout.splitlines() if "hsslam_eval.worker" in line and f"{scratch}/" in line
    ]


@pytest.fixture(scope="module")
def plugin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    file = tmp_path_factory.mktemp("plugin") / "ill_bred.py"
    file.write_text(PLUGIN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(plugin_files.VARIABLE, "")
        plugin_files.use(file)
        yield file


@pytest.fixture(scope="module")
def local(plugin: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep over two local processes, with a matcher that crashes and a log that is not there."""
    place = tmp_path_factory.mktemp("local")
    file = write(
        place / "sweep.yaml",
        matchers=[*SWEEP["matchers"], "sweep_segfault"],
        datasets=[*SWEEP["datasets"], {"name": "intel", "scans": 30}],
    )
    output = sweep(file, "--workers", "2", "--data-dir", place, "--out", place / "out")
    assert "4 of 12 jobs done, 8 failed" in output
    return place


def test_every_job_is_a_row(local: Path) -> None:
    done = [row for row in rows(local / "out") if row["status"] == "done"]
    assert [(row["kind"], row["matcher"], row["parameters"]) for row in done] == [
        ("trials", "hide", {"memory_size": 6}),
        ("slam", "hide", {"memory_size": 6}),
        ("trials", "hide", {"memory_size": 8}),
        ("slam", "hide", {"memory_size": 8}),
    ]
    for row in done:
        folder = local / "out" / row["folder"]
        assert (folder / "result.json").is_file() and (folder / "worker.json").is_file()
        assert row["seconds"] > 0.0 and row["host"] and row["seed"] == 1
        assert (folder / "run" / "trajectory.tum").is_file() == (row["kind"] == "slam")
    assert done[0]["metrics"]["trials"] == 3
    assert done[1]["metrics"]["ate_translation_rmse_m"] < 1.0


def test_the_table_has_the_same_rows(local: Path) -> None:
    with (local / "out" / "sweep.csv").open(newline="") as file:
        table = list(csv.DictReader(file))
    assert [row["key"] for row in table] == [row["key"] for row in rows(local / "out")]
    assert [row["matcher.memory_size"] for row in table[:4]] == ["6", "6", "8", "8"]
    assert (
        float(table[1]["ate_translation_rmse_m"])
        == rows(local / "out")[1]["metrics"]["ate_translation_rmse_m"]
    )


def test_trials_without_an_answer_are_counted_beside_the_errors(local: Path) -> None:
    done = next(row for row in rows(local / "out") if row["kind"] == "trials" and row["status"] == "done")
    mute = Row(**{**done, "metrics": {**done["metrics"], "unanswered": 2}})
    ((_, headings, (cells,)),) = read_tables([mute])
    assert cells[headings.index("no answer")] == "2"


def test_a_job_that_fails_is_a_row_with_its_reason(local: Path) -> None:
    failed = [row for row in rows(local / "out") if row["status"] == "failed"]
    reasons = {(row["dataset"], row["matcher"]): row["reason"] for row in failed}
    assert "signal 11 (SIGSEGV)" in reasons["office", "sweep_segfault"]
    assert "hsslam datasets fetch intel" in reasons["intel", "hide"]
    assert all(row["metrics"] == {} for row in failed)
    (crashed, *_) = [row for row in failed if row["dataset"] == "office"]
    assert "Segmentation fault" in (local / "out" / crashed["folder"] / "log.txt").read_text()


def test_what_is_done_is_not_run_again(local: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stamps() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in (local / "out").glob("jobs/*/result.json")}

    def no_pool(*args: object) -> None:
        raise AssertionError("nothing is left to do")

    before, was = stamps(), figures(local / "out", "hide")
    assert len(before) == 4
    monkeypatch.setattr("hsslam_eval.sweep_queue.open_pool", no_pool)
    output = sweep(write(tmp_path / "less.yaml"), "--out", local / "out")
    assert "4 of 4 jobs done" in output
    assert stamps() == before
    assert figures(local / "out", "hide") == [row for row in was if row["dataset"] == "office"]


def test_something_else_is_not_overwritten(tmp_path: Path) -> None:
    file = write(tmp_path / "sweep.yaml")
    before = file.read_text()
    result = CliRunner().invoke(app, ["sweep", str(file), "--out", str(tmp_path)])
    assert result.exit_code == 3 and "holds something else than a sweep (sweep.yaml)" in result.output
    assert file.read_text() == before


def test_without_dask_the_line_that_installs_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    file = write(tmp_path / "sweep.yaml")
    result = CliRunner().invoke(app, ["sweep", str(file), "--out", str(tmp_path / "out")])
    assert result.exit_code == 5 and "pip install 'hsslam[sweep]'" in result.output


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nowhere://x"])
def test_no_scheduler_is_one_line(address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_pool, "CONNECT_SECONDS", 0.5)
    file = write(tmp_path / "sweep.yaml")
    result = CliRunner().invoke(
        app, ["sweep", str(file), "--scheduler", address, "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 5
    assert f"{address}: no answer" in result.output and "dask scheduler" in result.output


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def wait_for(path: Path) -> None:
    end = time.monotonic() + PATIENCE
    while not path.is_file() or not path.read_text():
        assert time.monotonic() < end, f"{path} never came"
        time.sleep(0.05)


def test_a_cluster_gives_the_same_and_survives_the_death_of_workers(
    local: Path, plugin: Path, tmp_path: Path
) -> None:
    """A scheduler and two workers from the command line; one is killed at work, one matcher kills all it gets."""
    address, marker = f"tcp://127.0.0.1:{free_port()}", tmp_path / "worker.pid"
    data, scratch = tmp_path / "data", tmp_path / "scratch"
    data.mkdir()
    variables = {"SWEEP_MARKER": str(marker), "HSSLAM_DATA": str(data)}
    worker = (
        "-m",
        "dask",
        "worker",
        address,
        "--nthreads",
        "1",
        "--no-dashboard",
        "--local-directory",
        str(scratch),
    )
    file = write(
        tmp_path / "sweep.yaml",
        matchers=[*SWEEP["matchers"], "sweep_waits_once", "sweep_kills_workers"],
        run_slam=False,
        seeds=1,
    )
    whole = write(tmp_path / "whole.yaml", datasets=[*SWEEP["datasets"], {"name": "intel", "scans": 30}])
    command = ("-c", "from hsslam.cli.main import main; main()", "sweep")
    with ExitStack() as stack:
        once = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
        port = address.rpartition(":")[2]
        stack.enter_context(
            process(
                "-m", "dask", "scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard", **once
            )
        )
        for _ in range(2):
            stack.enter_context(process(*worker, **variables))
        running = stack.enter_context(
            process(*command, str(file), "--scheduler", address, "--out", str(tmp_path / "out"))
        )
        wait_for(marker)
        assert any("sweep_waits_once" in job for job in jobs_at_work(scratch))
        os.kill(int(marker.read_text()), signal.SIGKILL)
        assert running.wait(PATIENCE) == 0
        sweep(whole, "--scheduler", address, "--out", tmp_path / "out2")
        compare(address, tmp_path / "compare")
    by_matcher = {row["matcher"]: row for row in rows(tmp_path / "out")}
    assert by_matcher["sweep_waits_once"]["status"] == "done"
    assert by_matcher["sweep_kills_workers"]["status"] == "failed"
    assert "its worker died, 2 times" in by_matcher["sweep_kills_workers"]["reason"]
    trials = [
        row for row in figures(local / "out", "hide") if (row["kind"], row["dataset"]) == ("trials", "office")
    ]
    assert figures(tmp_path / "out", "hide") == trials and len(trials) == 2
    same, elsewhere = (
        [row for row in figures(place, "hide") if row["dataset"] == "office"]
        for place in (local / "out", tmp_path / "out2")
    )
    assert elsewhere == same and len(same) == 4
    for row in same:
        if row["kind"] == "slam":
            for name in ("trajectory.tum", "journal.jsonl", "graph.g2o", "map.pgm"):
                here, there = (
                    place / row["folder"] / "run" / name for place in (local / "out", tmp_path / "out2")
                )
                assert here.read_bytes() == there.read_bytes(), name
    missing = [row["reason"] for row in rows(tmp_path / "out2") if row["dataset"] == "intel"]
    assert len(missing) == 4 and all(f"{data}" in reason for reason in missing)
    assert jobs_at_work(scratch) == []
    compared = sorted(
        path.relative_to(tmp_path / "compare") for path in tmp_path.glob("compare/jobs/*/run/*")
    )
    assert len(compared) > 10
    for path in compared:
        if path.name not in ("timings.json", "environment.json"):
            assert (tmp_path / "compare" / path).read_bytes() == (local / "out" / path).read_bytes(), path
