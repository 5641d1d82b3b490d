"""The page of parameters, from the models that validate them."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator
from functools import reduce
from itertools import groupby

from pydantic import BaseModel

from hsslam.cli.matchers import parameters
from hsslam.config import Config
from hsslam.matching import registry
from hsslam_eval.compare_config import LimitSection
from hsslam_eval.trial_config import TrialConfig

HEAD = """\
# Parameters

Every setting, from the models that check it. `hsslam init` writes the same as a commented file, `hsslam config show`
prints what a run would use. In a file keys are nested; behind `--set` they have dots: `--set tracker.min_score=0.4`.

## SLAM

What `hsslam run --config` takes.
"""

MATCHERS = """\
## Matchers

Beside a matcher's name: `matcher: {name: hide, evaluations: 150}`, or `--set matcher.evaluations=150`. A loop matcher
has the same parameters under `loop_matcher`.
"""

COMPARISON = """\
## Comparisons

What `hsslam compare --config` takes beyond `matchers`, `seed` and `slam`, which holds the settings above.
"""


Row = tuple[str, str, str, str, str]


def parameter_page() -> str:
    """The page as Markdown.

    Raises
    ------
    hsslam.errors.MatcherUnavailableError
        A matcher of hsslam's own cannot be loaded: its parameters would be missing.
    """
    # The rest of a matcher's parameters are its own, below.
    rows = [(name.removesuffix(".name"), *told) for name, *told in _rows(Config)]
    parts = [HEAD, _table(row for row in rows if "." not in row[0])]
    nested = (row for row in rows if "." in row[0])
    for name, section in groupby(nested, key=lambda row: row[0].partition(".")[0]):
        parts += [*_heading(name, Config.model_fields[name].annotation), _table(section)]
    parts.append(MATCHERS)
    for name in registry.names():
        if registry.origin(name) == "hsslam":
            matcher = registry.load(name)
            parts += [f"### `{name}`", f"{matcher.summary}.", _table(_rows(matcher.Config))]
    parts.append(COMPARISON)
    for name, section in (("trials", TrialConfig), ("limits", LimitSection)):
        parts += [*_heading(name, section), _table(_rows(section, f"{name}."))]
    return "\n\n".join(parts) + "\n"


def _rows(model: type[BaseModel], prefix: str = "") -> Iterator[Row]:
    """Name, type, default, range and meaning; a default that a section gives its parts is found in the values."""
    values = model().model_dump(mode="json")
    for name, kind, default, extent, meaning in parameters(model.model_json_schema()):
        value = reduce(lambda node, key: node[key], name.split("."), values)
        yield prefix + name, kind, str(value) if default == "required" else default, extent, meaning


def _heading(name: str, model: type[BaseModel] | None) -> list[str]:
    return [f"### `{name}`", (inspect.getdoc(model) or "").partition("\n")[0]] if model is not None else []


def _table(rows: Iterable[Row]) -> str:
    lines = ["| parameter | type | default | range | meaning |", "|---|---|---|---|---|"]
    for name, kind, default, extent, meaning in rows:
        told = (f"`{name}`", kind, f"`{default}`" if default else "", extent.replace(" ", "\u00a0"), meaning)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in told) + " |")
    return "\n".join(lines)
