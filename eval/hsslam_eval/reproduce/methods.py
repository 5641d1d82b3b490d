"""The methods of the experiments: as the papers have them, and as we would have them.

All three search on the very same fitness: squares of 10.5 cm around the points of the reference, the GLASM
authors' figure, which the paper takes over with their fitness (section 4.5). See docs/paper.md for the readings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hsslam.matching import Matcher, create, describe, names

FITNESS: dict[str, Any] = {"fitness": "paper", "half_side": 0.0525, "resolution": 0.025, "refine": False}
"""What all published methods maximise, and then leave as it is."""

_HARMONY: dict[str, Any] = {
    **FITNESS,
    "memory_size": 30,
    "memory_considering_rate": 0.88,
    "pitch_adjusting_rate_min": 0.55,
    "pitch_adjusting_rate_max": 0.98,
    "bandwidth_max": 8.0,
    "bandwidth_min": 0.2,
    "wide_windows": False,
    # The published budgets are used up; section 4.4's other stopping criterion has no figure.
    "patience": 0,
}

_PAPER: dict[str, dict[str, Any]] = {
    "hsl": {**_HARMONY, "improvisations": 250},
    "hide": {
        **_HARMONY,
        "evaluations": 220,
        "harmony_run": 14,
        "attraction": 0.7,
        "weight": 0.44,
        "crossover_rate": 0.9,
    },
    "glasm": {
        **FITNESS,
        "population_size": 120,
        "generations": 12,
        "bits": 9,
        "crossover_rate": 1.0,
        "mutation_rate": 0.12,
    },
}

ORACLE = "exhaustive"
"""The matcher that proves its optimum."""

MEMORY_SIZE = 30
"""HMS as published."""

GLASM_EVALUATIONS = 120 * 12
"""What GLASM spends as published."""


@dataclass(frozen=True)
class Method:
    """A matcher with its parameters, under the name that tables give it."""

    label: str
    name: str
    parameters: dict[str, Any]

    @cached_property
    def matcher(self) -> Matcher[Any]:
        """The matcher itself, made once."""
        return create(self.name, self.parameters)

    def described(self) -> dict[str, Any]:
        """Every parameter, defaults included, for the record."""
        return {"matcher": self.name, **self.matcher.config.model_dump(mode="json")}


def published(name: str, label: str | None = None, **changed: Any) -> Method:
    """``hsl``, ``hide`` or ``glasm`` as published, but for what is ``changed``."""
    return Method(label or name.upper(), name, {**_PAPER[name], **changed})


def ours(name: str) -> Method:
    """A matcher at hsslam's defaults."""
    return Method(f"{name}, hsslam's defaults", name, {})


def oracle() -> Method | None:
    """The best that the published fitness has to offer, proven; None where no matcher that proves it runs."""
    if ORACLE not in names() or not describe(ORACLE).available:
        return None
    return Method("best pose of this fitness, proven", ORACLE, {**FITNESS, "tolerance": 0.0})
