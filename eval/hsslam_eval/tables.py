"""The tables of a report, cell by cell as text; HTML, Markdown, LaTeX and CSV are ways to lay out the same ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hsslam_eval.comparison import MatcherOutcome, Measured, Spread


@dataclass(frozen=True)
class Cell:
    """A number as text, and its interval or spread under it.

    Parameters
    ----------
    text, interval : str
        As shown.
    best : bool
        Whether it is marked: significantly better than the rest of its column.
    numbers : tuple of float
        The same at full precision for CSV: the value, and the ends of its interval or its spread.
    """

    text: str
    interval: str = ""
    best: bool = False
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True)
class Row:
    """A matcher's row; ``note`` fills it where there are no cells: why it has none."""

    label: str
    cells: list[Cell] = field(default_factory=list)
    note: str = ""


@dataclass(frozen=True)
class Table:
    """A titled table; headings carry the units, ``name`` is the stem of its files.

    ``mark`` follows what is best: a sign that print and plain text keep. ``second`` says what the second number of a
    cell with two is.
    """

    name: str
    title: str
    explanation: str
    headings: list[str]
    rows: list[Row]
    corner: str = "matcher"
    mark: str = " ★"
    second: str = "spread"


def number(value: float, scale: float = 1.0) -> str:
    """Three significant digits, without an exponent where that is readable; a dash for NaN."""
    value *= scale
    if not math.isfinite(value):
        return "–"  # noqa: RUF001
    if value == 0.0:
        return "0"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 5)}f}"


def measured(found: Measured, scale: float = 1.0, *, best: bool = False) -> Cell:
    """A number with its confidence interval."""
    if not math.isfinite(found.value):
        return Cell(number(found.value))
    return Cell(
        number(found.value, scale),
        f"{number(found.low, scale)} to {number(found.high, scale)}",
        best,
        (scale * found.value, scale * found.low, scale * found.high),
    )


def spread(found: Spread, scale: float = 1.0, *, best: bool = False) -> list[Cell]:
    """Mean and median; where one is best, that is the median's."""
    return [measured(found.mean, scale), measured(found.median, scale, best=best)]


def over_seeds(values: Sequence[float], digits: int | None = None, scale: float = 1.0) -> Cell:
    """Mean over runs, and under it the standard deviation between them (of the sample)."""
    known = scale * np.array([value for value in values if math.isfinite(value)], dtype=np.float64)
    if not len(known):
        return Cell(number(math.nan))

    def text(value: float) -> str:
        return number(value) if digits is None else f"{value:.{digits}f}"

    mean = float(known.mean())
    if len(known) == 1:
        return Cell(text(mean), numbers=(mean,))
    deviation = float(known.std(ddof=1))
    return Cell(text(mean), f"± {text(deviation)}", numbers=(mean, deviation))


def limit_text(displacement_m: float, rotation_deg: float) -> str:
    """A definition of success in words."""
    # No-break spaces, so that a narrow heading does not part a number from its unit.
    return f"< {100.0 * displacement_m:.3g} cm, < {rotation_deg:.3g}°".replace(
        " ", "\N{NO-BREAK SPACE}"
    ).replace(",\N{NO-BREAK SPACE}", ", ")


def missing(matcher: MatcherOutcome, stage: str) -> str:
    """Why a matcher has no result for ``trials`` or ``slam``, in a line."""
    for failure in matcher.failures:
        if failure.stage == "unavailable":
            return f"unavailable: {failure.reason}"
        if failure.stage == stage:
            return f"failed: {failure.reason}"
    return "not run"
