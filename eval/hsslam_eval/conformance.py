"""The conformance suite in a process of its own: a matcher that hangs or crashes fails a check, not the checker.

``python -m hsslam_eval.conformance NAME FD`` is that process; it tells of every check on the open file descriptor.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsslam.errors import HsslamError
from hsslam_eval.compare_config import LimitSection
from hsslam_eval.supervise import supervise

WARM_UP = "compiling"
"""What comes before the first check."""


@dataclass(frozen=True)
class CheckOutcome:
    """One check of `hsslam.matching.conformance`; ``fault`` is empty where the promise is kept."""

    name: str
    fault: str


def conformance(
    name: str,
    *,
    exempt: Collection[str] = (),
    time_limit: float = 120.0,
    progress: Callable[[str], None] | None = None,
) -> list[CheckOutcome]:
    """Run every conformance check on a matcher, by its name and with its defaults.

    Parameters
    ----------
    name : str
        A registered name.
    exempt : collection of str
        Checks to leave out.
    time_limit : float
        A check that takes longer is ended, and those after it are not run (s).
    progress : callable, optional
        Called several times a second with the name of the check that is running.

    Returns
    -------
    list of CheckOutcome
        In their order; the last one is ``making it`` where the matcher could not even be made, or the check in
        which its process ended.
    """
    done: list[CheckOutcome] = []
    at = "making it"

    def listen(message: dict[str, Any]) -> None:
        nonlocal at
        if "begins" in message:
            at = str(message["begins"])
        elif "check" in message:
            done.append(CheckOutcome(str(message["check"]), str(message["fault"])))
        if progress is not None:
            progress(at)

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / f"{name}.txt"
        arguments = [name, ",".join(exempt)]
        limits = LimitSection(step=time_limit)
        reason = supervise("hsslam_eval.conformance", arguments, log, limits, listen)
        reason = reason.replace(" (limits.step)", "").replace(f" ({log.parent.name}/{log.name})", "")
    if reason:
        done.append(CheckOutcome(at, reason))
    return done


def main(arguments: list[str]) -> None:
    """Run the checks and tell of each."""
    from hsslam.matching import registry
    from hsslam.matching.conformance import conformance_checks
    from hsslam.matching.conformance.probe import match_room

    name, exempt, descriptor = arguments
    with os.fdopen(int(descriptor), "w", encoding="utf-8") as messages:

        def tell(**message: str) -> None:
            messages.write(json.dumps(message) + "\n")
            messages.flush()

        try:
            matcher = registry.create(name)
        except (Exception, SystemExit) as error:
            tell(check="making it", fault=_said(error))
            return
        # On a fresh machine hsslam's own kernels are compiled now, not on the time of the first check.
        tell(begins=WARM_UP)
        match_room(registry.create("pl_icp"))
        for check_name, check in conformance_checks():
            if check_name in exempt.split(","):
                continue
            tell(begins=check_name)
            try:
                check(matcher)
            except (Exception, SystemExit) as error:
                tell(check=check_name, fault=_said(error))
            else:
                tell(check=check_name, fault="")


def _said(error: BaseException) -> str:
    own = isinstance(error, AssertionError | HsslamError) and str(error)
    return " ".join(str(error).split()) if own else f"raised {type(error).__name__}: {error}"


if __name__ == "__main__":
    main(sys.argv[1:])
    sys.stdout.flush()
    # A matcher's threads must not keep the process, nor its library crash it, on the way out.
    os._exit(0)
