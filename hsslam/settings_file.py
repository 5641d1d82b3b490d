"""Files of settings: YAML, read so that whatever is wrong in one is named by its line."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import yaml

from hsslam.errors import ConfigError

Key: TypeAlias = tuple[str | int, ...]
"""Where a setting stands: names of sections and numbers of list entries, outermost first."""


def read_yaml(path: Path | str) -> dict[str, Any]:
    """Read a YAML mapping with the safe loader.

    Raises
    ------
    ConfigError
        The file is not there, is no YAML, gives a key twice, or holds something else than a mapping.
    """
    root = _compose(path)
    if root is None:
        return {}
    try:
        data = yaml.SafeLoader("").construct_document(root)
    except yaml.YAMLError as error:
        raise _not_yaml(path, error) from error
    if not isinstance(data, dict):
        line = root.start_mark.line + 1
        raise ConfigError(f"{path}:{line}: expected settings (key: value), found {type(data).__name__}")
    return data


def blamed(error: ConfigError, path: Path | str) -> ConfigError:
    """The error with the place in the file in front, if it is the file's.

    A setting that the file does not hold, or holds with another value, was given elsewhere: such an error is
    returned as it is.
    """
    if error.key is None:
        return error
    if not error.key:
        return ConfigError(f"{path}: {error}")
    root = _compose(path)
    places = dict(_places(root, ())) if root is not None else {}
    candidates = [places[error.key]] if error.key in places else []
    # A matcher's errors know its parameter, not the section; a name may be an entry of a list.
    candidates += [place for key, place in places.items() if key[-1] == error.key[-1]]
    if isinstance(error.found, str):
        candidates += places.values()
    line = next((line for line, value in candidates if value == error.found), None)
    return error if line is None else ConfigError(f"{path}:{line}: {error}")


def _compose(path: Path | str) -> yaml.Node | None:
    try:
        text = Path(path).read_text(encoding="utf-8")
        root: yaml.Node | None = yaml.compose(text, yaml.SafeLoader)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, yaml.reader.ReaderError) as error:
        raise ConfigError(f"{path}: expected settings in YAML, found a file that is no text") from error
    except yaml.YAMLError as error:
        raise _not_yaml(path, error) from error
    if root is not None:
        _refuse_repeats(root, path)
    return root


def _not_yaml(path: Path | str, error: yaml.YAMLError) -> ConfigError:
    mark = getattr(error, "problem_mark", None)
    line = f":{mark.line + 1}" if mark is not None else ""
    problem = getattr(error, "problem", None) or str(error)
    hint = "; indent with blanks, not with tabs" if "'\\t'" in problem else ""
    return ConfigError(f"{path}{line}: not YAML: {problem}{hint}")


def _refuse_repeats(node: yaml.Node, path: Path | str) -> None:
    """YAML's loader would take the last of two settings of one name without a word."""
    if isinstance(node, yaml.MappingNode):
        first: dict[Any, int] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if key.value in first and isinstance(key, yaml.ScalarNode):
                raise ConfigError(
                    f"{path}:{line}: {key.value} is given twice, first in line {first[key.value]}; "
                    "put both under one"
                )
            if isinstance(key, yaml.ScalarNode):
                first[key.value] = line
            _refuse_repeats(value, path)
    elif isinstance(node, yaml.SequenceNode):
        for value in node.value:
            _refuse_repeats(value, path)


def _places(node: yaml.Node, key: Key) -> Iterator[tuple[Key, tuple[int, Any]]]:
    """Every setting below a node: its key, the line it stands on, its value."""
    if isinstance(node, yaml.MappingNode):
        entries = [(name.value, name.start_mark.line + 1, value) for name, value in node.value]
    elif isinstance(node, yaml.SequenceNode):
        entries = [(number, value.start_mark.line + 1, value) for number, value in enumerate(node.value)]
    else:
        return
    for name, line, value in entries:
        plain = yaml.SafeLoader("").construct_document(value)
        yield (*key, name), (line, plain)
        yield from _places(value, (*key, name))
