"""A report's tables as files: CSV at full precision, and LaTeX for the booktabs package."""

from __future__ import annotations

import csv
import re
from io import StringIO

from hsslam_eval.tables import Cell, Row, Table

_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "|": r"\textbar{}",
    "±": r"$\pm$",
    "°": r"$^\circ$",
    "Δ": r"$\Delta$",
    "★": r"$\star$",
    "\N{EN DASH}": "--",
    "\N{NO-BREAK SPACE}": "~",
}


def to_csv(table: Table) -> str:
    """A line a row; numbers with all their digits, a column more for each end of an interval, or for a spread.

    A row that is missing has its reason in the last column, ``note``.
    """
    widths = [_width(table.rows, place) for place in range(len(table.headings))]
    headings = [table.corner]
    before = ""
    for heading, width in zip(table.headings, widths, strict=True):
        heading = heading.replace("\N{NO-BREAK SPACE}", " ")
        # A heading that comes again belongs to the column before it.
        name = f"{before}: {heading}" if table.headings.count(heading) > 1 else heading
        endings = {3: ("", " low", " high"), 2: ("", f" {table.second}")}.get(width, ("",))
        headings += [name + ending for ending in endings]
        before = heading
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*headings, "note"])
    for row in table.rows:
        values: list[str] = []
        for place, width in enumerate(widths):
            values += _values(row.cells[place], width) if row.cells else [""] * width
        writer.writerow([row.label, *values, row.note])
    return out.getvalue()


def to_latex(table: Table, label: str) -> str:
    r"""A ``table`` float: needs ``booktabs`` and ``graphicx``; what is best is bold, intervals are below in small.

    A table wider than the text is made smaller until it fits.
    """
    columns = len(table.headings)
    lines = [
        r"% \usepackage{booktabs,graphicx}",
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{_escape(table.title)}. {_escape(table.explanation)}}}",
        rf"\label{{tab:{label}}}",
        r"\setlength{\tabcolsep}{4pt}",
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        rf"\begin{{tabular}}{{l{'r' * columns}}}",
        r"\toprule",
        " & ".join(_heading(heading) for heading in (table.corner, *table.headings)) + r" \\",
        r"\midrule",
    ]
    for row in table.rows:
        if row.note:
            lines.append(
                rf"{_escape(row.label)} & \multicolumn{{{columns}}}{{p{{0.7\linewidth}}}}{{{_escape(row.note)}}} \\"
            )
            continue
        # The sign beside bold, since the caption speaks of it.
        texts = [
            rf"\textbf{{{_escape(cell.text + table.mark)}}}" if cell.best else _escape(cell.text)
            for cell in row.cells
        ]
        lines.append(" & ".join([_escape(row.label), *texts]) + r" \\")
        if any(cell.interval for cell in row.cells):
            small = [
                rf"{{\scriptsize {_escape(cell.interval)}}}" if cell.interval else "" for cell in row.cells
            ]
            lines.append(" & ".join(["", *small]) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}}", r"\end{table}", ""])


def _heading(text: str) -> str:
    """A heading whose unit is on a line of its own, or the table would not fit a page."""
    lines = [_escape(line) for line in re.split(r" (?=\()|(?<=\)) ", text) if line]
    stacked = r" \\ ".join(lines)
    return rf"\shortstack[r]{{{stacked}}}" if len(lines) > 1 else stacked


def _width(rows: list[Row], place: int) -> int:
    return max([len(row.cells[place].numbers) for row in rows if row.cells] or [1]) or 1


def _values(cell: Cell, width: int) -> list[str]:
    values = [repr(float(value)) for value in cell.numbers] or [_plain(cell.text)]
    return values + [""] * (width - len(values))


def _plain(text: str) -> str:
    return "" if text == "\N{EN DASH}" else text


def _escape(text: str) -> str:
    escaped = "".join(_LATEX.get(character, character) for character in text)
    # An arrow and the like: pdflatex stops at what it does not know.
    return re.sub(r"[^\x00-\x7f]", "?", escaped)
