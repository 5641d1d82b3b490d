"""What the shell offers where a name is expected; nothing heavy is imported to find out."""

from __future__ import annotations

from collections.abc import Callable


def matchers(incomplete: str) -> list[str]:
    """Names of installed matchers that begin like this."""
    from importlib.metadata import entry_points

    return _begin_like(incomplete, {entry.name for entry in entry_points(group="hsslam.matchers")})


def presets(incomplete: str) -> list[str]:
    """Names of presets that begin like this."""
    from hsslam import presets

    return _begin_like(incomplete, set(presets.names()))


def viewers(incomplete: str) -> list[str]:
    """Names of viewers that begin like this."""
    from hsslam.live.viewers import VIEWERS

    return _begin_like(incomplete, set(VIEWERS))


def datasets(incomplete: str) -> list[str]:
    """Names of datasets that begin like this; the shell itself offers files where there is none."""
    from hsslam.datasets import catalogue

    return _begin_like(incomplete, set(catalogue.names()))


def several_matchers(incomplete: str) -> list[str]:
    """Matchers for the last name of ``a,b,c``, with what stands before it."""
    return _last_of(incomplete, matchers)


def several_datasets(incomplete: str) -> list[str]:
    """Datasets for the last name of ``a,b,c``, with what stands before it."""
    return _last_of(incomplete, datasets)


def _last_of(incomplete: str, names: Callable[[str], list[str]]) -> list[str]:
    before, comma, last = incomplete.rpartition(",")
    return [f"{before}{comma}{name}" for name in names(last)]


def _begin_like(incomplete: str, names: set[str]) -> list[str]:
    return sorted(name for name in names if name.startswith(incomplete))
