"""What the documents say is true: their commands parse, their examples run, their links lead somewhere."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml
from documents import DOCUMENTS, ROOT, Block, blocks, run_blocks, run_blocks_here

from hsslam.cli.main import app
from hsslam.version import __version__

CODE = ("bash", "console", "pycon", "python", "sh", "shell", "toml", "yaml")
"""Languages whose blocks are run, written to a file, or say why not."""

IN_A_SHELL = (ROOT / "README.md", ROOT / "docs" / "extend.md")
"""Documents that install packages: they run in a shell of their own."""

MADE = [ROOT / "docs" / page for page in ("start.md", "notebooks/matching.md", "reference/parameters.md")]
"""Pages that the site's build makes; that there are links to no others is found by ``mkdocs build --strict``."""

PAGES = [page for page in DOCUMENTS if page not in IN_A_SHELL and any(block.runs for block in blocks(page))]


def name_of(document: Path) -> str:
    return str(document.relative_to(ROOT))


def hsslam_commands() -> list[tuple[str, str]]:
    shell = [block for document in DOCUMENTS for block in blocks(document) if block.language == "sh"]
    lines = [(block.document, line) for block in shell for line in block.text.splitlines()]
    return [(document, line) for document, line in lines if line.startswith("hsslam ")]


def test_there_are_commands_to_check() -> None:
    assert len(hsslam_commands()) >= 8


def parse(line: str) -> str:
    """Walk down to the verb and parse its options, without running it; the verb."""
    command: Any = typer.main.get_command(app)
    words = shlex.split(line, comments=True)[1:]
    if not words:
        return ""
    name, command, rest = command.resolve_command(command.make_context("hsslam", list(words)), words)
    while command is not None and hasattr(command, "commands") and rest:
        name, command, rest = command.resolve_command(command.make_context(name, list(rest)), rest)
    assert command is not None
    command.make_context(name, list(rest))
    return str(name)


@pytest.mark.parametrize(("document", "line"), hsslam_commands())
def test_command_parses(document: str, line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsslam.plugin_files.use", lambda file: None)
    assert parse(line) in ("", *shlex.split(line, comments=True))


@pytest.mark.parametrize(
    "wrong", ["hsslam rum office", "hsslam run office --matchr hide", "hsslam datasets fetsch intel"]
)
def test_a_wrong_command_does_not_parse(wrong: str) -> None:
    with pytest.raises(Exception, match=r"No such|no such"):
        parse(wrong)


def test_a_block_without_a_mark_is_found(tmp_path: Path) -> None:
    assert unmarked(Block("x.md", "sh", (), "hsslam run office\n"))
    assert unmarked(Block("x.md", "", (), "$ hsslam run office\n"))
    assert not unmarked(Block("x.md", "sh", ("not-run=downloads-a-log",), "hsslam compare intel\n"))
    assert not unmarked(Block("x.md", "text", (), "its process was ended\n"))


def unmarked(block: Block) -> bool:
    """Whether a block is code and does not say whether it is run."""
    code = block.language in CODE or re.search(r"^(\$ )?hsslam ", block.text, re.MULTILINE)
    return bool(code) and not (block.runs or block.file or block.excuse)


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_every_block_is_run_or_says_why_not(document: Path) -> None:
    assert [block.text for block in blocks(document) if unmarked(block)] == []


@pytest.mark.parametrize("document", PAGES, ids=name_of)
def test_a_page_runs_in_order(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)  # no windows
    monkeypatch.chdir(tmp_path)
    ran = run_blocks_here(document)
    assert ran == sum(block.runs and block.file is None for block in blocks(document))


def test_there_are_pages_to_run() -> None:
    assert len(PAGES) >= 8


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


@pytest.mark.parametrize("document", DOCUMENTS, ids=name_of)
def test_links_lead_to_files(document: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)\)", document.read_text())
    local = [link for link in links if "://" not in link]
    targets = [Path(os.path.normpath(document.parent / link)) for link in local]
    assert [target for target in targets if not (target.exists() or target in MADE)] == []
