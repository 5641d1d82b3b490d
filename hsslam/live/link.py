"""The pipe to a viewer's process: a run puts snapshots in and never waits."""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile
from threading import Thread
from typing import Any

from hsslam.live.latest import Latest
from hsslam.live.snapshot import Snapshot

FAULT = "fault: "
"""Begins the line of stderr in which a viewer's process says why it ends; toolkits and drivers write others."""

SHOWN = b"shown\n"
"""What a viewer's process answers when it has shown the final snapshot."""


class Link:
    """A viewer's process and the thread that feeds it.

    Parameters
    ----------
    viewer, title, recording : str
        What `hsslam.live.process` is told.
    """

    def __init__(self, viewer: str, title: str, recording: str) -> None:
        # A file, not a pipe: whatever a toolkit or driver has to say, nobody has to read it meanwhile.
        self._errors: Any = tempfile.TemporaryFile()  # noqa: SIM115 (lives as long as the process)
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "hsslam.live.process", viewer, title, recording],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            start_new_session=True,  # Ctrl-C is for the run; the window stays, and a recording is completed
        )
        self._outbox: Latest[Snapshot] = Latest()
        self._shown = False
        self._thread = Thread(target=self._feed, name="live map", daemon=True)
        self._thread.start()

    @property
    def ready(self) -> bool:
        """Whether the viewer has taken what it was given before; it gets nothing new until then."""
        return self._outbox.empty

    @property
    def fault(self) -> str:
        """Why the viewer is gone, in a line; empty while it is there."""
        code = self._process.poll()
        if code is None or self._shown:
            return ""
        if code == 0:
            return "the window was closed"
        if code < 0:
            return f"the viewer crashed (signal {-code})"
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").splitlines()
        told = [line.removeprefix(FAULT) for line in lines if line.startswith(FAULT)]
        return told[-1] if told else f"the window was lost (exit code {code})"

    def send(self, snapshot: Snapshot) -> None:
        """Hand a snapshot over; what was handed over before and not yet taken is forgotten."""
        self._outbox.put(snapshot)

    def finish(self, patience: float) -> str:
        """Wait until the viewer has shown all that it was sent; a fault, or empty.

        Parameters
        ----------
        patience : float
            A viewer that takes longer is ended (s).
        """
        self._thread.join(patience)
        if self._thread.is_alive():
            self._process.kill()
            return f"the viewer did not answer within {patience:g} s"
        if not self._shown:
            try:
                self._process.wait(patience)
            except subprocess.TimeoutExpired:
                self._process.kill()
                return "the viewer takes nothing any more"
        return self.fault

    def abandon(self) -> None:
        """Send nothing any more and do not wait; what was shown stays."""
        self._outbox.close()

    def _feed(self) -> None:
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None and stdout is not None
        try:
            with stdin:
                while (snapshot := self._outbox.take()) is not None:
                    pickle.dump(snapshot, stdin, protocol=pickle.HIGHEST_PROTOCOL)
                    stdin.flush()
                    if snapshot.final:
                        break
        except OSError:
            return  # the viewer is gone; `fault` tells why
        with stdout:
            self._shown = stdout.readline() == SHOWN
