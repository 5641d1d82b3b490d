"""What a reader of logs has to say beside the scans."""

from __future__ import annotations

from dataclasses import dataclass, field

_REASONS_KEPT = 5


@dataclass
class LogStatistics:
    """Filled while a log is read.

    Parameters
    ----------
    skipped : int
        Malformed entries left out (``on_error="skip"``).
    reasons : list of str
        Where the first few of them stand, and what is wrong with them.
    notes : list of str
        What the reader decided for its user: the topics it took, a laser's pose that nothing tells.
    """

    skipped: int = 0
    reasons: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def skip(self, reason: str) -> None:
        """Count an entry that is left out."""
        self.skipped += 1
        if len(self.reasons) < _REASONS_KEPT:
            self.reasons.append(reason)
