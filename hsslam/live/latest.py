"""A place between two threads where only the newest item waits."""

from __future__ import annotations

from threading import Condition
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """Holds one item: a new one takes the place of one that was not taken yet, so nobody waits to put."""

    def __init__(self) -> None:
        self._changed = Condition()
        self._item: T | None = None
        self._closed = False

    @property
    def empty(self) -> bool:
        """Whether what was put last has been taken."""
        return self._item is None

    def put(self, item: T) -> None:
        """Put an item in."""
        with self._changed:
            self._item = item
            self._changed.notify_all()

    def close(self) -> None:
        """Say that no more items come."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def take(self, timeout: float | None = None) -> T | None:
        """Take the item out, waiting for one.

        Parameters
        ----------
        timeout : float or None
            For how long at most (s); None: until there is one or none can come.

        Returns
        -------
        item or None
            None where none came.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._item is not None or self._closed, timeout)
            item, self._item = self._item, None
            return item
