"""Parts of the robot in its laser's view: found where it drives and turns, and of no say from then on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from typer.testing import CliRunner

from hsslam.cli.main import app
from hsslam.config import load_config
from hsslam.datasets.simulator import SimulatedDataset, raycast
from hsslam.io.range_table import write_range_csv
from hsslam.kernels.own_parts import (
    BINS,
    DEVIATION,
    LEAST_COUNT,
    LEAST_TURN,
    LEAST_WAY,
    NEAREST,
    STAYS,
    of_parts,
    ranges_of_parts,
    watch,
)
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import compose, pose
from hsslam.slam.own_parts import OwnParts
from hsslam.slam.pipeline import Slam
from hsslam_eval.metrics import ate

GEOMETRY = ScanGeometry(-math.pi, math.radians(1.0), range_max=20.0)
ROOM = np.array(
    [[-6.0, -5.0, 7.0, -5.0], [7.0, -5.0, 7.0, 6.0], [7.0, 6.0, -6.0, 6.0], [-6.0, 6.0, -6.0, -5.0]]
)
CORRIDOR = np.array([[-90.0, -0.8, 90.0, -0.8], [-90.0, 0.8, 90.0, 0.8]])

positions = st.floats(-3.0, 3.0, allow_nan=False)
rows = st.lists(st.tuples(positions, positions), min_size=1, max_size=30)


def round_trip(steps: int = 24) -> list[NDArray[np.float64]]:
    """Places on a circle of 2 m, looking along it."""
    return [
        pose(2.0 * math.sin(a), 2.0 - 2.0 * math.cos(a), a) for a in np.linspace(0.0, math.tau, steps, False)
    ]


def scans_of(
    walls: NDArray[np.float64],
    places: list[NDArray[np.float64]],
    part: Callable[[int], float] = lambda i: 0.45,
    laser: NDArray[np.float64] | None = None,
    noise: float = 0.01,
) -> list[LaserScan]:
    """Of a robot with something that far before beams 60 to 80."""
    laser = laser if laser is not None else np.zeros(3)
    rng = np.random.default_rng(0)
    scans = []
    for i, place in enumerate(places):
        ranges = raycast(walls, compose(place, laser), GEOMETRY, 360)
        ranges[60:80] = np.minimum(ranges[60:80], part(i))
        ranges += noise * rng.standard_normal(360)
        scans.append(LaserScan(float(i), ranges, GEOMETRY, place, laser, index=i))
    return scans


def boxed(log: SimulatedDataset) -> list[LaserScan]:
    """A log of a robot that carries a box before a sixth of its view."""
    scans = []
    for scan in log.scans():
        ranges = scan.ranges.copy()
        ranges[120:150] = 0.6
        scans.append(replace(scan, ranges=ranges))
    return scans


def watched(scans: list[LaserScan]) -> OwnParts:
    parts = OwnParts()
    for scan in scans:
        parts.watch(scan, scan.odometry)
    return parts


def twin(
    scans: list[tuple[NDArray[np.float64], NDArray[np.float64]]],
) -> NDArray[np.float64]:
    """Ranges of parts, direction by direction, from the whole list of scans."""
    found = np.full(BINS, np.nan)
    for k in range(BINS):
        stay: list[tuple[float, NDArray[np.float64]]] = []
        for points, place in scans:
            bins = ((np.arctan2(*points.T[::-1]) + math.pi) / math.tau * BINS).astype(int) % BINS
            if not (bins == k).any():
                continue
            r = float(np.hypot(*points[bins == k].T).min())
            if stay and (r > NEAREST or abs(r - np.mean([s for s, _ in stay])) > STAYS):
                stay = []
            if r <= NEAREST:
                stay.append((r, place))
        if len(stay) < LEAST_COUNT:
            continue
        ranges, places = np.array([r for r, _ in stay]), np.array([p for _, p in stay])
        way = np.hypot(*(places[:, :2] - places[0, :2]).T).max()
        if ranges.std() <= DEVIATION and way >= LEAST_WAY and np.ptp(places[:, 2]) >= LEAST_TURN:
            found[k] = ranges.mean()
    return found


@given(st.integers(0, 100_000), st.floats(0.0, 0.08), st.floats(0.0, 0.3))
@settings(deadline=None, max_examples=60)
def test_parts_are_those_of_the_twin(seed: int, noise: float, gaps: float) -> None:
    rng = np.random.default_rng(seed)
    ranges = rng.uniform(0.2, 2.0, 12)
    bearings = rng.uniform(-math.pi, math.pi, 12)
    scans, seen = [], np.zeros((BINS, 8))
    for place in np.cumsum(rng.uniform(-0.1, 0.4, (30, 3)), axis=0):
        r = ranges + noise * rng.standard_normal(12) + (rng.random(12) < 0.02)
        kept = rng.random(12) >= gaps
        points = (r * [np.cos(bearings), np.sin(bearings)]).T[kept]
        watch(seen, points, place)
        scans.append((points, place))
    np.testing.assert_allclose(ranges_of_parts(seen), twin(scans), atol=1e-12)


@given(rows, st.integers(0, 1000))
@settings(deadline=None, max_examples=60)
def test_points_of_parts_are_those_of_the_twin(points: list[tuple[float, float]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = np.where(rng.random(BINS) < 0.3, rng.uniform(0.2, 1.5, BINS), np.nan)
    cloud = np.array(points)
    bins = ((np.arctan2(*cloud.T[::-1]) + math.pi) / math.tau * BINS).astype(int) % BINS
    beside = parts[(bins[:, None] + [-1, 0, 1]) % BINS]
    expected = (np.abs(np.hypot(*cloud.T)[:, None] - beside) <= 0.1).any(axis=1)
    np.testing.assert_array_equal(of_parts(parts, cloud, 0.1), expected)


@pytest.mark.parametrize("laser", [pose(0.0, 0.0, 0.0), pose(0.3, -0.1, 2.0)], ids=["middle", "mounted"])
@pytest.mark.parametrize("noise", [0.005, 0.03])
def test_a_part_is_found_and_nothing_else(laser: NDArray[np.float64], noise: float) -> None:
    scans = scans_of(ROOM, round_trip(), laser=laser, noise=noise)
    parts = watched(scans)
    assert 18.0 <= parts.degrees <= 22.0
    cleared = parts.without(scans[3])
    gone = scans[3].valid & ~cleared.valid
    assert gone[60:80].mean() > 0.9
    assert gone[:59].sum() + gone[81:].sum() == 0
    left = parts.outside(scans[3].robot_points, laser)
    np.testing.assert_allclose(left, cleared.robot_points, atol=1e-12)


def test_a_wall_that_one_drives_along_is_no_part() -> None:
    places = [pose(0.3 * i, 0.0, 0.1 * math.sin(i)) for i in range(40)]
    assert not watched(scans_of(CORRIDOR, places, part=lambda i: 20.0))


def test_a_robot_that_turns_on_the_spot_tells_nothing() -> None:
    places = [pose(0.0, 0.0, 0.3 * i) for i in range(40)]
    assert not watched(scans_of(ROOM, places))


def test_who_walked_along_and_left_is_no_part_any_more() -> None:
    scans = scans_of(ROOM, [*round_trip(), *round_trip()], part=lambda i: 0.45 if i < 40 else 20.0)
    assert watched(scans[:40])
    assert not watched(scans)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_robot_that_sees_itself_maps_as_well_as_one_that_does_not(seed: int) -> None:
    """A sixth of the view is a box on the robot: left in, it says that the robot never moves: 2.6 to 8.3 cm off."""
    log = SimulatedDataset("office", seed=seed, scans=500)
    result = Slam(load_config(overrides=[f"seed={seed}"])).solve(boxed(log))
    assert ate(result.trajectory, log.truth()).summary()["translation_rmse_m"] < 0.012
    assert 25.0 <= result.statistics["own_parts_deg"] <= 31.0
    assert not any(scan.valid[122:148].any() for scan in result.keyframes)


def test_the_run_says_what_was_left_out(tmp_path: Path) -> None:
    write_range_csv(tmp_path / "boxed.csv", boxed(SimulatedDataset("office", scans=500)))
    done = CliRunner().invoke(app, ["run", str(tmp_path / "boxed.csv"), "--out", str(tmp_path / "run")])
    assert done.exit_code == 0, done.output
    assert "own parts" in done.output
    off = CliRunner().invoke(
        app,
        [
            "run",
            str(tmp_path / "boxed.csv"),
            "--out",
            str(tmp_path / "off"),
            "--set",
            "tracker.own_parts=false",
        ],
    )
    assert off.exit_code == 0, off.output
    assert "own parts" not in off.output
