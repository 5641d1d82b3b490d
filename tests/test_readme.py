"""What the documents say is true: their commands parse, their examples run, their links lead somewhere."""

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

import pytest
import typer
import yaml

from hsslam.cli.main import app
from hsslam.version import __version__

ROOT = Path(__file__).parent.parent
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").glob("*.md")),
]

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


def blocks(document: Path) -> Iterator[Block]:
    fences = re.findall(r"^```(\S*)[ ]*([^\n]*)\n(.*?)^```$", document.read_text(), re.MULTILINE | re.DOTALL)
    for language, marks, text in fences:
        yield Block(document.name, language, tuple(marks.split()), text)


def hsslam_commands() -> list[tuple[str, str]]:
    shell = [block for document in DOCUMENTS for block in blocks(document) if block.language == "sh"]
    lines = [(block.document, line) for block in shell for line in block.text.splitlines()]
    return [(document, line) for document, line in lines if line.startswith("hsslam ")]


def test_there_are_commands_to_check() -> None:
    assert len(hsslam_commands()) >= 8


def parse(line: str) -> None:
    """Walk down to the verb and parse its options, without running it."""
    command: Any = typer.main.get_command(app)
    words = shlex.split(line, comments=True)[1:]
    if not words:
        return
    name, command, rest = command.resolve_command(command.make_context("hsslam", list(words)), words)
    while command is not None and hasattr(command, "commands") and rest:
        name, command, rest = command.resolve_command(command.make_context(name, list(rest)), rest)
    assert command is not None
    command.make_context(name, list(rest))


@pytest.mark.parametrize(("document", "line"), hsslam_commands())
def test_command_parses(document: str, line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsslam.plugin_files.use", lambda file: None)
    parse(line)


@pytest.mark.parametrize(
    "wrong", ["hsslam rum office", "hsslam run office --matchr hide", "hsslam datasets fetsch intel"]
)
def test_a_wrong_command_does_not_parse(wrong: str) -> None:
    with pytest.raises(Exception, match=r"No such|no such"):
        parse(wrong)


def run_blocks(document: Path, place: Path) -> Path:
    """Write a document's files and run its blocks, in their order; the folder where that happened."""
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
            target = work / block.file
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(block.text)
        elif "run" in block.marks:
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


def test_readme_examples_run_in_order(tmp_path: Path) -> None:
    work = run_blocks(ROOT / "README.md", tmp_path)
    assert "loop_matcher:\n  name: glasm" in (work / "runs/mine/config.yaml").read_text()
    assert "nearest" in (work / "runs/race/report.md").read_text()


def test_the_tutorial_for_extenders_runs_in_order(tmp_path: Path) -> None:
    work = run_blocks(ROOT / "docs" / "extend.md", tmp_path)
    assert "my_matcher" in (work / "runs/race/report.md").read_text()
    assert len((work / "runs/spin/trajectory.tum").read_text().splitlines()) == 20


def test_the_citation_names_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0"
    assert str(citation["version"]) == __version__
    assert citation["references"][0]["doi"].startswith("10.1016/")


def test_the_hooks_of_commits_are_tools_of_the_environment() -> None:
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    tools = {hook["entry"].split()[0] for hook in local["hooks"]}
    assert tools == {".venv/bin/ruff", ".venv/bin/mypy"}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files(document: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)\)", document.read_text())
    local = [link for link in links if "://" not in link]
    assert [link for link in local if not (document.parent / link).exists()] == []
