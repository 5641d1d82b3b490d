"""The paper's experiments, each with the paper's figures beside ours.

An experiment is a module of this package with ``run(request, tell) -> Experiment``.
"""

from __future__ import annotations

from importlib import import_module

from hsslam.errors import ConfigError
from hsslam_eval.reproduce.experiment import Experiment, Request, Tell

NAMES = ("table1", "table2", "fig7", "fig8", "fig9", "fig10", "maps", "benchmarks")
"""Experiments in the paper's order."""


def run_experiment(name: str, request: Request, tell: Tell) -> Experiment:
    """Run one experiment.

    Raises
    ------
    ConfigError
        There is none of that name.
    """
    if name not in NAMES:
        raise ConfigError(f"no experiment is named {name!r}; there are {', '.join(NAMES)} and all")
    found = import_module(f"hsslam_eval.reproduce.{name}").run(request, tell)
    assert isinstance(found, Experiment)
    return found
