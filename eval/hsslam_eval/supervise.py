"""A worker's process: started, listened to, and ended where it hangs; whatever it does, it ends in a line.

A matcher may raise, hang, crash, or leave the process behind its back. Python's own fault handler writes to the
log where it was, and the last line there becomes part of the reason.
"""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

from hsslam_eval.compare_config import LimitSection

Listener = Callable[[dict[str, Any]], None]

_TICK = 0.2
"""How often the listener is called where nothing is heard (s): Ctrl-C is looked for there."""

_GRACE = 2.0
"""How long a process that hangs may take to write where it is (s)."""


def supervise(
    module: str, arguments: Sequence[str], log: Path, limits: LimitSection, listener: Listener
) -> str:
    """Run ``python -m MODULE`` to its end.

    Parameters
    ----------
    module : str
        The worker: writes JSON objects, one a line, to the file descriptor that its last argument names. Between
        ``{"compiling": true}`` and ``{"compiling": false}`` the time of a step stands still.
    arguments : sequence of str
        Its other arguments.
    log : path
        Takes what the process prints.
    limits : LimitSection
        When it is given up.
    listener : callable
        Takes the worker's messages, and an empty one several times a second. Where it raises, the process ends.

    Returns
    -------
    str
        Why the process came to a bad end; empty where it ended with exit code 0.
    """
    reading, writing = os.pipe()
    with log.open("wb") as output:
        process = subprocess.Popen(
            # -P: the folder it is started in must not shadow installed packages.
            [
                sys.executable,
                "-P",
                "-X",
                "faulthandler",
                "-m",
                module,
                *arguments,
                str(writing),
            ],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            pass_fds=[writing],
            # A group of its own: what the matcher has started ends with it.
            start_new_session=True,
        )
    os.close(writing)
    gave_up = ""
    began = heard = monotonic()
    compiling = False
    try:
        for message in _messages(reading, process):
            listener(message)
            now = monotonic()
            compiling = bool(message.get("compiling", compiling))
            # The compiler's time is not the matcher's: on a fresh machine it may take longer than any step.
            heard = now if message or compiling else heard
            if limits.step and now - heard > limits.step:
                gave_up = f"took no step for {limits.step:g} s (limits.step) and was ended"
            elif limits.total and now - began > limits.total:
                gave_up = f"took longer than {limits.total:g} s (limits.total) and was ended"
            if gave_up:
                _dump_and_end(process)
                break
    finally:
        os.close(reading)
        _end_group(process)
    code = process.wait()
    if gave_up or code != 0:
        return _reason(gave_up or _ended(code), log)
    return ""


def _messages(reading: int, process: subprocess.Popen[bytes]) -> Iterator[dict[str, Any]]:
    """Yield the worker's messages, and ``{}`` where none came for a while, until the process is gone."""
    rest = b""
    while True:
        gone = process.poll() is not None
        ready, _, _ = select.select([reading], [], [], 0.0 if gone else _TICK)
        if not ready:
            # Not until the pipe closes: a child of the worker may hold it open for ever.
            if gone:
                return
            yield {}
            continue
        chunk = os.read(reading, 65536)
        if not chunk:
            with suppress(subprocess.TimeoutExpired):
                process.wait(_TICK)
                return
            yield {}
            continue
        *lines, rest = (rest + chunk).split(b"\n")
        for line in lines:
            with suppress(ValueError):  # a matcher may write into a descriptor that is not its own
                message = json.loads(line)
                if isinstance(message, dict) and message:
                    yield message


def _dump_and_end(process: subprocess.Popen[bytes]) -> None:
    """Have the fault handler write where every thread is, and end the process."""
    process.send_signal(signal.SIGABRT)
    with suppress(subprocess.TimeoutExpired):
        process.wait(_GRACE)


def _end_group(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _ended(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = "unknown"
    return f"was ended by signal {-code} ({name})"


def _reason(how: str, log: Path) -> str:
    """One line: how it ended, where it was, what it said last, where all it said is."""
    text = log.read_text(encoding="utf-8", errors="replace")
    said, _, dump = text.partition("Fatal Python error:")
    lines = [line for line in said.splitlines() if line.strip()]
    last = f"; its last line: {lines[-1].strip()[:200]}" if lines else ""
    place = re.search(r"most recent call first\):\n  File \"(.+)\", line (\d+) in (\S+)", dump)
    where = f" in {place[3]} ({Path(place[1]).name}:{place[2]})" if place else ""
    return f"its process {how}{where}{last} ({log.parent.name}/{log.name})"
