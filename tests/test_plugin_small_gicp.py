"""Generalised ICP in the plane by small_gicp."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from hsslam.errors import ConfigError, MatcherUnavailableError
from hsslam.matching import SearchWindow, create, describe
from hsslam_plugins.small_gicp import SmallGicp

WINDOW = SearchWindow(0.2, 0.2, np.radians(10.0))


@pytest.fixture(scope="module")
def gicp() -> SmallGicp:
    try:
        return SmallGicp()
    except MatcherUnavailableError as error:
        pytest.skip(f"SMALL_GICP NOT TESTED: {error}")


def test_it_moves_from_the_guess_to_the_truth(gicp, room_pair) -> None:
    first, second, truth = room_pair
    reference = gicp.prepare(first)
    for offset in np.random.default_rng(1).uniform(-WINDOW.half, WINDOW.half, (20, 3)):
        result = gicp.match(reference, second, truth + offset, WINDOW, np.random.default_rng(0))
        assert result.converged
        assert result.evaluations > 1
        assert result.pose[:2] == pytest.approx(truth[:2], abs=0.02)
        assert result.pose[2] == pytest.approx(truth[2], abs=np.radians(0.5))


def test_a_scan_beyond_reach_has_not_converged(gicp, room_pair) -> None:
    first, second, _ = room_pair
    result = gicp.match(gicp.prepare(first), second + 300.0, np.zeros(3), WINDOW, np.random.default_rng(0))
    assert not result.converged


def test_settings_that_make_no_sense() -> None:
    with pytest.raises(ConfigError, match="distance_end is larger"):
        create("small_gicp", {"distance_end": 2.0})


def test_the_package_is_loaded_only_when_used() -> None:
    script = "import sys, hsslam_plugins.small_gicp; print('small_gicp' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_without_the_package_the_pip_line_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "small_gicp", None)
    info = describe("small_gicp")
    assert not info.available
    assert info.reason == "the package small_gicp is not installed"
    assert info.remedy == "pip install 'hsslam[small-gicp]'"
    assert describe("hide").available
