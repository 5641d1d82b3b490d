"""The report of a comparison: one self-contained HTML page, its Markdown twin, and its tables and plots as files."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from hsslam.io.atomic import atomic_path
from hsslam_eval.comparison import Comparison, Study
from hsslam_eval.csv_files import write_csv_files
from hsslam_eval.figures import Picture, place_pictures, slam_pictures, trial_pictures
from hsslam_eval.report_text import (
    Problem,
    contestants_table,
    count,
    equal_terms,
    facts,
    place_text,
    problems,
    sentence,
    settings,
    trial_text,
)
from hsslam_eval.slam_tables import slam_tables
from hsslam_eval.table_files import to_csv, to_latex
from hsslam_eval.tables import Table
from hsslam_eval.trial_tables import trial_tables, verdict


def write_report(found: Study | Comparison, folder: Path | str) -> Path:
    """Write the report of a comparison into its folder.

    Makes ``report.html`` (nothing in it is loaded from elsewhere), ``report.md``, ``figures/`` (every plot as PNG, SVG
    and PDF), ``tables/`` (every table as CSV and LaTeX), ``trials.csv`` (a row per matcher), ``trials_raw.csv`` (a row
    per trial) and ``slam.csv`` (a row per run).

    Parameters
    ----------
    found : Study or Comparison
        From `hsslam_eval.compare`, `Study.load`, or `hsslam_eval.existing_runs`.
    folder : path
        Where to; maps are taken from the run folders in it.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    study = found if isinstance(found, Study) else Study([found])
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    parts = [_part(comparison, stem, folder) for comparison, stem in _stems(study)]
    for part in parts:
        for picture in part.pictures:
            for kind, content in picture.files.items():
                _write(folder / "figures" / f"{picture.key}.{kind}", content)
        for item in part.tables:
            _write(folder / "tables" / f"{item.key}.csv", item.csv.encode())
            _write(folder / "tables" / f"{item.key}.tex", item.latex.encode())
    shown = _content(study, parts)
    templates = _templates()
    for name in ("report.md", "report.html"):
        _write(folder / name, templates.get_template(f"{name}.j2").render(shown).encode())
    write_csv_files(study, folder)
    return folder / "report.html"


@dataclass(frozen=True)
class TableFiles:
    """A table with what it is called and its other forms."""

    key: str
    table: Table
    csv: str
    latex: str

    @property
    def links(self) -> list[tuple[str, str, str]]:
        """Name, file name and data URL of each form that can be saved from the page."""
        forms = (("CSV", "csv", "text/csv", self.csv), ("LaTeX", "tex", "text/x-tex", self.latex))
        return [
            (
                name,
                f"{self.key}.{suffix}",
                f"data:{kind};charset=utf-8;base64,{base64.b64encode(text.encode()).decode('ascii')}",
            )
            for name, suffix, kind, text in forms
        ]


@dataclass(frozen=True)
class Part:
    """What a page shows of one dataset."""

    id: str
    name: str
    description: str
    problems: list[Problem]
    verdict: str
    trial_text: str
    trial_tables: list[TableFiles]
    trial_figures: list[Picture]
    slam_tables: list[TableFiles]
    slam_figures: list[Picture]
    place_text: str
    place_figures: list[Picture]

    @property
    def tables(self) -> list[TableFiles]:
        """Every table."""
        return [*self.trial_tables, *self.slam_tables]

    @property
    def pictures(self) -> list[Picture]:
        """Every picture."""
        return [*self.trial_figures, *self.slam_figures, *self.place_figures]


def _stems(study: Study) -> Iterator[tuple[Comparison, str]]:
    """Each comparison with what its files are called: the dataset's name, numbered where two share it."""
    taken: dict[str, int] = {}
    for comparison in study.comparisons:
        stem = re.sub(r"[^0-9A-Za-z_+-]", "_", comparison.dataset.name) or "log"
        taken[stem] = taken.get(stem, 0) + 1
        yield comparison, stem if taken[stem] == 1 else f"{stem}-{taken[stem]}"


def _part(comparison: Comparison, stem: str, folder: Path) -> Part:
    def with_files(tables: Sequence[Table]) -> list[TableFiles]:
        return [
            TableFiles(f"{stem}-{table.name}", table, to_csv(table), to_latex(table, f"{stem}-{table.name}"))
            for table in tables
        ]

    return Part(
        id=stem,
        name=comparison.dataset.name,
        description=sentence(comparison.dataset.description),
        problems=problems(comparison),
        verdict=verdict(comparison),
        trial_text=trial_text(comparison),
        trial_tables=with_files(trial_tables(comparison)),
        trial_figures=trial_pictures(comparison, stem),
        slam_tables=with_files(slam_tables(comparison)),
        slam_figures=slam_pictures(comparison, stem),
        place_text=place_text(comparison),
        place_figures=place_pictures(comparison, stem, folder),
    )


def _content(study: Study, parts: Sequence[Part]) -> dict[str, Any]:
    first = study.comparisons[0]
    version = str(first.environment.get("hsslam", ""))
    labels = {matcher.label for comparison in study.comparisons for matcher in comparison.matchers}
    thing = "system" if any(comparison.notes for comparison in study.comparisons) else "matcher"
    names = " and ".join(part.name for part in parts)
    return {
        "version": version,
        "title": f"{names}: {count(len(labels), thing)} compared",
        "subtitle": f"Made by hsslam {version}, {first.created.replace('T', ' ')}.",
        "attributions": list(
            dict.fromkeys(c.dataset.attribution for c in study.comparisons if c.dataset.attribution)
        ),
        "equal_terms": equal_terms(study),
        "contestants": contestants_table(study),
        "parts": parts,
        "facts": facts(study),
        "command": first.command,
        "settings": settings(study),
    }


def _templates() -> Environment:
    templates = Environment(
        loader=PackageLoader("hsslam_eval"),
        autoescape=lambda name: name is not None and ".html" in name,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    # A heading may break between its words, not within its unit.
    templates.filters["tight"] = lambda text: re.sub(
        r"\([^)]*\)|Δ \w", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), text
    )
    templates.filters["cell"] = lambda text: str(text).replace("|", r"\|").replace("\n", " ")
    return templates


def _write(path: Path, content: bytes) -> None:
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)
