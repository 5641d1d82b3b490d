"""A log from which nothing can be made is refused in one line that says why, and leaves nothing behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from hsslam.cli.main import app

PLAIN = {"angle_min": -np.pi / 2, "angle_increment": np.pi / 180, "range_max": 30.0}


def ranges(value: float, beams: int = 181, **more: Any) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        np.savez(path, **{**PLAIN, "ranges": np.full((5, beams), value), **more})

    return write


def raw(content: bytes) -> Callable[[Path], None]:
    return lambda path: (path.write_bytes(content), None)[1]


@pytest.mark.parametrize(
    ("name", "write", "said"),
    [
        ("log.npz", ranges(30.0), "found none in 5; of the 181 readings of the first 181 are at or over range_max"),
        ("log.npz", ranges(np.nan), "181 are not finite"),
        ("log.npz", ranges(0.0), "181 are zero or negative"),
        ("log.npz", ranges(3000.0), "are they millimetres?"),
        ("log.npz", ranges(3.0, beams=2), "log.npz: expected scans with 3 returns or more, found none in 5; the first"),
        ("log.npz", ranges(3.0, angle_min=-90.0, angle_increment=1.0), "turns; expected radians: are these deg"),
        ("log.clf", raw(b"\x89PNG\r\n\x1a\n\x00\x00\rIHDR\x1e{\xef\n"), "expected a CARMEN log, a text file, found a"),
        ("log.clf", raw(b"# only\n# remarks\n"), "messages, found no messages"),
        ("log.clf", raw(b"FLASER 180 1.0 2.0\n"), "log.clf:1: expected 191 words"),
        ("log.clf", raw(b"FLASER 180 1.0 2.0\n"), "(--on-error skip)"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("verb", ["run", "compare"])
def test_it_is_refused_in_a_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    verb: str,
    name: str,
    write: Callable[[Path], None],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path / name)
    result = CliRunner().invoke(app, [verb, name, "--quiet", "--out", "out"])
    assert result.exit_code == 3
    (line,) = result.stderr.splitlines()
    assert line.startswith("hsslam: error: ")
    assert said in line
    assert line.isprintable()
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("option", ["--scan-topic", "--odom-topic"])
def test_topics_of_a_log_that_has_none_are_refused(tmp_path: Path, option: str) -> None:
    path = tmp_path / "log.npz"
    ranges(3.0)(path)
    result = CliRunner().invoke(app, ["run", str(path), option, "/front", "--out", str(tmp_path / "out")])
    assert result.exit_code == 3
    assert "a NPZ of ranges has no topics; leave out" in result.stderr
