"""Lasers whose noise is larger than a piece of wall between two returns is long."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.config import load_config
from hsslam.datasets.simulator import (
    DriveModel,
    FloorPlan,
    LaserModel,
    OdometryModel,
    SimulatedDataset,
)
from hsslam.datasets.simulator.solids import room
from hsslam.kernels.joints import joints_of
from hsslam.kernels.lines import ARM, ENOUGH, LONG, MEDIAN, PLENTY, UNBENT, fit_line, noise_of
from hsslam.kernels.surface import FIT_ROUGHNESS, FIT_SPAN, Surface
from hsslam.se2 import Points, between_many
from hsslam.slam.pipeline import Slam


def wall(noise: float, spacing: float = 0.05, seed: int = 0) -> Points:
    x = np.arange(0.0, 5.0, spacing)
    return np.column_stack((x, np.random.default_rng(seed).normal(0.0, noise, len(x))))


def with_corner(noise: float) -> Points:
    """A wall along x from 0 to 5, then one along y."""
    along, up = wall(noise), wall(noise, seed=1)
    return np.vstack((along, np.column_stack((5.0 + up[:, 1], up[:, 0]))))


def told(points: Points) -> float:
    """The noise that a scan tells of by itself."""
    return float(noise_of(points, joints_of(points)))


def tilts(points: Points) -> NDArray[np.float64]:
    """Angles (rad) between the lines and the wall, of those pieces that have a line."""
    normals = Surface.build(points).pieces[:, 5:7]
    normals = normals[np.abs(normals).sum(axis=1) > 0.0]
    return np.arctan2(np.abs(normals[:, 0]), np.abs(normals[:, 1]))


@pytest.mark.parametrize("noise", [0.005, 0.02, 0.05, 0.08])
@pytest.mark.parametrize("spacing", [0.02, 0.05, 0.12])
def test_noise_is_told_from_the_returns(noise: float, spacing: float) -> None:
    assert told(wall(noise, spacing)) == pytest.approx(noise, rel=0.5)


def from_chord(a: Points, b: Points, at: Points) -> tuple[float, float]:
    """Where a place is along a chord, as a share of it, and how far across."""
    chord, away = b - a, at - a
    length = float(np.linalg.norm(chord))
    return float(away @ chord) / length**2, float(away[0] * chord[1] - away[1] * chord[0]) / length


def noise_twin(points: Points, arm: float) -> float:
    """By NumPy: distances from chords to the first returns ``arm`` away on either side of an unbroken surface."""
    found, unbent = [], []
    for i in range(1, len(points) - 1, 1 + len(points) // PLENTY):
        away = np.linalg.norm(points - points[i], axis=1) > arm
        before, after = np.flatnonzero(away[:i]), np.flatnonzero(away[i:])
        first, last = before[-1] if len(before) else 0, i + after[0] if len(after) else len(points) - 1
        a, b = points[first], points[last]
        t, off = from_chord(a, b, points[i])
        if np.linalg.norm(b - a) < arm or not 0.1 < t < 0.9:
            continue
        found.append(abs(off) / np.linalg.norm([1.0, 1.0 - t, t]))
        unbent.append(found[-1])
        other = (i + last) // 2 if last - i >= i - first else (first + i) // 2
        s, beside = from_chord(a, b, points[other])
        if other not in (i, first) and 0.1 < s < 0.9:
            share = t * (1.0 - t) / (s * (1.0 - s))
            spread = np.linalg.norm([1.0, share, 1.0 - t - share * (1.0 - s), t - share * s])
            unbent[-1] = abs(off - share * beside) / spread
    if len(found) < ENOUGH:
        return 0.0
    return float(min(np.median(found), UNBENT * np.median(unbent))) / MEDIAN


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.02, 0.05])
@pytest.mark.parametrize("spacing", [0.02, 0.05, 0.12])
def test_noise_agrees_with_numpy(noise: float, spacing: float) -> None:
    points = wall(noise, spacing)
    expected = noise_twin(points, ARM)
    if expected > LONG * ARM:
        expected = min(expected, noise_twin(points, expected / LONG))
    assert told(points) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5, -2.0])
def test_lines_agree_with_numpy(turn: float) -> None:
    """Of a quiet wall: the short axis of the returns within half a span of each segment's middle."""
    c, s = math.cos(turn), math.sin(turn)
    points = wall(0.002, 0.02) @ np.array([[c, s], [-s, c]])
    line, joined = np.empty(6), joints_of(points)
    for i in range(0, len(points) - 1, 7):
        fit_line(points, i, joined, FIT_SPAN, FIT_ROUGHNESS, 0.002, line)
        middle = 0.5 * (points[i] + points[i + 1])
        near = points[np.linalg.norm(points - middle, axis=1) <= 0.5 * FIT_SPAN]
        _, scatter, axes = np.linalg.svd(near - near.mean(axis=0))
        normal = np.array([-axes[0, 1], axes[0, 0]]) * np.sign(axes[0] @ (points[-1] - points[0]))
        assert line[:2] == pytest.approx(near.mean(axis=0), abs=1e-9)
        assert line[2:4] == pytest.approx(normal, abs=1e-6)
        assert line[4] == pytest.approx(1.0 / scatter[0] ** 2)
        assert line[5] == pytest.approx(scatter[1] ** 2 / (len(near) - 2), abs=1e-12)


