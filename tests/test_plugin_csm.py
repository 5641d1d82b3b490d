"""Correlative scan matching."""

from __future__ import annotations

import numpy as np
import pytest

from hsslam.matching import SearchWindow, create


def test_it_finds_the_truth_between_the_steps_of_its_search(room_pair) -> None:
    first, second, truth = room_pair
    window = SearchWindow(0.2, 0.2, np.radians(10.0))
    csm = create("csm")
    reference = csm.prepare(first)
    errors = []
    for offset in np.random.default_rng(1).uniform(-window.half, window.half, (20, 3)):
        result = csm.match(reference, second, truth + offset, window, np.random.default_rng(0))
        assert result.converged
        errors.append(np.abs(result.pose - truth))
    assert np.median(errors, axis=0) == pytest.approx(np.zeros(3), abs=csm.config.resolution / 3)


def test_it_searches_a_window_far_beyond_local_methods(room_pair) -> None:
    first, second, truth = room_pair
    window = SearchWindow(1.0, 1.0, np.radians(45.0))
    csm = create("csm")
    result = csm.match(csm.prepare(first), second, truth + (0.9, -0.8, 0.7), window, np.random.default_rng(0))
    assert result.pose == pytest.approx(truth, abs=0.015)


def test_the_mean_stays_in_the_window(room_pair) -> None:
    first, second, truth = room_pair
    window = SearchWindow(0.1, 0.1, np.radians(3.0))
    csm = create("csm", {"temperature": 20.0})
    guess = truth + (0.1, 0.1, np.radians(3.0))
    result = csm.match(csm.prepare(first), second, guess, window, np.random.default_rng(0))
    assert "rejected" not in result.diagnostics
    assert window.contains(guess, result.pose)
