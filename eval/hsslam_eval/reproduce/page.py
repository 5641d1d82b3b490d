"""All experiments on one self-contained HTML page, and its Markdown twin."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from jinja2 import Environment, PackageLoader, StrictUndefined

from hsslam.environment import environment
from hsslam.io.atomic import atomic_path
from hsslam_eval.reproduce import files
from hsslam_eval.reproduce.experiment import Drawing, Experiment
from hsslam_eval.reproduce.judge import tally

VERDICTS = ("holds", "does not hold", "cannot be compared")


@dataclass(frozen=True)
class _Picture:
    file: str
    caption: str
    base64: str
    width: int
    height: int


def write_page(experiments: Sequence[Experiment], folder: Path, command: str = "") -> Path:
    """Write ``report.html`` (nothing in it is loaded from elsewhere) and ``report.md`` (figures beside it).

    Parameters
    ----------
    experiments : sequence of Experiment
        In the order of the page; their folders are in ``folder`` (`hsslam_eval.reproduce.files`).
    folder : Path
        Where to.
    command : str
        What makes the page again.

    Returns
    -------
    Path
        The page.
    """
    templates = Environment(
        loader=PackageLoader("hsslam_eval"),
        autoescape=lambda name: name is not None and ".html" in name,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    templates.filters |= {
        # A heading may break between its words, not within its unit.
        "tight": lambda text: re.sub(
            r"\([^)]*\)", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), text
        ),
        "ours": files.ours,
        "interval": files.interval,
        "paper": files.paper,
        "markdown": files.markdown_table,
    }
    content = _content(experiments, command)
    for name in ("report.md", "report.html"):
        text = templates.get_template(f"reproduce.{name.rpartition('.')[2]}.j2").render(content)
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return folder / "report.html"


def _content(experiments: Sequence[Experiment], command: str) -> dict[str, Any]:
    here = environment()
    packages = ", ".join(f"{name} {version}" for name, version in here["packages"].items())
    return {
        "version": here["hsslam"],
        "title": "The paper's experiments, redone",
        "subtitle": "A novel efficient algorithm for mobile robot localization (HSL and HIDE): the paper's figures "
        f"beside ours, made by hsslam {here['hsslam']}.",
        "attribution": " ".join(dict.fromkeys(e.attribution for e in experiments if e.attribution)),
        "verdicts": VERDICTS,
        "experiments": [
            {
                "name": e.name,
                "title": e.title,
                "summary": e.summary,
                "data": e.data,
                "seeds": e.seeds,
                "counts": e.counts,
                "claims": e.claims,
                "tally": tally(e.claims),
                "tables": e.tables,
                "pictures": [_picture(place, drawing) for place, drawing in enumerate(e.drawings)],
                "notes": e.notes,
                "config": yaml.safe_dump(e.config, sort_keys=False).rstrip(),
            }
            for e in experiments
        ],
        "facts": [
            ("Processor", f"{here['cpu']}, {here['cores']} cores usable"),
            ("System", f"{here['system']} ({here['machine']})"),
            ("Python", here["python"]),
            ("Packages", packages),
        ],
        "command": command,
    }


def _picture(place: int, drawing: Drawing) -> _Picture:
    width, height = drawing.figure.get_size_inches()
    return _Picture(
        f"{files.stem(place, drawing)}.png",
        drawing.caption,
        base64.b64encode(files.png(drawing)).decode("ascii"),
        round(96 * width),
        round(96 * height),
    )
