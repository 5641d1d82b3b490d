"""A viewer's process: takes snapshots from its standard input and shows the newest.

``python -m hsslam.live.process VIEWER TITLE RECORDING``. It ends with 0 when its window is closed, and with 1
and a line on stderr that says why it cannot show anything.
"""

from __future__ import annotations

import os
import pickle
import sys
from threading import Thread
from typing import BinaryIO

from hsslam.errors import HsslamError
from hsslam.live.latest import Latest
from hsslam.live.link import FAULT, SHOWN
from hsslam.live.snapshot import Snapshot
from hsslam.live.viewers import RERUN


def receive(stream: BinaryIO) -> Latest[Snapshot]:
    """The newest of the snapshots that are pickled into a stream, read by a thread of its own."""
    inbox: Latest[Snapshot] = Latest()

    def read() -> None:
        snapshot: Snapshot | None = None
        while snapshot is None or not snapshot.final:
            try:
                snapshot = pickle.load(stream)
            except (EOFError, OSError, pickle.UnpicklingError):
                break  # the run ended without a last word
            inbox.put(snapshot)
        inbox.close()

    Thread(target=read, name="inbox", daemon=True).start()
    return inbox


def shown() -> None:
    """Answer that the final snapshot was shown."""
    sys.stdout.buffer.write(SHOWN)
    sys.stdout.buffer.flush()


def main(viewer: str, title: str, recording: str) -> int:
    """Show what comes in until the window is closed, or until the recording is complete; the exit code."""
    inbox = receive(sys.stdin.buffer)
    try:
        if viewer == RERUN:
            from hsslam.live.rerun_stream import run
        else:
            from hsslam.live.matplotlib_window import run
        run(inbox, title, recording, shown)
    except HsslamError as error:
        fault = str(error)
    except Exception as error:  # of a toolkit, a driver, a library: there are many
        fault = f"{type(error).__name__}: {str(error).strip()}".splitlines()[0]
    else:
        return 0
    print(f"{FAULT}{fault}", file=sys.stderr, flush=True)
    return 1


if __name__ == "__main__":
    # Python's own way out waits for the thread that reads, and what it reads may never end.
    os._exit(main(*sys.argv[1:]))
