"""The folder of an experiment: its result, its table and its figures as files."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable
from dataclasses import asdict
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

from hsslam.environment import environment
from hsslam.errors import DataError
from hsslam.io.atomic import atomic_path
from hsslam_eval.reproduce.experiment import Drawing, Experiment, Row, Table, Value
from hsslam_eval.reproduce.judge import tally

RESULT = "result.json"


def new_folder(folder: Path, names: Iterable[str]) -> Path:
    """Make the folder of a run; each experiment gets a folder of its own in it.

    Raises
    ------
    DataError
        It holds one of these experiments already, or cannot be made.
    """
    for name in names:
        if (folder / name).exists():
            raise DataError(f"{folder}: holds {name} of an earlier run; choose another --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataError(f"{folder}: the folder cannot be made: {error.strerror}") from error
    return folder


def write_experiment(experiment: Experiment, parent: Path) -> Path:
    """Write ``result.json``, ``table.csv``, ``table.md`` and the figures into ``parent/<name>``.

    Figures are PNG and SVG, the first named ``figure``, others by their keys. ``result.json`` comes last: where it
    is, the rest is complete.

    Raises
    ------
    DataError
        A file cannot be written.
    """
    folder = parent / experiment.name
    for place, drawing in enumerate(experiment.drawings):
        _write_figure(drawing, folder, stem(place, drawing))
    _write_text(folder / "table.csv", csv_text(experiment))
    _write_text(folder / "table.md", markdown_tables(experiment))
    _write_text(folder / RESULT, json.dumps(as_dict(experiment), indent=1, ensure_ascii=False) + "\n")
    return folder


def stem(place: int, drawing: Drawing) -> str:
    """Name of the file of a drawing, without its suffix."""
    return "figure" if place == 0 else drawing.key


def as_dict(experiment: Experiment) -> dict[str, Any]:
    """Everything but the figures as JSON types; what does not exist (NaN) is None."""
    plain = {
        "name": experiment.name,
        "title": experiment.title,
        "summary": experiment.summary,
        "verdict": tally(experiment.claims),
        "claims": [asdict(claim) for claim in experiment.claims],
        "tables": [asdict(table) for table in experiment.tables],
        "figures": [
            {"file": f"{stem(place, drawing)}.png", "caption": drawing.caption}
            for place, drawing in enumerate(experiment.drawings)
        ],
        "data": experiment.data,
        "attribution": experiment.attribution,
        "seeds": list(experiment.seeds),
        "counts": experiment.counts,
        "config": experiment.config,
        "notes": list(experiment.notes),
        "environment": environment(),
        "series": experiment.series,
    }
    found = _finite(plain)
    assert isinstance(found, dict)
    return found


def csv_text(experiment: Experiment) -> str:
    """One line per cell: table, row, column, our value, its interval, the paper's value, or a text."""
    buffer = StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(["table", "row", "column", "value", "low", "high", "paper", "text"])
    for table in experiment.tables:
        for row in table.rows:
            for heading, cell in zip(table.headings, row.cells, strict=True):
                plain = heading.replace("\N{NO-BREAK SPACE}", " ")
                writer.writerow([table.title, row.label, plain, *_fields(cell)])
    return buffer.getvalue()


def markdown_tables(experiment: Experiment) -> str:
    """All tables as Markdown."""
    return "\n".join(markdown_table(table) for table in experiment.tables)


def markdown_table(table: Table) -> str:
    """Lay a table out: value (interval), and the paper's figure where there is one."""
    lines = [f"### {table.title}", "", table.explanation, ""]
    lines.append("| " + " | ".join(map(_escape, (table.corner, *table.headings))) + " |")
    lines.append("| :-- |" + " --: |" * len(table.headings))
    lines += [_markdown_row(row) for row in table.rows]
    return "\n".join(lines) + "\n"


def ours(cell: Value | str) -> str:
    """Our figure as text."""
    return cell if isinstance(cell, str) else number(cell.value)


def interval(cell: Value | str) -> str:
    """Its interval as text, empty where there is none."""
    if isinstance(cell, str) or not math.isfinite(cell.low):
        return ""
    return f"{number(cell.low)} to {number(cell.high)}"


def paper(cell: Value | str) -> str:
    """The paper's figure as text, empty where there is none."""
    if isinstance(cell, str) or not math.isfinite(cell.paper):
        return ""
    return f"paper {number(cell.paper)}"


def number(value: float) -> str:
    """Three significant digits, more before the point, powers of ten far from 1; a dash where there is no figure."""
    if not math.isfinite(value):
        return "–"  # noqa: RUF001
    if value == 0.0:
        return "0"
    if not 1e-4 <= abs(value) < 1e6:
        return f"{value:.1e}"
    digits = min(max(0, 2 - math.floor(math.log10(abs(value)))), 5)
    text = f"{value:.{digits}f}"
    return text.removesuffix(".0") if abs(value) >= 100.0 else text


def png(drawing: Drawing) -> bytes:
    """A drawing as PNG; the same drawing gives the same bytes."""
    buffer = BytesIO()
    drawing.figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _write_figure(drawing: Drawing, folder: Path, name: str) -> None:
    with atomic_path(folder / f"{name}.png") as temporary:
        temporary.write_bytes(png(drawing))
    with atomic_path(folder / f"{name}.svg") as temporary:
        drawing.figure.savefig(temporary, format="svg", metadata={"Date": None, "Creator": None})


def _write_text(path: Path, text: str) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _fields(cell: Value | str) -> list[str]:
    if isinstance(cell, str):
        return ["", "", "", "", cell]
    figures = (cell.value, cell.low, cell.high, cell.paper)
    return [*(f"{figure:.6g}" if math.isfinite(figure) else "" for figure in figures), ""]


def _markdown_row(row: Row) -> str:
    cells = []
    for cell in row.cells:
        extra = [part for part in (interval(cell), paper(cell)) if part]
        cells.append(f"{ours(cell)} ({'; '.join(extra)})" if extra else ours(cell))
    return "| " + " | ".join(_escape(text) for text in (row.label, *cells)) + " |"


def _escape(text: str) -> str:
    return text.replace("|", r"\|").replace("\n", " ")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
