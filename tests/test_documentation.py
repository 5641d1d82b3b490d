"""The site beyond its texts: the page of parameters is whole, pictures are small, notebooks run and hold no outputs."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml
from documents import ROOT

from hsslam.config import Config
from hsslam.matching import registry

DOCS = ROOT / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))


def module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def flat(values: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def test_the_page_of_parameters_has_every_setting_with_its_default() -> None:
    page = module("parameter_page").parameter_page()
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    settings = [pair for pair in flat(Config().model_dump(mode="json")) if not pair[0].startswith("matcher.")]
    assert len(settings) > 40
    for name, value in settings:
        shown = "none" if value is None else str(value).lower() if isinstance(value, bool) else value
        assert f"`{shown}`" in rows[name], rows[name]
    for name in ("hsl", "hide", "glasm", "icp"):
        assert f"### `{name}`\n" in page
        assert set(registry.load(name).Config.model_fields) <= set(rows)


def test_every_page_is_in_the_navigation() -> None:
    def leaves(node: Any) -> Iterator[str]:
        if isinstance(node, str):
            yield node
        else:
            for inner in node.values() if isinstance(node, dict) else node:
                yield from leaves(inner)

    navigation = set(leaves(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    assert {str(page.relative_to(DOCS)) for page in DOCS.rglob("*.md")} <= navigation


@pytest.mark.parametrize("picture", sorted(DOCS.rglob("*.png")), ids=lambda path: path.name)
def test_pictures_are_small(picture: Path) -> None:
    assert picture.stat().st_size < 150_000


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_holds_no_outputs(notebook: Path) -> None:
    cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
    assert cells
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs_from_top_to_bottom(notebook: Path, tmp_path: Path) -> None:
    nbclient = pytest.importorskip("nbclient", reason="notebooks are not run: pip install 'hsslam[docs]'")
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("ipykernel", reason="notebooks are not run: pip install 'hsslam[docs]'")
    content = nbformat.read(notebook, as_version=4)
    nbclient.NotebookClient(content, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    assert all(cell.execution_count for cell in content.cells if cell.cell_type == "code")
