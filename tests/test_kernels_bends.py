"""Bent surfaces: pillars, trunks, legs. Lines are their tangents, and matches see them where they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.config import load_config
from hsslam.datasets.simulator import FloorPlan, LaserModel, SimulatedDataset
from hsslam.datasets.simulator.solids import pillar
from hsslam.kernels.joints import joints_of
from hsslam.kernels.lines import BENT, fit_line, noise_of
from hsslam.kernels.surface import FIT_ROUGHNESS, FIT_SPAN, lines_of
from hsslam.matching.interface import SearchWindow
from hsslam.se2 import Points, Pose, between

LASER = LaserModel("fine", 1081, math.radians(-135.0), math.radians(0.25), 0.1, 30.0, 0.001)


def arc(radius: float, noise: float = 0.0, spacing: float = 0.01) -> Points:
    """The front of a pillar around (0, 0), as seen from far along x."""
    angles = np.arange(-1.2, 1.2, spacing / radius)
    away = radius + np.random.default_rng(0).normal(0.0, noise, len(angles))
    return np.column_stack((away * np.cos(angles), away * np.sin(angles)))


@pytest.mark.parametrize("radius", [0.15, 0.3, 1.0])
def test_lines_of_a_pillar_are_its_tangents(radius: float) -> None:
    points = arc(radius)
    lines = lines_of(points, FIT_SPAN, FIT_ROUGHNESS)[:-1]
    middles = 0.5 * (points[1:] + points[:-1])
    outward = middles / np.linalg.norm(middles, axis=1)[:, None]
    turned = np.abs(outward[:, 0] * lines[:, 1] - outward[:, 1] * lines[:, 0])
    assert turned[1:-1].max() < 0.01
    # At its ends there may be too little of the surface to tell of a bend.
    assert turned.max() < 0.15
    # Tangents of a circle are a radius from its middle.
    assert np.abs(lines[:, 2]) == pytest.approx(np.full(len(lines), radius), abs=0.0015)


@pytest.mark.parametrize("radius", [0.2, 0.5])
@pytest.mark.parametrize("turn", [0.0, 1.0, -2.5])
def test_tangents_agree_with_numpy(radius: float, turn: float) -> None:
    """Of a parabola through the returns around a segment, over the long axis of their scatter."""
    c, s = math.cos(turn), math.sin(turn)
    points = arc(radius, 0.0005) @ np.array([[c, s], [-s, c]])
    line, joined = np.empty(6), joints_of(points)
    bent = 0
    for i in range(0, len(points) - 1, 5):
        fit_line(points, i, joined, FIT_SPAN, FIT_ROUGHNESS, 0.0005, line)
        middle = 0.5 * (points[i] + points[i + 1])
        near = points[np.linalg.norm(points - middle, axis=1) <= 0.5 * FIT_SPAN]
        mean = near.mean(axis=0)
        _, _, axes = np.linalg.svd(near - mean)
        along = axes[0] * np.sign(axes[0] @ (near[-1] - near[0]))
        across = np.array([-along[1], along[0]])
        t, y = (near - mean) @ along, (near - mean) @ across
        parabola, found = np.polyfit(t, y, 2, full=True)[:2]
        straight = float(y @ y)
        left = float(found[0]) / (len(near) - 3)
        if straight - float(found[0]) <= BENT**2 * max(0.0005**2, left):
            continue
        bent += 1
        at = float((middle - mean) @ along)
        slope = float(np.polyval(np.polyder(parabola), at))
        tangent = (along + slope * across) / math.hypot(1.0, slope)
        assert line[:2] == pytest.approx(mean + at * along + np.polyval(parabola, at) * across, abs=1e-9)
        assert line[2:4] == pytest.approx([-tangent[1], tangent[0]], abs=1e-7)
        design = np.vander(t, 3)
        gradient = np.array([2.0 * at, 1.0, 0.0])
        assert line[4] == pytest.approx(gradient @ np.linalg.inv(design.T @ design) @ gradient, rel=1e-6)
        assert line[5] == pytest.approx(left, rel=1e-6)
    assert bent >= 10


@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_bends_are_no_noise(noise: float) -> None:
    pillars = np.vstack([arc(0.3, noise) + np.array([0.0, 2.0 * k]) for k in range(6)])
    assert noise_of(pillars, joints_of(pillars)) < 2.5 * noise


def pillars_along(way: float) -> SimulatedDataset:
    """A drive among round pillars, and nothing else to see."""
    rng = np.random.default_rng(5)
    places = rng.uniform((-12.0, -12.0), (way + 12.0, 12.0), (90, 2))
    solids = tuple(pillar(x, y, 0.4, 40) for x, y in places if abs(y) > 1.5)
    route = np.array([[0.0, 0.0], [way, 0.0], [way, 0.01]])
    return SimulatedDataset(FloorPlan("pillars", "", solids, route), scans=60, laser=LASER)


def errors_among_pillars(matcher: str, apart: int) -> NDArray[np.float64]:
    """Errors (N, 2) m of matches of scans that many apart."""
    log = pillars_along(10.0)
    scans = [scan.robot_points for scan in log.scans()]
    chosen = load_config(overrides=[f"matcher.name={matcher}"]).matcher.create()
    window, rng = SearchWindow(0.2, 0.2, math.radians(5.0)), np.random.default_rng(1)
    errors: list[Pose] = []
    for i in range(5, len(scans) - apart, 5):
        truth = between(log.poses[i], log.poses[i + apart])
        guess = truth + rng.uniform(-1.0, 1.0, 3) * np.array([0.05, 0.05, 0.02])
        found = chosen.match(chosen.prepare(scans[i]), scans[i + apart], guess, window, rng)
        errors.append(between(truth, found.pose))
    return np.array(errors)[:, :2]


@pytest.mark.parametrize("matcher", ["hide", "hsl"])
@pytest.mark.parametrize("apart", [1, 10])
def test_matches_among_pillars_are_not_drawn_ahead(matcher: str, apart: int) -> None:
    """Straight lines through what was seen of them drew the robot ahead by 5 to 15 mm."""
    errors = errors_among_pillars(matcher, apart)
    assert np.abs(errors.mean(axis=0)).max() < 0.002
    assert np.sqrt((errors**2).mean(axis=0)).max() < 0.003
