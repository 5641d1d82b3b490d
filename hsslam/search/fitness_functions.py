"""Fitness functions by name: hsslam's own, and those of plugins (entry points in the group ``hsslam.fitness``)."""

from __future__ import annotations

from typing import Annotated, Any, Protocol, TypeAlias

from pydantic import AfterValidator
from pydantic.annotated_handlers import GetJsonSchemaHandler

from hsslam.errors import HsslamError
from hsslam.kernels.raster import Raster
from hsslam.kernels.surface import Surface
from hsslam.registry import Registry
from hsslam.se2 import Points

GROUP = "hsslam.fitness"


class FitnessFunction(Protocol):
    """Rasterises a reference: what a scan's point is worth in every place.

    A search maximises the sum of these worths over the points of a scan.
    """

    def __call__(self, points: Points, surface: Surface, half_side: float, resolution: float, /) -> Raster:
        """Make the raster.

        Parameters
        ----------
        points : Points
            (N, 2) m, the reference.
        surface : Surface
            Through these points: ``surface.segments`` is float64 (S, 4), ``ax, ay, bx, by`` (m).
        half_side, resolution : float
            As configured: the reach of a point or segment, and the side of a cell (m).
        """


def _paper(points: Points, surface: Surface, half_side: float, resolution: float) -> Raster:
    """Squares centred on the points, as published."""
    return Raster.of_points(points, half_side, resolution)


def _surface(points: Points, surface: Surface, half_side: float, resolution: float) -> Raster:
    """Squares along the segments: a wall counts as a wall, not as the beams that happened to hit it."""
    return Raster.build(surface.segments, half_side, resolution)


def _sides(points: Points, surface: Surface, half_side: float, resolution: float) -> Raster:
    """The same, for points that see the side of the wall that the reference saw."""
    return Raster.of_sides(surface, half_side, resolution)


def _likelihood(points: Points, surface: Surface, half_side: float, resolution: float) -> Raster:
    """A Gaussian of the distance from the segments, of standard deviation ``half_side``, in steps of 1/255."""
    return Raster.smooth(surface.segments, half_side, resolution)


def _fault(part: Any) -> str:
    return "" if callable(part) else "is no function that makes a Raster"


_functions: Registry[FitnessFunction] = Registry(
    "fitness function",
    GROUP,
    fault=_fault,
    builtin={"paper": _paper, "surface": _surface, "sides": _sides, "likelihood": _likelihood},
)


def register_fitness(name: str, function: FitnessFunction) -> None:
    """Make a fitness function known to this process without packaging it.

    Raises
    ------
    ConfigError
        The name is taken, or this is no function.
    """
    _functions.register(name, function)


def load_fitness(name: str) -> FitnessFunction:
    """Return a fitness function.

    Raises
    ------
    ConfigError
        There is none of that name.
    UnavailableError
        Its module cannot be imported.
    """
    return _functions.load(name)


def fitness_names() -> list[str]:
    """Names of all fitness functions."""
    return _functions.names()


def _known(name: str) -> str:
    try:
        _functions.load(name)
    except HsslamError as error:
        raise ValueError(str(error)) from error
    return name


class _ListsNames:
    """Puts the names that there are into a JSON schema, at the time it is made."""

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {**handler(core_schema), "enum": fitness_names()}


FitnessName: TypeAlias = Annotated[str, AfterValidator(_known), _ListsNames()]
"""A setting that names a fitness function."""
