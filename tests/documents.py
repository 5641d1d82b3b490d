"""The blocks of the documents, and how they are run: what a fence says behind its language decides.

``run``: as it stands; ``run=small``: with fewer scans and trials; ``file=NAME``: written for the blocks that follow;
``not-run=WHY-NOT``: only parsed. Blocks of a document run in their order, in one folder.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from hsslam.cli.main import app

ROOT = Path(__file__).parent.parent
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
SMALL = {
    "run": ["--scans", "60"],
    "eval": ["--scans", "60"],
    "compare": ["--scans", "60", "--trials", "5", "--no-slam"],
}
"""What ``run=small`` adds to a command."""

PIP = """\
#!/bin/sh
# pip as the README calls it, but offline and into a folder of the test's own.
command=$1
shift
exec {python} -m pip --quiet "$command" --no-deps --no-build-isolation --target {target} "$@"
"""


@dataclass(frozen=True)
class Block:
    """A fenced block: its info string's words and its text."""

    document: str
    language: str
    marks: tuple[str, ...]
    text: str

    @property
    def file(self) -> str | None:
        """Name after ``file=``, if any."""
        return next((mark.removeprefix("file=") for mark in self.marks if mark.startswith("file=")), None)

    @property
    def runs(self) -> bool:
        """Whether it is to be run."""
        return "run" in self.marks or "run=small" in self.marks

    @property
    def excuse(self) -> str | None:
        """Why it is not run, if it says so."""
        return next(
            (mark.removeprefix("not-run=") for mark in self.marks if mark.startswith("not-run=")), None
        )


def blocks(document: Path) -> Iterator[Block]:
    fences = re.findall(r"^```(\S*)[ ]*([^\n]*)\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL)
    for language, marks, text in fences:
        yield Block(str(document.relative_to(ROOT)), language, tuple(marks.split()), text)


def write(block: Block, folder: Path) -> None:
    assert block.file is not None
    target = folder / block.file
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(block.text)


def run_blocks(document: Path, place: Path) -> Path:
    """Write a document's files and run its blocks in a shell; the folder where that happened."""
    shims, site, work = place / "bin", place / "site", place / "work"
    shims.mkdir()
    work.mkdir()
    pip = shims / "pip"
    pip.write_text(PIP.format(python=sys.executable, target=site))
    pip.chmod(0o755)
    path = os.pathsep.join([str(shims), str(Path(sys.executable).parent), os.environ["PATH"]])
    import_path = os.pathsep.join(filter(None, [str(site), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "PATH": path, "PYTHONPATH": import_path, "MPLBACKEND": "Agg"}
    ran = 0
    for block in blocks(document):
        if block.file is not None:
            write(block, work)
        elif block.runs:
            interpreter = {"sh": ["sh", "-e"], "python": [sys.executable, "-"]}[block.language]
            done = subprocess.run(
                interpreter,
                input=block.text,
                cwd=work,
                env=environment,
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, f"{block.text}\n{done.stdout}\n{done.stderr}"
            ran += 1
    assert ran >= 5
    return work


def run_blocks_here(document: Path) -> int:
    """Write a document's files and run its blocks in this process and folder, which is faster; how many ran.

    Shell blocks hold nothing but ``hsslam`` commands; Python blocks share their names.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    ran = 0
    for block in blocks(document):
        if block.file is not None:
            write(block, Path.cwd())
        elif block.runs:
            if block.language == "python":
                exec(compile(block.text, block.document, "exec"), names)
            else:
                for line in filter(None, block.text.splitlines()):
                    _command(line, small="run=small" in block.marks)
            ran += 1
    return ran


def _command(line: str, *, small: bool) -> None:
    program, *words = shlex.split(line, comments=True)
    assert program == "hsslam", f"{line}: only hsslam is run in this process"
    if small and "--resume" not in words:
        words += SMALL.get(words[0], [])
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0, f"{line}\n{done.output}"
