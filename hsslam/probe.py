"""Python that may crash or hang, tried in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

CRASHES = ("crashes", "does not come back")
"""How a fault begins that would take down the process that tried it itself."""

PATIENCE = 120.0
"""What takes longer has failed (s)."""


def tried(code: str, patience: float = PATIENCE) -> tuple[Any, str]:
    """Run a piece of Python: what its last line says, as JSON, and in a line what went wrong.

    Parameters
    ----------
    code : str
        What to run.
    patience : float
        It is ended after this time (s).
    """
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", code],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=patience,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None, f"does not come back within {patience:g} s"
    if done.returncode < 0:
        return None, f"crashes (signal {-done.returncode})"
    if done.returncode > 0:
        lines = done.stderr.strip().splitlines()
        return None, lines[-1] if lines else f"exit code {done.returncode}"
    lines = done.stdout.strip().splitlines()
    return (json.loads(lines[-1]) if lines else None), ""
