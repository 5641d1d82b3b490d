"""KISS-ICP in the plane."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from hsslam.errors import ConfigError, MatcherUnavailableError
from hsslam.matching import SearchWindow, create, describe
from hsslam_plugins.kiss_icp import KissIcp

WINDOW = SearchWindow(0.2, 0.2, np.radians(10.0))


@pytest.fixture(scope="module")
def kiss() -> KissIcp:
    try:
        return KissIcp()
    except MatcherUnavailableError as error:
        pytest.skip(f"KISS-ICP NOT TESTED: {error}")


def test_the_plugin_and_the_package_of_its_name_do_not_mix() -> None:
    script = "import hsslam_plugins.kiss_icp as p; print(p.package().__name__, p.__name__)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    if done.returncode:
        assert "the package kiss-icp is not installed" in done.stderr
        pytest.skip("kiss-icp is not installed")
    assert done.stdout.split() == ["kiss_icp", "hsslam_plugins.kiss_icp"]


def test_it_moves_from_the_guess_to_the_truth(kiss, room_pair) -> None:
    first, second, truth = room_pair
    reference = kiss.prepare(first)
    for offset in np.random.default_rng(1).uniform(-WINDOW.half, WINDOW.half, (20, 3)):
        result = kiss.match(reference, second, truth + offset, WINDOW, np.random.default_rng(0))
        assert result.converged
        assert result.pose[:2] == pytest.approx(truth[:2], abs=0.03)
        assert result.pose[2] == pytest.approx(truth[2], abs=np.radians(1.0))


def test_far_from_its_origin_it_does_as_well(kiss, room_pair) -> None:
    first, second, truth = room_pair
    away = np.array([400.0, -300.0, 0.0])
    reference = kiss.prepare(first + away[:2])
    result = kiss.match(reference, second, truth + away + 0.05, WINDOW, np.random.default_rng(0))
    assert result.pose == pytest.approx(truth + away, abs=0.03)


def test_the_same_bits_every_time(kiss, room_pair) -> None:
    first, second, truth = room_pair
    poses = {
        kiss.match(kiss.prepare(first), second, truth + 0.1, WINDOW, np.random.default_rng(0)).pose.tobytes()
        for _ in range(20)
    }
    assert len(poses) == 1


def test_a_reach_beyond_a_voxel_is_refused() -> None:
    with pytest.raises(ConfigError, match="distance_start is larger than voxel_size"):
        create("kiss_icp", {"voxel_size": 0.05})


@pytest.mark.parametrize(
    "parameters", [{"distance_end": 0.71}, {"robust_scale_end": 0.2}, {"voxel_size": 0.0}]
)
def test_settings_that_make_no_sense(parameters) -> None:
    with pytest.raises(ConfigError, match=next(iter(parameters))):
        create("kiss_icp", parameters)


def test_without_the_package_the_pip_line_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "kiss_icp", None)
    info = describe("kiss_icp")
    assert not info.available
    assert info.reason == "the package kiss-icp is not installed"
    assert info.remedy == "pip install 'hsslam[kiss-icp]'"
    assert describe("hide").available