def test_corners_are_no_noise() -> None:
    assert told(with_corner(0.005)) < 0.01


def test_too_few_returns_tell_of_no_noise() -> None:
    assert told(wall(0.05)[:4]) == 0.0


@pytest.mark.parametrize("noise", [0.05, 0.08])
def test_lines_through_noisy_returns_follow_the_wall(noise: float) -> None:
    assert np.quantile(tilts(wall(noise)), 0.9) < 0.25


def test_lines_of_noisy_returns_that_are_too_few_point_nowhere() -> None:
    pair = np.array([[0.0, 20.0], [0.2, 20.05]])
    surface = Surface.build(np.vstack((wall(0.08), pair)))
    assert (surface.pieces[-1, 5:7] == 0.0).all()


def test_a_quiet_laser_sees_corners_as_sharp_as_ever() -> None:
    normals = Surface.build(with_corner(0.003)).pieces[:, 5:7]
    oblique = np.minimum(np.abs(normals[:, 0]), np.abs(normals[:, 1])) > 0.3
    assert oblique.sum() <= 3


def test_along_bare_walls_a_noisy_laser_does_not_lead_the_robot_astray() -> None:
    plan = FloorPlan(
        "bare", "bare", tuple(room(0.0, 0.0, 60.0, 40.0)), np.array([[8.0, 6.0], [50.0, 6.0], [50.0, 30.0]])
    )
    cheap = LaserModel(
        "cheap", 360, -math.pi, math.radians(1.0), 0.15, 10.0, 0.05, 0.0, 0.005, 0.03, math.inf
    )
    farthest = []
    for seed in range(8):
        log = SimulatedDataset(
            plan,
            seed=seed,
            scans=240,
            laser=cheap,
            odometry=OdometryModel(),
            motion=DriveModel(rate=5.0, speed=0.6, turn_rate=math.radians(50.0)),
        )
        online = Slam(load_config(overrides=["graph.rescan_keyframes=0"])).solve(log.scans()).online.poses
        error = between_many(
            between_many(log.poses[:1].repeat(240, axis=0), log.poses),
            between_many(online[:1].repeat(240, axis=0), online),
        )
        farthest.append(np.hypot(error[:, 0], error[:, 1]).max())
    # Of 28 runs none ended more than 0.81 m off, mean 0.35; where the window counted as knowledge the mean was 0.53,
    # and odometry alone is 2 m off.
    assert np.max(farthest) < 1.0
    assert np.mean(farthest) < 0.45
