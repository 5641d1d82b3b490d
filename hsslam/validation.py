"""Turns pydantic's errors into the line a user can act on."""

from __future__ import annotations

import difflib
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from hsslam.errors import ConfigError


def explain(error: ValidationError, model: type[BaseModel], prefix: str = "") -> ConfigError:
    """Say what is wrong: where, what was expected, what was found; unknown keys come with a suggestion.

    Parameters
    ----------
    error : ValidationError
        From validating ``model``.
    model : type of BaseModel
        Its fields are what suggestions are made from.
    prefix : str
        Dotted path of the model within the whole config.

    Returns
    -------
    ConfigError
        It knows which setting the first problem is about.
    """
    lines = []
    for item in error.errors():
        path = [str(part) for part in item["loc"]]
        where = ".".join([prefix, *path] if prefix else path) or model.__name__
        if item["type"] == "extra_forbidden":
            known = list(_model_at(model, item["loc"][:-1]).model_fields)
            lines.append(unknown_key(where, path[-1], known))
        else:
            message = item["msg"].removeprefix("Value error, ")
            found = item.get("input")
            shown = "" if isinstance(found, dict | BaseModel) else f", found {found!r}"
            lines.append(f"{where}: {message[:1].lower()}{message[1:]}{shown}")
    first = error.errors()[0]
    missing = first["type"] == "missing"
    key = (*((prefix,) if prefix else ()), *(first["loc"][:-1] if missing else first["loc"]))
    return ConfigError("; ".join(lines), key, first.get("input"))


def unknown_key(where: str, key: str, known: list[str]) -> str:
    """Say that ``where`` (whose last part is ``key``) is no setting, and which one was probably meant."""
    close = difflib.get_close_matches(key, known, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"known here: {', '.join(sorted(known))}"
    return f"{where}: unknown setting; {hint}"


def _model_at(model: type[BaseModel], path: tuple[int | str, ...]) -> type[BaseModel]:
    for part in path:
        annotation: Any = (
            model.model_fields[str(part)].annotation if str(part) in model.model_fields else None
        )
        candidates = [annotation, *get_args(annotation)]
        inner = [c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel)]
        if not inner:
            return model
        model = inner[0]
    return model
