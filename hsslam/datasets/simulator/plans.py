"""The three built-in worlds."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from hsslam.datasets.simulator.floorplan import FloorPlan
from hsslam.datasets.simulator.solids import box, pillar, room, wall
from hsslam.errors import DataError
from hsslam.se2 import Points


def _office() -> FloorPlan:
    # A ring of rooms, a corridor loop of unequal widths, an inner block with a lounge open to the corridor.
    walls = [
        *room(0.0, 0.0, 30.0, 20.0),
        *wall("x", 5.0, 0.0, 30.0, [(3.0, 0.9, "closed"), (7.5, 0.9, "open"), (11.5, 0.9, "closed"),
                                    (15.5, 1.1, "open"), (20.0, 0.9, "open"), (27.5, 0.9, "open")]),
        *wall("x", 15.0, 0.0, 30.0, [(2.5, 0.9, "open"), (10.5, 1.1, "open"), (14.0, 0.9, "closed"),
                                     (17.5, 0.9, "open"), (22.0, 0.9, "closed")]),
        *wall("y", 5.0, 5.0, 15.0, [(7.2, 0.9, "open"), (11.8, 0.9, "closed")]),
        *wall("y", 25.0, 5.0, 15.0, [(7.6, 0.9, "closed"), (12.0, 1.0, "open")]),
        *wall("y", 5.2, 0.0, 5.0), *wall("y", 9.5, 0.0, 5.0), *wall("y", 13.2, 0.0, 5.0),
        *wall("y", 18.0, 0.0, 5.0), *wall("y", 23.5, 0.0, 5.0),
        *wall("y", 4.5, 15.0, 20.0), *wall("y", 8.0, 15.0, 20.0), *wall("y", 13.0, 15.0, 20.0),
        *wall("y", 19.2, 15.0, 20.0), *wall("y", 25.0, 15.0, 20.0),
        *wall("x", 9.6, 0.0, 5.0), *wall("x", 10.4, 25.0, 30.0),
        *wall("x", 7.0, 7.0, 12.0, [(9.0, 0.9, "closed")]),
        *wall("x", 7.0, 17.0, 23.2, [(21.5, 0.9, "open")]),
        *wall("x", 12.6, 7.0, 23.2, [(8.6, 0.9, "open"), (14.2, 0.9, "closed"), (19.0, 0.9, "closed")]),
        *wall("y", 7.0, 7.0, 12.6, [(10.6, 0.9, "open")]),
        *wall("y", 23.2, 7.0, 12.6, [(9.0, 0.9, "closed")]),
        *wall("y", 12.0, 7.0, 12.6), *wall("y", 17.0, 7.0, 12.6, [(11.6, 0.9, "open")]),
    ]  # fmt: skip
    furniture = [
        # corridor: cabinets, a copier, plants, a bench, pillars
        box(9.9, 5.3, 1.2, 0.4), box(18.2, 5.25, 0.8, 0.35), box(17.9, 6.72, 1.0, 0.35),
        pillar(23.7, 5.5, 0.22), box(24.65, 9.8, 0.5, 1.4), box(23.5, 11.4, 0.4, 0.8),
        box(20.1, 14.7, 1.0, 0.4), pillar(24.5, 14.5, 0.2), box(15.8, 12.95, 1.6, 0.45),
        box(12.4, 14.75, 0.5, 0.3), pillar(5.45, 14.5, 0.25), box(5.35, 9.4, 0.5, 0.9),
        box(6.7, 8.4, 0.4, 1.2), box(6.72, 12.2, 0.35, 0.5), box(13.0, 5.2, 0.5, 0.2),
        # lounge
        pillar(14.4, 9.2, 0.55, 10), box(13.2, 9.6, 0.5, 0.5, 25), box(15.5, 9.4, 0.5, 0.5, -20),
        box(14.6, 10.5, 0.5, 0.5, 8), box(14.0, 12.2, 2.6, 0.5), box(12.5, 8.0, 0.6, 1.2),
        pillar(16.5, 7.5, 0.22), pillar(12.25, 7.0, 0.25, 12), pillar(16.75, 7.0, 0.25, 12),
        # inner rooms
        box(9.6, 8.0, 1.6, 0.8), box(9.6, 8.8, 0.5, 0.5, 15), box(11.6, 10.6, 0.4, 2.0),
        box(8.0, 9.0, 0.6, 0.6, 30), box(19.4, 10.2, 2.4, 1.2, 6), box(18.5, 11.5, 0.5, 0.5, 40),
        box(20.4, 11.3, 0.5, 0.5, -10), box(22.7, 10.9, 0.5, 2.2), box(18.0, 8.0, 1.4, 0.7),
        pillar(22.6, 7.6, 0.25),
        # south rooms
        box(1.0, 1.2, 0.8, 1.6), box(2.9, 0.5, 1.8, 0.5), box(6.6, 1.0, 1.6, 0.8),
        box(6.7, 1.8, 0.5, 0.5, 20), box(9.1, 2.4, 0.4, 1.8), box(11.2, 1.4, 1.4, 0.7, 10),
        box(13.8, 1.6, 0.8, 1.6), box(14.4, 2.5, 0.5, 0.5, 35), box(17.2, 1.2, 0.8, 1.8),
        box(16.7, 2.5, 0.5, 0.5, 12), box(15.5, 0.45, 1.2, 0.5), box(17.6, 3.9, 0.4, 1.4),
        box(13.6, 4.2, 0.4, 0.8), box(20.5, 1.6, 2.4, 1.2), box(19.0, 2.6, 0.5, 0.5, 18),
        box(21.8, 3.2, 0.5, 0.5, -25), box(26.5, 1.0, 1.6, 0.8), box(28.9, 2.4, 0.6, 1.6),
        box(25.0, 3.2, 0.5, 0.5, 5),
        # north rooms
        box(1.2, 18.4, 1.6, 0.8), box(3.6, 17.0, 0.5, 0.5, 30), box(6.2, 18.6, 1.6, 0.8, 4),
        box(7.6, 16.4, 0.4, 1.6), box(8.6, 16.9, 0.5, 2.0), box(12.3, 18.4, 0.8, 1.8),
        box(11.9, 17.1, 0.5, 0.5, 22), box(10.4, 19.4, 1.6, 0.6), box(12.7, 15.9, 0.4, 1.0),
        box(15.0, 18.8, 1.6, 0.8), box(16.8, 17.6, 1.6, 0.8, 90), box(21.6, 17.8, 2.0, 1.2),
        box(27.5, 17.4, 1.6, 0.8, 12),
        # west and east rooms
        box(1.0, 7.2, 0.8, 1.6), box(2.2, 7.4, 0.5, 0.5, 14), box(3.4, 9.2, 1.4, 0.4),
        box(1.4, 13.0, 1.6, 0.8), box(28.6, 12.6, 0.8, 1.8), box(27.2, 13.6, 0.5, 0.5, 33),
        box(26.4, 11.0, 1.2, 0.5), box(28.4, 7.0, 1.6, 0.8, 80),
    ]  # fmt: skip
    route = np.array(
        [
            (6.0, 6.1), (15.5, 6.0), (15.5, 2.9), (15.5, 6.0), (21.5, 6.1), (24.0, 6.2), (23.9, 9.2),
            (23.85, 10.4), (24.3, 11.6), (24.1, 13.4), (22.5, 13.9), (14.5, 13.9),
            (10.6, 13.9), (10.5, 17.4),
            (10.4, 13.8), (7.0, 13.8), (6.0, 12.8),
        ]
    )  # fmt: skip
    return FloorPlan(
        "office", "rooms with furniture along a loop of corridors, 30 x 20 m", _all(walls, furniture), route
    )


def _corridor() -> FloorPlan:
    # Doors and niches bunch at the two ends; for 16 m in between both walls are bare.
    walls = [
        *wall("y", 0.0, 0.0, 2.4), *wall("y", 42.0, 0.0, 2.4, [(1.2, 1.1, "closed")]),
        *wall("x", 0.0, 0.0, 42.0, [(3.0, 0.9, "closed"), (6.4, 0.9, "open"), (11.0, 0.9, "closed"),
                                    (31.5, 0.9, "closed"), (36.0, 0.9, "open"), (40.0, 0.9, "closed")]),
        *wall("x", 2.4, 0.0, 42.0, [(4.6, 0.9, "closed"), (9.2, 0.9, "closed"), (28.8, 0.9, "closed"),
                                    (33.6, 1.8, "open"), (38.8, 0.9, "closed")]),
        # what the open doors show
        *wall("x", -3.0, 4.5, 8.5), *wall("y", 4.5, -3.0, 0.0), *wall("y", 8.5, -3.0, 0.0),
        *wall("x", -3.2, 34.0, 38.0), *wall("y", 34.0, -3.2, 0.0), *wall("y", 38.0, -3.2, 0.0),
        *wall("x", 3.6, 32.7, 34.5), *wall("y", 32.7, 2.4, 3.6), *wall("y", 34.5, 2.4, 3.6),
    ]  # fmt: skip
    furniture = [
        box(7.8, 2.15, 0.9, 0.35), pillar(0.5, 0.5, 0.22), box(40.9, 2.1, 0.8, 0.4),
        box(34.9, 0.22, 0.6, 0.3), box(6.0, -2.4, 1.6, 0.8), box(36.6, -2.5, 1.4, 0.8, 15),
        box(19.4, 0.17, 0.35, 0.2),
    ]  # fmt: skip
    route = np.array([(1.6, 1.1), (12.0, 1.15), (30.0, 1.2), (40.2, 1.1), (30.0, 1.25), (12.0, 1.25)])
    return FloorPlan(
        "corridor", "plain corridor of 42 m, bare for long stretches", _all(walls, furniture), route
    )


def _hall() -> FloorPlan:
    walls = [
        *wall("x", 0.0, 0.0, 26.0, [(8.0, 2.4, "closed"), (19.0, 1.0, "closed")]),
        *wall("x", 18.0, 0.0, 26.0, [(4.0, 1.0, "closed"), (15.0, 3.0, "closed")]),
        *wall("y", 0.0, 0.0, 18.0, [(9.5, 2.0, "closed")]),
        *wall("y", 26.0, 0.0, 18.0, [(5.0, 1.0, "closed")]),
    ]
    pillars = [pillar(x, y, 0.3, 12) for x in (6.5, 14.2, 19.5) for y in (6.0, 12.0)]
    clutter = [
        box(3.2, 1.1, 1.8, 0.9, 12), box(6.4, 0.9, 1.0, 0.8, -35), box(11.6, 1.0, 2.2, 1.0, 4),
        box(15.6, 1.2, 1.1, 1.1, 40), box(21.8, 1.0, 1.6, 1.2, -8), box(24.6, 1.6, 0.9, 0.9, 22),
        box(24.9, 8.3, 0.9, 2.6, 5), box(24.3, 12.9, 1.2, 0.9, -28), box(24.6, 16.4, 1.4, 1.4, 45),
        box(20.4, 16.8, 1.9, 0.9, -6), box(17.2, 16.7, 0.8, 0.8, 30), box(11.6, 16.8, 2.0, 0.8, 9),
        box(8.0, 16.4, 1.2, 1.2, -20), box(2.0, 16.2, 1.7, 1.1, 33), box(1.1, 13.0, 0.9, 1.6, -4),
        box(1.2, 6.2, 1.0, 1.9, 16), box(6.1, 8.9, 1.5, 0.7, 28), box(8.9, 7.2, 0.9, 0.9, -38),
        box(9.1, 10.9, 1.2, 0.8, 62), box(5.0, 7.2, 0.7, 0.7, 10), box(11.3, 5.9, 1.1, 0.6, -15),
        box(15.6, 5.4, 1.3, 1.0, 25), box(16.6, 7.6, 0.7, 1.2, -50), box(18.6, 4.8, 0.8, 0.8, 15),
        box(20.9, 7.0, 1.6, 0.7, 37), box(16.0, 12.6, 1.4, 0.8, -22), box(20.6, 10.6, 0.9, 1.3, 12),
        box(10.9, 13.4, 0.8, 0.8, 48), box(4.9, 12.9, 1.4, 0.6, -30), box(17.8, 11.0, 0.6, 0.6, 5),
        pillar(9.9, 5.2, 0.28, 10), pillar(22.3, 12.9, 0.35, 10), pillar(3.6, 10.6, 0.3, 10),
    ]  # fmt: skip
    route = np.array(
        [(3.0, 3.2), (21.5, 3.2), (22.8, 5.0), (22.8, 9.0), (23.3, 12.0), (22.8, 14.0), (21.0, 14.9),
         (13.6, 15.0), (12.7, 9.3), (12.7, 3.3),
         (7.6, 3.3), (3.4, 6.5), (3.0, 9.0), (2.7, 13.0), (4.2, 14.6), (12.6, 15.0), (12.7, 9.3),
         (12.6, 3.3)]
    )  # fmt: skip
    return FloorPlan(
        "hall",
        "cluttered hall with pillars and boxes at odd angles, 26 x 18 m",
        _all(walls, pillars, clutter),
        route,
    )


def _all(*groups: list[Points]) -> tuple[Points, ...]:
    return tuple(solid for group in groups for solid in group)


_PLANS: dict[str, Callable[[], FloorPlan]] = {"office": _office, "corridor": _corridor, "hall": _hall}

PLAN_NAMES = tuple(_PLANS)
"""Names of the built-in plans."""


@cache
def floor_plan(name: str) -> FloorPlan:
    """Build one of the plans by its name.

    Raises
    ------
    DataError
        No plan has this name.
    """
    if name not in _PLANS:
        raise DataError(f"no simulated world is named {name!r} (there are: {', '.join(PLAN_NAMES)})")
    return _PLANS[name]()
