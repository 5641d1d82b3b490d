"""What mkdocs builds beyond the files in this folder: pages made from the README, the config models, the notebooks.

Nothing that is made here is committed.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parent))
from parameter_page import parameter_page

ROOT = Path(__file__).parent.parent
PAGES = {"start.md": "README.md", "contributing.md": "CONTRIBUTING.md", "changes.md": "CHANGELOG.md"}
"""Pages that are documents of the repository's root."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made."""
    made = {page: root_page((ROOT / source).read_text("utf-8")) for page, source in PAGES.items()}
    made["reference/parameters.md"] = parameter_page()
    for notebook in sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")):
        made[f"notebooks/{notebook.stem}.md"] = notebook_page(notebook)
    for name, text in made.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Turn what a fence tells the tests into what it tells the reader: a file's name becomes a title."""
    return re.sub(r"^```(\w+)[ ]+([^\n{]+)$", _fence, markdown, flags=re.MULTILINE)


def root_page(text: str) -> str:
    """A document of the root, its links seen from this folder."""
    for page, source in PAGES.items():
        text = text.replace(f"]({source})", f"]({page})")
    return text.replace("[LICENSE](LICENSE)", "LICENSE").replace("](docs/", "](")


def notebook_page(notebook: Path) -> str:
    """A notebook's cells as Markdown, its outputs left out."""
    parts = []
    for cell in json.loads(notebook.read_text("utf-8"))["cells"]:
        text = "".join(cell["source"])
        parts.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    head, rest = parts[0], parts[1:]
    return "\n\n".join([head, f"[The notebook]({notebook.name}), to run it yourself.", *rest]) + "\n"


def _fence(found: re.Match[str]) -> str:
    language, marks = found.groups()
    file = re.search(r"(?:^| )file=(\S+)", marks)
    return f'```{language} title="{file[1]}"' if file else f"```{language}"
