"""Fixtures that several test files share."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import Points, Poses
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.scan_table import ScanTable
from hsslam.slam.sessions import Sessions

ROOM = np.array(
    [
        # Outer walls with an alcove, so that no quarter turn maps the room onto itself.
        [-3.0, -2.0, 4.0, -2.0],
        [4.0, -2.0, 4.0, 3.0],
        [4.0, 3.0, 1.0, 3.0],
        [1.0, 3.0, 1.0, 2.2],
        [1.0, 2.2, -3.0, 2.2],
        [-3.0, 2.2, -3.0, -2.0],
        # A cupboard.
        [2.0, -2.0, 2.0, -1.2],
        [2.0, -1.2, 2.8, -1.2],
    ]
)
"""Walls ``ax, ay, bx, by`` (m) of a room about 7 m by 5 m around the origin."""


def ray_ranges(
    segments: NDArray[np.float64], pose: NDArray[np.float64], angles: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Exact ranges (m) from ``pose`` to the nearest of ``segments``; inf where none is hit."""
    directions = np.column_stack((np.cos(angles + pose[2]), np.sin(angles + pose[2])))
    start, along = segments[:, :2] - pose[:2], segments[:, 2:] - segments[:, :2]
    cross = directions[:, :1] * along[:, 1] - directions[:, 1:] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * directions[:, 1:] - start[:, 1] * directions[:, :1]) / cross
    hit = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    ranges: NDArray[np.float64] = np.where(hit, distance, np.inf).min(axis=1)
    return ranges


def room_scan_at(pose: NDArray[np.float64], beams: int = 180, noise: float = 0.0, seed: int = 0) -> LaserScan:
    """A scan of `ROOM`: ``beams`` beams from -90 degrees on, one degree apart for 180 of them."""
    geometry = ScanGeometry(-np.pi / 2, np.pi / beams, range_max=30.0)
    ranges = ray_ranges(ROOM, pose, geometry.angles(beams))
    ranges = ranges + np.random.default_rng(seed).normal(0.0, noise, beams) if noise else ranges
    return LaserScan(stamp=0.0, ranges=ranges, geometry=geometry, odometry=pose)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real logs: HSSLAM_SHARED, else ``../shared/data``. Skips where there is none."""
    named = os.environ.get("HSSLAM_SHARED")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"REAL DATA NOT TESTED: no folder {folder} (set HSSLAM_SHARED to one with intel/ in it)")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator, the same in every test."""
    return np.random.default_rng(20160914)


@pytest.fixture
def room_scan() -> LaserScan:
    """A noiseless scan of the room from its origin."""
    return room_scan_at(np.zeros(3))


@pytest.fixture
def room_pair() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points of two noisy scans of the room, and the pose of the second seen from the first."""
    truth = np.array([0.25, -0.15, 0.12])
    first = room_scan_at(np.zeros(3), noise=0.005, seed=1).points
    second = room_scan_at(truth, noise=0.005, seed=2).points
    return first, second, truth


def keyframes_of(points: Sequence[Points], poses: Poses) -> Keyframes:
    """Keyframes of one session, of which no more is known than their points and where they are."""
    sessions = Sessions()
    for _ in points:
        sessions.add()
    return Keyframes((), points, poses, sessions)


def scans_tracked(points: Sequence[Points], anchors: NDArray[np.int64], relatives: Poses) -> ScanTable:
    """Scans that hang on keyframes, of which no more is known."""
    scans = ScanTable()
    for seen, anchor, relative in zip(points, anchors, relatives, strict=True):
        scans.append(0.0, np.zeros(3), np.zeros(3), int(anchor), relative, np.zeros(3), np.eye(3), seen)
    return scans
