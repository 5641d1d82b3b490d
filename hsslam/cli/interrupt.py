"""Ctrl-C: an exception raised inside a compiled kernel would break it, so it waits for the next safe place."""

from __future__ import annotations

import os
import signal
import sys
from threading import Timer
from typing import Any

EXIT_CODE = 130
PATIENCE = 2.0
"""Where no safe place comes within this time (s), the process ends as it is: what was written stays readable."""

_pressed = False


def install() -> None:
    """Take Ctrl-C over, for the rest of the process."""
    signal.signal(signal.SIGINT, _press)


def check() -> None:
    """Raise `KeyboardInterrupt` here if Ctrl-C was pressed; called wherever progress is told."""
    if _pressed:
        raise KeyboardInterrupt


def _press(number: int, frame: Any) -> None:
    global _pressed
    if _pressed:
        _leave()
    _pressed = True
    last = Timer(PATIENCE, _leave)
    last.daemon = True
    last.start()


def _leave() -> None:
    show_cursor = "\x1b[?25h\n" if sys.stderr.isatty() else ""
    os.write(2, f"{show_cursor}hsslam: interrupted\n".encode())
    os._exit(EXIT_CODE)
