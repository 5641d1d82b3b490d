"""The refinement on scans whose noise is known: to the truth, and nearer to it than points to lines alone."""

from __future__ import annotations

import math

import numpy as np

from hsslam.datasets.simulator import simulate_pairs
from hsslam.kernels.refine import NO_LINES, refine
from hsslam.matching.interface import Reference, SearchWindow
from hsslam.se2 import between
from hsslam.search.polish import REACHES, SCALES, SETTLE, polish

WIDE = SearchWindow(0.5, 0.5, math.radians(30.0))


def test_lines_of_both_scans_are_better_than_those_of_one() -> None:
    """With a URG-04LX the reference's lines are as noisy as the scan's points."""
    one_way, both_ways = [], []
    for pair in simulate_pairs("office", 300, "urg-04lx", np.random.default_rng(3)):
        reference = Reference(pair.reference_points)
        points, truth = pair.scan_points, pair.relative
        surface = reference.surface
        found, _, _ = refine(
            surface.pieces,
            surface.nearest,
            surface.frame,
            points,
            NO_LINES,
            truth,
            40,
            SETTLE,
            REACHES,
            SCALES,
        )
        one_way.append(np.hypot(*between(truth, found)[:2]))
        found, _ = polish(reference, points, truth, truth, WIDE, 40)
        both_ways.append(np.hypot(*between(truth, found)[:2]))
    assert np.mean(both_ways) < 0.97 * np.mean(one_way)
    assert np.mean(both_ways) < 0.004
