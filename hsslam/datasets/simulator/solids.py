"""The bricks of a floor plan: closed outlines of walls, doors, boxes and pillars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, TypeAlias

import numpy as np

from hsslam.se2 import Points

WALL = 0.15
"""Thickness of a wall (m)."""

Door: TypeAlias = tuple[float, float, Literal["open", "closed"]]
"""Position of its middle along the wall (m, in plan coordinates), width (m), and whether one can pass."""


def box(x: float, y: float, width: float, height: float, angle_deg: float = 0.0) -> Points:
    """Rectangle around ``(x, y)``, (4, 2) m; ``width`` is along x before it is turned by ``angle_deg``."""
    c, s = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    half = 0.5 * np.array([[-width, -height], [width, -height], [width, height], [-width, height]])
    outline: Points = np.array([x, y]) + half @ np.array([[c, s], [-s, c]])
    return outline


def rectangle(x1: float, y1: float, x2: float, y2: float) -> Points:
    """Upright rectangle between two corners, (4, 2) m."""
    return np.array([[x1, y1], [x2, y1], [x2, y2], [x1, y2]], dtype=np.float64)


def pillar(x: float, y: float, radius: float, sides: int = 8) -> Points:
    """Regular polygon around ``(x, y)``, (sides, 2) m: a round pillar, a plant, a bin."""
    angles = 2.0 * math.pi * np.arange(sides) / sides
    return np.column_stack((x + radius * np.cos(angles), y + radius * np.sin(angles)))


def wall(
    axis: Literal["x", "y"], level: float, start: float, end: float, doors: Sequence[Door] = ()
) -> list[Points]:
    """Straight wall with doors.

    Parameters
    ----------
    axis : {"x", "y"}
        Along which axis it runs.
    level : float
        The other coordinate of its middle line (m).
    start, end : float
        Where it begins and ends along the axis (m); it reaches half a wall's thickness further, so that
        walls that meet at a corner close it.
    doors : sequence of Door
        An open door is a gap; a closed one a thin leaf in the middle of the wall, which leaves a niche.
    """
    pieces: list[tuple[float, float, float]] = []
    at = start - 0.5 * WALL
    for middle, width, state in sorted(doors):
        pieces.append((at, middle - 0.5 * width, WALL))
        if state == "closed":
            pieces.append((middle - 0.5 * width, middle + 0.5 * width, 0.04))
        at = middle + 0.5 * width
    pieces.append((at, end + 0.5 * WALL, WALL))
    upright = [rectangle(a, level - 0.5 * thick, b, level + 0.5 * thick) for a, b, thick in pieces]
    return upright if axis == "x" else [outline[:, ::-1].copy() for outline in upright]


def room(x1: float, y1: float, x2: float, y2: float) -> list[Points]:
    """Four walls without doors around a rectangle."""
    return [*wall("x", y1, x1, x2), *wall("x", y2, x1, x2), *wall("y", x1, y1, y2), *wall("y", x2, y1, y2)]
