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
    """A setting is unknown or out of its range.

    Parameters
    ----------
    message : str
        What its reader is told.
    key : tuple of str or int, optional
        Which setting it is about, outermost section first; empty where it is about all of them together.
    found : object
        Its value.
    """

    exit_code = 2

    def __init__(self, message: str, key: tuple[str | int, ...] | None = None, found: object = None) -> None:
        self.key = key
        self.found = found
        super().__init__(message)


class UnavailableError(HsslamError):
    """A part that a plugin or an extra brings cannot be used here.

    Parameters
    ----------
    name : str
        The name it is registered under.
    reason : str
        What is missing or broken.
    remedy : str
        The line to type that mends it.
    kind : str
        What it is: a matcher, a reader.
    """

    exit_code = 4

    def __init__(self, name: str, reason: str, remedy: str, kind: str) -> None:
        self.name = name
        self.reason = reason
        self.remedy = remedy
        self.kind = kind
        super().__init__(f"{kind} {name!r} is unavailable: {reason}; mend it with: {remedy}")

    def __reduce__(self) -> tuple[type[UnavailableError], tuple[str, ...]]:
        return type(self), (self.name, self.reason, self.remedy, self.kind)


class MatcherUnavailableError(UnavailableError):
    """A matcher cannot run here; see `UnavailableError`."""

    def __init__(self, name: str, reason: str, remedy: str, kind: str = "matcher") -> None:
        super().__init__(name, reason, remedy, kind)
