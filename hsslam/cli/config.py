"""``hsslam config``: what a run would be told to do."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from hsslam.cli import console
from hsslam.cli.options import AsJson, ConfigFile, MatcherName, Presets, Seed, Settings
from hsslam.cli.settings import resolve

app: typer.Typer = typer.Typer(
    help="Show and check settings, list presets.", rich_markup_mode=None, no_args_is_help=True
)


@app.command()
def show(
    preset: Presets = None,
    config: ConfigFile = None,
    matcher: MatcherName = None,
    loop_matcher: Annotated[
        str | None, typer.Option(metavar="NAME", help="The matcher that closes loops.")
    ] = None,
    seed: Seed = None,
    settings: Settings = None,
) -> None:
    """Print every setting that a run would use, as YAML.

    It is ready for --config.
    """
    from hsslam.config import dump

    resolved = resolve(
        file=config,
        matcher=matcher,
        loop_matcher=loop_matcher,
        seed=seed,
        presets=preset or (),
        settings=settings or (),
    )
    console.say(dump(resolved).rstrip())


@app.command()
def validate(file: Annotated[Path, typer.Argument(metavar="FILE", help="YAML settings.")]) -> None:
    """Check a file of settings.

    Says what is wrong and where, and exits with 2 if anything is.
    """
    resolve(file=file)
    console.say(f"{file}: valid")


@app.command()
def presets(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="Print this one, reasons and all.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """List the presets for sensors and places, or print one.

    One is printed with what it overrides and why.
    """
    from hsslam import presets as files

    if name is not None:
        preset = files.load(name)
        if as_json:
            console.print_json({"name": name, "kind": preset.kind, "settings": files.settings(name)})
            return
        console.say(preset.text.rstrip())
        return
    found = [files.load(each) for each in files.names()]
    if as_json:
        console.print_json([{"name": p.name, "kind": p.kind, "what": p.summary} for p in found])
        return
    console.table(("name", "of a", "what"), [(p.name, p.kind, p.summary) for p in found])


@app.command()
def schema() -> None:
    """Print the JSON schema of the settings, for editors.

    Every matcher's parameters are in it.
    """
    console.print_json(config_schema())


def config_schema() -> dict[str, Any]:
    """The JSON schema of `hsslam.config.Config`, with each installed matcher's parameters spelled out."""
    from hsslam import presets
    from hsslam.config import Config
    from hsslam.errors import MatcherUnavailableError
    from hsslam.matching import registry

    whole = Config.model_json_schema()
    known = registry.names()
    variants: list[dict[str, Any]] = [{"type": "string", "enum": known}]
    for name in known:
        try:
            model = registry.load(name).Config
        except MatcherUnavailableError:
            continue
        variant = model.model_json_schema(ref_template="#/$defs/{model}")
        whole["$defs"].update(variant.pop("$defs", {}))
        variant["properties"] = {"name": {"const": name}, **variant.get("properties", {})}
        variant["required"] = ["name", *variant.get("required", [])]
        variants.append(variant)
    known_presets = {"enum": presets.names()}
    whole["properties"]["preset"] = {
        "title": "Preset",
        "description": "defaults for a sensor or a place, under the other settings",
        "anyOf": [known_presets, {"type": "array", "items": known_presets}],
    }
    whole["$defs"]["MatcherSection"] = {"title": "Matcher", "anyOf": variants}
    return whole
