"""Memory that is free within the process, and of no use to it any more."""

from __future__ import annotations

import ctypes


def give_back() -> None:
    """Give what is free back to the system, where the C library can (glibc keeps tens of megabytes otherwise)."""
    try:
        ctypes.CDLL(None).malloc_trim(0)
    except (AttributeError, OSError, TypeError):  # another C library, which sees to it by itself or cannot
        return
