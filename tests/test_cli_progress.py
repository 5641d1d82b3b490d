"""What is told while a run goes on where there is no terminal."""

from __future__ import annotations

import io

import pytest

from hsslam.cli import progress


def test_the_time_left_does_not_count_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    told = io.StringIO()
    lines = progress.Lines(told, patience=1e6)
    lines.stage("tracking", 300, "scans")
    lines.compiling(True)
    now += 20.0
    lines.compiling(False)
    now += 10.0
    lines.update(100)
    lines.close()
    assert told.getvalue().splitlines()[-1] == "tracking: 100 of 300 scans, 10.0/s, 0:20 left"
