"""A process that ends with the one that started it, also where that one was killed and could not see to it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from threading import Thread
from time import sleep

_PR_SET_PDEATHSIG = 1
_EVERY = 1.0


def end_with_parent() -> None:
    """Have this process killed when its parent is gone.

    On Linux the kernel does it, whatever this process is busy with; the parent is then the thread that started it,
    which has to wait for it. Elsewhere a thread looks whether the parent is still there, every second.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    else:
        Thread(target=_watch, args=(os.getppid(),), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        sleep(_EVERY)
    os._exit(1)
