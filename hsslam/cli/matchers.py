"""``hsslam matchers``: which there are, and their parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import typer

from hsslam.cli import complete, console
from hsslam.cli.options import AsJson, Plugin

app: typer.Typer = typer.Typer(help="List the matchers and their parameters.", rich_markup_mode=None)


@app.callback(invoke_without_command=True)
def default(context: typer.Context, plugin: Plugin = None) -> None:
    """List the matchers and their parameters."""
    if context.invoked_subcommand is None:
        show()


@app.command("list")
def show(as_json: AsJson = False, plugin: Plugin = None) -> None:
    """List the matchers, and why one does not run here."""
    from dataclasses import asdict

    from hsslam.matching import registry

    registry.quarantine(registry.names())
    infos = [registry.describe(name) for name in registry.names()]
    if as_json:
        console.print_json([asdict(info) for info in infos])
        return
    console.table(
        ("name", "from", "what"),
        [
            (info.name, info.origin, info.summary if info.available else f"unavailable: {info.reason}")
            for info in infos
        ],
    )
    for info in infos:
        if not info.available:
            console.say(f"\n{info.name}: mend it with: {info.remedy}")


@app.command()
def describe(
    name: Annotated[str, typer.Argument(help="A matcher's name.", autocompletion=complete.matchers)],
    as_json: AsJson = False,
    plugin: Plugin = None,
) -> None:
    """Print a matcher's parameters.

    Name, type, default, range and meaning of each.
    """
    from hsslam.matching import registry

    schema = registry.load(name).Config.model_json_schema()
    if as_json:
        console.print_json(schema)
        return
    info = registry.describe(name)
    console.say(f"{name}: {info.summary}")
    if not info.available:
        console.say(f"unavailable: {info.reason}; mend it with: {info.remedy}")
    console.say("")
    console.table(("parameter", "type", "default", "range", "meaning"), list(parameters(schema)))


def parameters(schema: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str, str, str, str]]:
    """Name, type, default, range and meaning of every field of a JSON schema, sections flattened with dots."""
    definitions = schema.get("$defs", {})
    for name, field in schema.get("properties", {}).items():
        inner = _resolved(field, definitions)
        if "properties" in inner:
            yield from parameters({**inner, "$defs": definitions}, f"{prefix}{name}.")
            continue
        default = field.get("default", "required")
        meaning = " ".join(str(field.get("description", "")).split())
        yield prefix + name, _type(inner), _shown(default), _range(inner), meaning


def _resolved(field: Mapping[str, Any], definitions: Mapping[str, Any]) -> Mapping[str, Any]:
    reference = field.get("$ref")
    return definitions[reference.rpartition("/")[2]] if reference else field


def _type(field: Mapping[str, Any]) -> str:
    if "enum" in field:
        return " | ".join(str(value) for value in field["enum"])
    if "anyOf" in field:
        return " | ".join(_type(option) for option in field["anyOf"])
    return {"number": "float", "integer": "int", "boolean": "bool", "string": "text"}.get(
        field.get("type", ""), str(field.get("type", "any"))
    )


def _range(field: Mapping[str, Any]) -> str:
    """The range in the notation of intervals, e.g. ``(0, 1]``."""
    options = [option for option in field.get("anyOf", ()) if option.get("type") != "null"]
    if len(options) == 1:
        return _range(options[0])
    low, high = "(-inf", "inf)"
    if "minimum" in field:
        low = f"[{field['minimum']:g}"
    if "exclusiveMinimum" in field:
        low = f"({field['exclusiveMinimum']:g}"
    if "maximum" in field:
        high = f"{field['maximum']:g}]"
    if "exclusiveMaximum" in field:
        high = f"{field['exclusiveMaximum']:g})"
    return "" if (low, high) == ("(-inf", "inf)") else f"{low}, {high}"


def _shown(value: Any) -> str:
    if value is None:
        return "none"
    return str(value).lower() if isinstance(value, bool) else str(value)
