"""The journal: what is written comes back bit by bit, and only the same run goes on."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.errors import ConfigError, DataError
from hsslam.slam.events import Event, KeyframeAdded, LoopChecked, Optimised, Tracked
from hsslam.slam.journal import Header, Journal, Replay, read_journal

HEADER = Header(
    {"source": "office", "scans": None}, {"seed": 0, "matcher": {"name": "hide", "memory_size": 30}}
)

floats = st.floats(allow_nan=False)


def tracked(scan: int, value: float = 0.1) -> Tracked:
    return Tracked(
        scan=scan,
        stamp=value + scan,
        pose=np.array([value, -value, 0.5]),
        keyframe=0,
        relative=np.array([value / 3.0, 0.0, -0.0]),
        covariance=np.full((3, 3), value),
        score=0.9,
        matched=True,
        evaluations=250,
    )


def loop(first: int, second: int, accepted: bool = True) -> LoopChecked:
    return LoopChecked(first, second, accepted, "", np.zeros(3), np.eye(3), 0.7, 100)


def same(a: Event, b: Event) -> bool:
    def bits(value: object) -> object:
        return (value.shape, value.tobytes()) if isinstance(value, np.ndarray) else value

    return type(a) is type(b) and all(bits(getattr(a, f.name)) == bits(getattr(b, f.name)) for f in fields(a))


def write(path: Path, *events: Event, header: Header = HEADER, replay: Replay | None = None) -> None:
    with Journal(path, header, replay) as journal:
        for event in events:
            journal.write(event)


def test_events_come_back(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    write(
        path,
        tracked(0),
        KeyframeAdded(0, 0, np.zeros(3)),
        tracked(1),
        loop(0, 1),
        Optimised("final", 2.0, 1.0, 1),
    )
    replay = read_journal(path)
    assert set(replay.tracked) == {0, 1}
    assert same(replay.tracked[1], tracked(1))
    assert same(replay.loops[(0, 1)], loop(0, 1))
    assert replay.keyframes == {0}
    assert replay.header == HEADER
    assert replay.end == path.stat().st_size


@settings(deadline=None, max_examples=50)
@given(st.lists(floats, min_size=16, max_size=16))
def test_floats_come_back_bit_by_bit(tmp_path_factory: pytest.TempPathFactory, values: list[float]) -> None:
    path = tmp_path_factory.mktemp("journal") / "j.jsonl"
    event = Tracked(
        scan=3,
        stamp=values[0],
        pose=np.array(values[1:4]),
        keyframe=1,
        relative=np.array(values[4:7]),
        covariance=np.array(values[7:16]).reshape(3, 3),
        score=float(np.float64(values[0])),
        matched=False,
        evaluations=int(np.int64(7)),
    )
    write(path, event)
    assert same(read_journal(path).tracked[3], event)


def test_what_is_no_number_comes_back_too(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    write(
        path,
        loop := LoopChecked(
            0, 1, False, "far", np.zeros(3), np.full((3, 3), np.nan), 0.5, 1, surprise=np.inf
        ),
    )
    assert same(read_journal(path).loops[(0, 1)], loop)


def test_numpy_scalars_are_written_as_numbers(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    write(path, KeyframeAdded(np.int64(4), np.int64(9), np.zeros(3)))  # type: ignore[arg-type]
    assert read_journal(path).keyframes == {4}


def test_every_event_is_in_the_file_before_the_next(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    journal = Journal(path, HEADER)
    assert read_journal(path).header == HEADER
    journal.write(tracked(0))
    assert set(read_journal(path).tracked) == {0}
    journal.close()


@pytest.mark.parametrize("torn", ['{"event": "tracked", "scan": 2, "sta', "{", '{"event": "tracked"}'])
def test_a_torn_last_line_is_dropped_and_the_journal_goes_on(tmp_path: Path, torn: str) -> None:
    path = tmp_path / "j.jsonl"
    write(path, tracked(0), tracked(1))
    with path.open("a") as file:
        file.write(torn)
    replay = read_journal(path)
    assert set(replay.tracked) == {0, 1}
    write(path, tracked(0), tracked(1), tracked(2), loop(0, 2), replay=replay)
    again = read_journal(path)
    assert set(again.tracked) == {0, 1, 2}
    assert len(path.read_text().splitlines()) == 1 + 3 + 1


def test_repeated_events_are_written_once(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    events = (tracked(0), KeyframeAdded(0, 0, np.zeros(3)), loop(0, 5, accepted=False))
    write(path, *events)
    before = path.read_bytes()
    write(path, *events, replay=read_journal(path))
    assert path.read_bytes() == before


def test_a_journal_is_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "j.jsonl"
    write(path, tracked(0))
    before = path.read_bytes()
    with pytest.raises(DataError, match="holds a run already"):
        Journal(path, HEADER)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("header", "named"),
    [
        (
            Header(HEADER.dataset, {"seed": 1, "matcher": HEADER.config["matcher"]}),
            r"config\.seed was 0, now 1",
        ),
        (
            Header(HEADER.dataset, {"seed": 0, "matcher": {"name": "hide", "memory_size": 31}}),
            r"config\.matcher\.memory_size was 30, now 31",
        ),
        (
            Header({"source": "hall", "scans": None}, HEADER.config),
            r"dataset\.source was 'office', now 'hall'",
        ),
        (Header(HEADER.dataset, HEADER.config, "99.0"), r"version was .*, now '99\.0'"),
    ],
)
def test_another_run_is_not_resumed(tmp_path: Path, header: Header, named: str) -> None:
    path = tmp_path / "j.jsonl"
    write(path, tracked(0))
    before = path.read_bytes()
    with pytest.raises(ConfigError, match=named):
        Journal(path, header, read_journal(path))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "before its first line"),
        ('{"journal": 1', "before its first line"),
        ("hello\n", ":1: expected the header of a journal, found 'hello'"),
        ('{"journal": 99, "dataset": {}, "config": {}, "version": "0"}\n', ":1: expected the header"),
        ("{}\nnonsense\n", ":2: expected an event, found 'nonsense'"),
        ('{}\n{"event": "danced"}\n', ":2: expected an event"),
        ('{}\n{"event": "tracked", "scan": 1}\n', ":2: expected an event"),
        ("{}\n[1, 2]\n", ":2: expected an event"),
    ],
)
def test_what_is_no_journal_says_which_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "j.jsonl"
    header = json.dumps({"journal": 1, "dataset": {}, "config": {}, "version": "0"})
    path.write_text(text.replace("{}\n", header + "\n", 1) if text.startswith("{}") else text)
    with pytest.raises(DataError, match=message):
        read_journal(path)


def test_a_missing_journal_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="cannot be read: No such file"):
        read_journal(tmp_path / "none.jsonl")
