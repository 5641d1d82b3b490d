"""One colour, line and marker per matcher, the same in every figure and told apart in grey too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

LineStyle: TypeAlias = str | tuple[int, tuple[int, ...]]

# Okabe and Ito's palette (safe for colour-blind readers), its light tones last.
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#8a4a7d", "#b07a00", "#3b3b3b", "#4aa3d8")
_LINES: tuple[LineStyle, ...] = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 3)), (0, (1, 3)))
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----", "++++")


@dataclass(frozen=True)
class Style:
    """How a matcher is drawn."""

    colour: str
    line: LineStyle
    marker: str
    hatch: str


def styles(labels: Sequence[str]) -> dict[str, Style]:
    """A style for each label by its place; colours, lines and markers repeat out of step beyond seven."""
    out = {}
    for place, label in enumerate(labels):
        lap = place // len(_COLOURS)
        out[label] = Style(
            _COLOURS[place % len(_COLOURS)],
            _LINES[(place + lap) % len(_LINES)],
            _MARKERS[(place + 2 * lap) % len(_MARKERS)],
            _HATCHES[(place + 3 * lap) % len(_HATCHES)],
        )
    return out
