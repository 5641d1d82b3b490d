"""Tables as CSV and LaTeX: nothing lost, nothing that LaTeX would stop at."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from io import StringIO
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsslam_eval.table_files import to_csv, to_latex
from hsslam_eval.tables import Cell, Row, Table

BEST = Cell("12.3", "11 to 13", True, (12.345678, 11.1, 13.9))
TABLE = Table(
    "demo",
    "Demo & more",
    "With 95 % intervals; Δ is ±1°, a_b < c.",
    ["success (%)", "runs", "± seeds"],
    [
        Row("hide_2", [BEST, Cell("5"), Cell("0.1", "± 0.2", False, (0.1, 0.2))]),
        Row("icp", [Cell("\N{EN DASH}"), Cell("4 of 5"), Cell("\N{EN DASH}")]),
        Row("gone", note="failed: no module #1, 100 % {sure}"),
    ],
)  # fmt: skip


def test_csv_has_every_digit_and_every_end() -> None:
    rows = list(csv.DictReader(StringIO(to_csv(TABLE))))
    assert [row["matcher"] for row in rows] == ["hide_2", "icp", "gone"]
    assert [float(rows[0][f"success (%){end}"]) for end in ("", " low", " high")] == [12.345678, 11.1, 13.9]
    assert (rows[0]["± seeds"], rows[0]["± seeds spread"]) == ("0.1", "0.2")
    assert (rows[1]["success (%)"], rows[1]["runs"]) == ("", "4 of 5")
    assert rows[2]["note"] == "failed: no module #1, 100 % {sure}" and rows[2]["runs"] == ""


def test_latex_is_booktabs_with_whole_rows() -> None:
    text = to_latex(TABLE, "demo")
    body = text[text.index(r"\toprule") : text.index(r"\bottomrule")]
    rows = [line for line in body.splitlines() if line.endswith(r"\\")]
    assert len(rows) == 5
    for line in rows:
        spanned = 2 if r"\multicolumn{3}" in line else 0
        assert len(re.findall(r"(?<!\\)&", line)) + spanned == 3
    assert r"\textbf{12.3 $\star$}" in text and r"hide\_2" in text and r"Demo \& more" in text
    assert r"\#1, 100 \% \{sure\}" in text


@given(st.text(max_size=30))
def test_latex_never_sees_what_it_stops_at(text: str) -> None:
    found = to_latex(
        Table("t", text, text, [text], [Row(text, [Cell(text, text)]), Row("x", note=text)]), "t"
    )
    assert found.isascii()
    without = re.sub(r"\\[#%&_${}]", "", found)
    assert not re.search(r"(?<!\\)#", without)
    assert without.count("{") == without.count("}")
    assert without.count("$") % 2 == 0


def test_latex_compiles(tmp_path: Path) -> None:
    compiler = shutil.which("pdflatex") or shutil.which("tectonic")
    if compiler is None:
        pytest.skip("LATEX NOT TESTED: no pdflatex, no tectonic")
    wide = Table("wide", "Wide", "", ["a long heading (m per m)"] * 12, [Row("a_matcher", [BEST] * 12)])
    start, end = r"\documentclass{article}\usepackage{booktabs,graphicx}\begin{document}", r"\end{document}"
    document = start + to_latex(TABLE, "demo") + to_latex(wide, "wide") + end
    (tmp_path / "demo.tex").write_text(document)
    done = subprocess.run(
        [compiler, "demo.tex"], cwd=tmp_path, check=True, stdin=subprocess.DEVNULL, capture_output=True
    )
    assert b"Overfull" not in done.stdout
