"""The blocks of the documents, and how they are run: what a fence says behind its language decides.

``run``: as it stands; ``run=small``: with fewer scans and trials; ``file=NAME``: written for the blocks that follow;
``not-run=WHY-NOT``: only parsed. Blocks of a document run in their order, in one folder.
"""

from __future__ import annotations

import importlib
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

from hsslam import plugin_files
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
    """Write a document's files and run its blocks in their order; the folder where that happened.

    All in one process of its own, since what they install must not reach other tests, and a start of Python for
    every line would take longer than all that they do. The first block of commands is run by a shell instead, as
    its reader would.
    """
    shims, site, work = place / "bin", place / "site", place / "work"
    for folder in (shims, site, work):
        folder.mkdir()
    pip = shims / "pip"
    pip.write_text(PIP.format(python=sys.executable, target=site))
    pip.chmod(0o755)
    path = os.pathsep.join([str(shims), str(Path(sys.executable).parent), os.environ["PATH"]])
    here = str(Path(__file__).parent)
    import_path = os.pathsep.join(filter(None, [str(site), here, os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "PATH": path, "PYTHONPATH": import_path, "MPLBACKEND": "Agg", "DISPLAY": ""}
    first = next(block for block in blocks(document) if block.runs and block.language == "sh")
    rest = f"import documents, pathlib; documents.run_blocks_here(pathlib.Path({str(document)!r}), 1)"
    for command, text in ((["sh", "-e"], first.text), ([sys.executable, "-c", rest], "")):
        done = subprocess.run(
            command, input=text, cwd=work, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{document.name}\n{done.stdout}\n{done.stderr}"
    return work


def run_blocks_here(document: Path, skipped: int = 0) -> int:
    """Write a document's files and run its blocks in this process and folder, which is faster; how many ran.

    Python blocks share their names. Of the shell's blocks the first ``skipped`` are passed over; other programs than
    ``hsslam`` are started.
    """
    names: dict[str, Any] = {"__name__": "__main__"}
    ran = 0
    for block in blocks(document):
        if block.file is not None:
            write(block, Path.cwd())
        elif block.runs:
            if block.language == "python":
                exec(compile(block.text, block.document, "exec"), names)
            elif skipped:
                skipped -= 1
            else:
                for line in filter(None, block.text.splitlines()):
                    _command(line, small="run=small" in block.marks)
            ran += 1
    return ran


def _command(line: str, *, small: bool) -> None:
    program, *words = shlex.split(line, comments=True)
    if program != "hsslam":
        subprocess.run([program, *words], check=True)
        importlib.invalidate_caches()  # it may have been pip
        return
    if small and "--resume" not in words:
        words += SMALL.get(words[0], [])
    # What --plugin names holds for the processes of one command, not for the next command.
    before = os.environ.get(plugin_files.VARIABLE, "")
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    os.environ[plugin_files.VARIABLE] = before
    assert done.exit_code == 0, f"{line}\n{done.output}"
