"""Checks of what a matcher is: its config, its listing, its copies, the types of its results."""

from __future__ import annotations

import json
import pickle
from typing import Any

import numpy as np
from pydantic import ValidationError

from hsslam.matching.conformance.probe import (
    match_room,
    require,
    require_equal,
)
from hsslam.matching.interface import Matcher, MatcherConfig
from hsslam.matching.results import MatchResult


def check_config(matcher: Matcher[Any]) -> None:
    """Require that the config is a strict, described, serialisable `MatcherConfig`."""
    model = type(matcher).Config
    require(
        isinstance(model, type) and issubclass(model, MatcherConfig), "Config is no subclass of MatcherConfig"
    )
    require(
        isinstance(matcher.config, model), f"its config is no {model.__name__}; does __init__ call super()?"
    )
    bare = [name for name, field in model.model_fields.items() if not field.description]
    require(not bare, f"config fields without a description: {', '.join(bare)}")
    try:
        model.model_validate({"no_such_parameter": 1})
    except ValidationError:
        pass
    else:
        raise AssertionError("its config takes unknown keys silently")
    model.model_json_schema()
    again = model.model_validate(json.loads(json.dumps(matcher.config.model_dump(mode="json"))))
    require(again == matcher.config, "its config does not survive a round trip through JSON")


def check_summary(matcher: Matcher[Any]) -> None:
    """Require one line for listings."""
    summary = type(matcher).summary
    require(
        bool(summary.strip()) and "\n" not in summary, f"summary must be one line of text, not {summary!r}"
    )


def check_pickle(matcher: Matcher[Any]) -> None:
    """Require that a copy sent to another process is the same matcher."""
    copy = pickle.loads(pickle.dumps(matcher))
    require(copy.config == matcher.config, "the config of a pickled copy differs")
    require_equal(match_room(copy), match_room(matcher), "a pickled copy gives another result")


def check_result_types(matcher: Matcher[Any]) -> None:
    """Shapes, types and units of a result."""
    result = match_room(matcher)
    require(isinstance(result, MatchResult), f"match returned {type(result).__name__}, not MatchResult")
    for name, shape in (("pose", (3,)), ("covariance", (3, 3))):
        value = getattr(result, name)
        require(isinstance(value, np.ndarray), f"{name} is {type(value).__name__}, not an array")
        require(value.shape == shape, f"{name} has shape {value.shape}, not {shape}")
        require(value.dtype == np.float64, f"{name} is {value.dtype}, not float64")
        require(bool(np.isfinite(value).all()), f"{name} is not finite")
    require(isinstance(result.converged, bool), f"converged is {type(result.converged).__name__}, not bool")
    require(
        isinstance(result.evaluations, int) and result.evaluations >= 0,
        f"evaluations must be a whole number, not {result.evaluations!r}",
    )
    try:
        json.dumps(dict(result.diagnostics))
    except (TypeError, ValueError) as error:
        raise AssertionError(f"diagnostics hold more than JSON types: {error}") from error
