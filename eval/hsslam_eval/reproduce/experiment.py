"""What every experiment of the paper is asked for, and what it hands back."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from hsslam_eval.statistics import Interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Verdict: TypeAlias = Literal["holds", "does not hold", "cannot be compared"]

Tell: TypeAlias = Callable[[str, int, int], None]
"""Progress: what is being done, steps done, steps in all (0: not known)."""


@dataclass(frozen=True)
class Request:
    """What the user asked for.

    Parameters
    ----------
    dataset : str, optional
        A log by name or path; simulated URG-04LX scans with exact truth where left out.
    data_dir : Path, optional
        Where real logs are.
    trials : int, optional
        Trials (or repetitions) of each method; the experiment's own number where left out.
    seed : int
        Every random choice follows from it.
    quick : bool
        As few trials as show that it works; the figures mean little.
    """

    dataset: str | None = None
    data_dir: Path | None = None
    trials: int | None = None
    seed: int = 0
    quick: bool = False

    def count(self, usual: int, quick: int) -> int:
        """Trials to run: what was asked for, else ``usual``, or ``quick`` in a hurry."""
        if self.trials is not None:
            return self.trials
        return quick if self.quick else usual


@dataclass(frozen=True)
class Value:
    """A figure of ours, its interval where it has one, and the paper's where the paper gives one.

    All in the unit of the column's heading; NaN where there is no such figure.
    """

    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    paper: float = math.nan

    @classmethod
    def of(cls, interval: Interval, scale: float = 1.0, paper: float = math.nan) -> Value:
        """From an interval, in another unit."""
        return cls(scale * interval.value, scale * interval.low, scale * interval.high, paper)


@dataclass(frozen=True)
class Row:
    """A labelled row; a cell is a `Value` or plain text."""

    label: str
    cells: tuple[Value | str, ...]


@dataclass(frozen=True)
class Table:
    """A table; headings carry the units and do not count the column of the rows' labels."""

    title: str
    explanation: str
    headings: tuple[str, ...]
    rows: tuple[Row, ...]
    corner: str = "method"

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.headings):
                raise ValueError(
                    f"{self.title}: row {row.label!r} has {len(row.cells)} cells, not {len(self.headings)}"
                )


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, in our words, and what our data say of it.

    Parameters
    ----------
    statement : str
        One sentence.
    verdict : str
        ``holds``, ``does not hold`` or ``cannot be compared``.
    why : str
        The figures that decide it, in plain words.
    added : bool
        A comparison that the paper does not make and we thought worth making; counted apart.
    """

    statement: str
    verdict: Verdict
    why: str
    added: bool = False


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure, its file's stem and its caption."""

    key: str
    caption: str
    figure: Figure


@dataclass(frozen=True, eq=False)
class Experiment:
    """The outcome of one experiment.

    Parameters
    ----------
    name : str
        What the command line calls it, e.g. ``table1``; also its folder.
    title : str
        For a heading.
    summary : str
        What was done, on what, in a few sentences.
    claims : tuple of Claim
        What the paper says of it, each with our verdict.
    tables : tuple of Table
        The first is the main one.
    drawings : tuple of Drawing
        The first is written as ``figure.png`` and ``figure.svg``, others under their keys.
    data : str
        What it ran on, in words.
    attribution : str
        What must be printed beside results on real data.
    seeds : tuple of int
        Every seed used.
    counts : dict
        Trials, evaluations and the like, by name.
    config : dict
        Every parameter that decides the outcome; JSON types only.
    notes : tuple of str
        What a reader must know to read it rightly.
    series : dict
        Curves behind the drawings, for whoever wants to draw them anew; JSON types only.
    """

    name: str
    title: str
    summary: str
    claims: tuple[Claim, ...]
    tables: tuple[Table, ...]
    drawings: tuple[Drawing, ...]
    data: str
    seeds: tuple[int, ...]
    counts: dict[str, int]
    config: dict[str, Any]
    attribution: str = ""
    notes: tuple[str, ...] = ()
    series: dict[str, Any] = field(default_factory=dict)
