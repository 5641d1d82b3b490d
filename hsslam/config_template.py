"""A config as a commented YAML file: every setting, what it means, and where a preset changed it."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import yaml
from pydantic import BaseModel

from hsslam import presets as preset_files
from hsslam.config import Config, MatcherSection, load_config

_WIDTH = 100
_HEAD = """\
Settings of hsslam: every one there is, at its default. What you delete stays at its default.
Use: hsslam run DATASET --config FILE.  Check: hsslam config validate FILE.
"""


def commented(config: Config, presets: Sequence[str] = ()) -> str:
    """The config as YAML with a comment over every setting, made from the description of its field.

    Parameters
    ----------
    config : Config
        The values.
    presets : sequence of str
        What it was made with: their texts come at the top, so that their reasons are at hand, and what they
        changed is marked.

    Returns
    -------
    str
        Read back by `hsslam.config.load_config` it gives the same config.
    """
    default = load_config(chosen={"matcher": config.matcher.name})
    parts = [_comment(_HEAD)]
    for name in presets:
        preset = preset_files.load(name)
        parts.append(_comment(f"\nWith the preset {name}:\n{_reasons(preset.text)}"))
    body = "\n".join(_section(config, default, 0))
    return "\n".join([*parts, "", body, ""])


def _section(section: BaseModel, default: BaseModel | None, depth: int) -> Iterator[str]:
    pad = "  " * depth
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        before = getattr(default, name, None)
        if isinstance(value, BaseModel):
            told = field.description or _first_line(type(value))
            yield from _padded(told, pad, "")
            yield f"{pad}{name}:"
            if isinstance(value, MatcherSection):
                yield f"{pad}  name: {value.name}"
                other = before.parameters if isinstance(before, MatcherSection) else None
                yield from _section(value.parameters, other, depth + 1)
            else:
                yield from _section(value, before, depth + 1)
            if depth == 0:
                yield ""
        else:
            changed = default is not None and value != before
            yield from _padded(
                field.description or "", pad, f"; {_scalar(before)} without the preset" if changed else ""
            )
            yield f"{pad}{name}: {_scalar(value)}"
            if depth == 0:
                yield ""


def _padded(text: str, pad: str, more: str) -> list[str]:
    return [f"{pad}{line}" for line in _comment(text + more).splitlines()] if text + more else []


def _comment(text: str) -> str:
    lines = [
        wrapped
        for line in text.splitlines()
        for wrapped in (textwrap.wrap(line, _WIDTH, break_long_words=False, break_on_hyphens=False) or [""])
    ]
    return "\n".join(f"# {line}".rstrip() for line in lines)


def _reasons(text: str) -> str:
    """The comments of a preset's file, without the settings between them: its first line, then a paragraph each."""
    summary, *lines = text.splitlines()
    paragraphs = [summary.lstrip("# ")]
    comment = False
    for line in lines:
        if comment and line.startswith("#"):
            paragraphs[-1] += f" {line.lstrip('# ')}"
        elif line.startswith("#"):
            paragraphs.append(line.lstrip("# "))
        comment = line.startswith("#")
    return "\n".join(paragraphs)


def _first_line(model: type[BaseModel]) -> str:
    return (inspect.getdoc(model) or "").partition("\n")[0].rstrip(".")


def _scalar(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=10_000).removesuffix("...\n").strip()
