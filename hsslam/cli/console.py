"""What the command prints: results to stdout, progress and errors to stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

_WIDTH_OF_A_FILE = 10_000


def say(line: str) -> None:
    """Print a line of result."""
    print(line)


def complain(line: str) -> None:
    """Print a line to stderr, under the command's name."""
    print(f"hsslam: {line}", file=sys.stderr)


def table(headers: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Print a table; on a terminal long cells are folded to its width, in a file they stay on their line."""
    from rich.console import Console
    from rich.table import Table

    shown = Table(box=None, pad_edge=False, show_header=any(headers), header_style="bold")
    for header in headers:
        shown.add_column(header, overflow="fold")
    for row in rows:
        shown.add_row(*(str(cell) for cell in row))
    console = Console(
        file=sys.stdout,
        width=None if sys.stdout.isatty() else _WIDTH_OF_A_FILE,
        markup=False,
        highlight=False,
        emoji=False,
    )
    with console.capture() as capture:
        console.print(shown)
    for line in capture.get().splitlines():
        print(line.rstrip())


def pairs(values: Iterable[tuple[str, object]]) -> None:
    """Print names and values side by side."""
    table(("", ""), values)


def print_json(values: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print JSON."""
    print(json.dumps(values, indent=2))
