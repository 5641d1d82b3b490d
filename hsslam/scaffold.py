"""The beginning of a matcher's package: one that works, its test, the line that makes it known."""

from __future__ import annotations

import importlib.util
import keyword
import re
import tempfile
from importlib import resources
from pathlib import Path

from hsslam.errors import ConfigError, DataError
from hsslam.version import __version__

_NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z][a-z0-9]*)*")


def new_matcher(name: str, folder: Path) -> list[Path]:
    """Write a package with a matcher of that name into a new folder.

    Parameters
    ----------
    name : str
        Of the matcher and of its module: lower case, words joined by underscores.
    folder : path
        Made if it is not there; must be empty.

    Returns
    -------
    list of Path
        The files, relative to the folder.

    Raises
    ------
    ConfigError
        The name is none for a module, or is taken.
    DataError
        The folder holds something, or cannot be made.
    """
    _check_form(name)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise DataError(f"{folder}: exists already; name a new folder")
    _check_free(name)
    words = {
        "name": name,
        "class_name": "".join(word.capitalize() for word in name.split("_")),
        "distribution": name.replace("_", "-"),
        "version": __version__,
    }
    texts = {Path(place.replace("NAME", name)): _render(template, words) for template, place in _FILES}
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as temporary:
            made = Path(temporary) / "package"
            for place, text in texts.items():
                (made / place).parent.mkdir(parents=True, exist_ok=True)
                (made / place).write_text(text, encoding="utf-8")
            made.rename(folder)
    except OSError as error:
        raise DataError(f"{folder}: cannot be made: {error.strerror}") from error
    return list(texts)


_FILES = (
    ("module.py.j2", "NAME.py"),
    ("test.py.j2", "tests/test_NAME.py"),
    ("pyproject.toml.j2", "pyproject.toml"),
    ("README.md.j2", "README.md"),
)
"""Templates, and what becomes of them."""


def _check_form(name: str) -> None:
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        guess = re.sub(r"[^a-z0-9]+", "_", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()).strip("_")
        hint = f"; try {guess}" if _NAME.fullmatch(guess) and guess != name else ""
        raise ConfigError(
            f"a matcher's name is lower case, words joined by underscores, like my_matcher; found {name!r}{hint}"
        )


def _check_free(name: str) -> None:
    from hsslam.matching import registry

    if name in registry.names():
        raise ConfigError(f"a matcher named {name!r} exists already; give yours another name")
    if importlib.util.find_spec(name) is not None:
        raise ConfigError(f"a Python module named {name!r} exists already; give yours another name")


def _render(template: str, words: dict[str, str]) -> str:
    import jinja2

    text = (resources.files("hsslam") / "templates" / "matcher" / template).read_text(encoding="utf-8")
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return environment.from_string(text).render(words)
