"""The exceptions of hsslam.

Whatever a user can mend is an `HsslamError`; the command line prints its message as one line and exits
with its code. Anything else that escapes is a bug and keeps its traceback.
"""

from __future__ import annotations


class HsslamError(Exception):
    """Root of every error that its reader can mend."""

    exit_code = 1


class DataError(HsslamError):
    """A file or stream does not hold what it should: says the file, the line, expected and found."""

    exit_code = 3


class ConfigError(HsslamError):
    """A setting is unknown or out of its range."""

    exit_code = 2


class MatcherUnavailableError(HsslamError):
    """A matcher cannot run here.

    Parameters
    ----------
    name : str
        The matcher's registered name.
    reason : str
        What is missing or broken.
    remedy : str
        The line to type that mends it.
    """

    exit_code = 4

    def __init__(self, name: str, reason: str, remedy: str) -> None:
        self.name = name
        self.reason = reason
        self.remedy = remedy
        super().__init__(f"matcher {name!r} is unavailable: {reason}; mend it with: {remedy}")
