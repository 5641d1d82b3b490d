"""Stamps that come late, and what runs make of them."""

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

from hsslam.config import GraphSection, load_config
from hsslam.datasets.catalogue import open_dataset
from hsslam.datasets.simulator import EXACT, DriveModel, SimulatedDataset
from hsslam.scan import LaserScan, ScanGeometry
from hsslam.se2 import between_many
from hsslam.slam.clock import DOUBTED, ScanClock
from hsslam.slam.motion import Evidence, MotionModel
from hsslam.slam.pipeline import Slam

Stamps = NDArray[np.float64]


def told(stamps: Stamps) -> Stamps:
    """What a clock says of the time from each scan to the next."""
    clock, seconds = ScanClock(), []
    clock.observe(stamps[0])
    for stamp in stamps[1:]:
        seconds.append(clock.since_last(stamp))
        clock.observe(stamp)
    return np.array(seconds)


def in_turn(period: float, count: int) -> Stamps:
    return 1e9 + period * np.arange(count)


def late(stamps: Stamps, every: float, seed: int = 0) -> Stamps:
    """Stamped when a recorder that looks now and then, ``every`` so many seconds, finds them: several at once."""
    looks = stamps[0] + np.cumsum(np.random.default_rng(seed).uniform(0.5, 1.5, 2 * len(stamps)) * every)
    return looks[np.searchsorted(looks, stamps)] + 1e-3 * np.arange(len(stamps)) % 7e-3


@given(st.floats(0.01, 2.0), st.sets(st.integers(20, 80), max_size=8))
@settings(deadline=None, max_examples=40)
def test_steady_stamps_are_believed_and_lost_scans_leave_gaps(period: float, lost: set[int]) -> None:
    stamps = np.delete(in_turn(period, 100), sorted(lost))
    assert told(stamps) == pytest.approx(np.diff(stamps), rel=1e-3)


@given(st.integers(0, 1000))
@settings(deadline=None, max_examples=20)
def test_scans_stamped_at_once_were_not_taken_at_once(seed: int) -> None:
    seconds = told(late(in_turn(0.1, 400), 0.5, seed))[100:]
    assert seconds.min() > 0.05
    assert seconds.max() < 0.2


def test_a_pause_does_not_count_as_an_interval() -> None:
    stamps = in_turn(0.1, 200)
    stamps[100:] += 3600.0
    assert np.delete(told(stamps), 99) == pytest.approx(0.1, rel=1e-3)


def test_stamps_are_believed_again_in_time() -> None:
    clock, stamps = ScanClock(), in_turn(0.1, 200)
    stamps[50] += 0.099
    steady = []
    for stamp in stamps:
        steady.append(clock.steady(stamp))
        clock.observe(stamp)
    assert all(steady[:51])
    assert not any(steady[51 : 52 + DOUBTED])
    assert all(steady[52 + DOUBTED :])


@pytest.mark.parametrize("stamps", [[0.0, 0.0, 0.0], [5.0, 4.0, 3.0], [1.0, 1.0, 0.5]])
def test_stamps_that_do_not_go_on_tell_nothing(stamps: list[float]) -> None:
    assert (told(np.array(stamps)) == 0.0).all()


def drift(log: SimulatedDataset, stamped: Callable[[Stamps], Stamps]) -> float:
    """Mean error (m) of a log's motions over ten scans, each stamped otherwise."""
    scans = list(log.scans())
    stamps = stamped(np.array([scan.stamp for scan in scans]))
    scans = [replace(scan, stamp=float(stamp)) for scan, stamp in zip(scans, stamps, strict=True)]
    found = Slam(load_config(overrides=["loops.enabled=false"])).solve(scans).online.poses
    error = between_many(between_many(log.poses[:-10], log.poses[10:]), between_many(found[:-10], found[10:]))
    return float(np.hypot(error[:, 0], error[:, 1]).mean())


def test_a_sweep_is_undone_as_well_with_late_stamps() -> None:
    """Scans of a laser that takes 0.1 s for a sweep, recorded in bursts; 24 cm off where such stamps are believed."""
    turning = DriveModel(rate=10.0, speed=0.5, turn_rate=math.radians(60.0))
    log = SimulatedDataset("office", scans=260, laser="rplidar-a2", odometry=EXACT, motion=turning)
    right = drift(log, lambda stamps: stamps)
    assert drift(log, lambda stamps: late(stamps, 0.4)) < 1.3 * right + 0.002


def test_late_stamps_do_not_stretch_the_motion_that_stands_in_for_odometry() -> None:
    """They made it four times as long, or a quarter: laser alone, the real Intel log came apart."""
    model, step, rest = MotionModel(GraphSection()), np.array([0.1, 0.0, 0.05]), np.zeros(3)
    stamps = late(in_turn(0.2, 60), 0.8)
    scans = [LaserScan(float(t), np.full(3, 1.0), ScanGeometry(0.0, 0.1), odometry=rest) for t in stamps]
    model.start(scans[0])
    for scan in scans[1:20]:
        model.observe(scan, step, Evidence(True))
    assert model.silent
    for scan in scans[20:]:
        assert model.predict(scan)[0] == pytest.approx(step)
        model.observe(scan, step, Evidence(True))


@pytest.mark.parametrize(
    ("stamp", "paused"),
    [(0.1, False), (0.45, False), (0.9, False), (1.1, True), (3600.0, True), (-0.5, False), (-50.0, True)],
)
def test_a_recording_paused_where_stamps_leap(stamp: float, paused: bool) -> None:
    clock = ScanClock()
    stamps = in_turn(0.1, 20).tolist()
    for known in stamps:
        clock.observe(known)
    assert clock.paused(stamps[-1] + stamp) is paused
    assert clock.pause(stamps[-1] + stamp) == pytest.approx(stamp if stamp > 0.0 else math.inf, abs=1e-6)


def test_slow_recordings_do_not_pause_and_the_first_scans_do_not_tell() -> None:
    slow, young = ScanClock(), ScanClock()
    for stamp in in_turn(2.0, 20).tolist():
        slow.observe(stamp)
    assert not slow.paused(stamp + 6.0)
    assert slow.paused(stamp + 11.0)
    for stamp in in_turn(0.1, 5).tolist():
        young.observe(stamp)
    assert not young.paused(stamp + 11.0)


@pytest.mark.parametrize(("stamp", "paused"), [(3.5, False), (4.5, True), (-3.5, False), (-50.0, True)])
def test_where_stamps_come_late_a_pause_is_longer(stamp: float, paused: bool) -> None:
    """Intel's recorder wrote in bursts, up to 3.5 s late; one such scan, which did not fit, was taken for a pause."""
    clock = ScanClock()
    stamps = in_turn(0.19, 40).tolist()
    for known in (*stamps, stamps[-1] + 1.5, stamps[-1] + 1.51):
        clock.observe(known)
    assert clock.paused(stamps[-1] + 1.51 + stamp) is paused


def test_intel_as_recorded_never_paused(shared_data: Path) -> None:
    clock = ScanClock()
    for scan in open_dataset("intel", data_dir=shared_data).scans():
        assert not clock.paused(scan.stamp), scan.index
        clock.observe(scan.stamp)
