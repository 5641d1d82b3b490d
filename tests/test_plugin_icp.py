"""ICP by Open3D: normals in the plane, accuracy, the same bits every time, clear words where something lacks."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.errors import ConfigError, MatcherUnavailableError
from hsslam.matching import SearchWindow, create, describe
from hsslam_plugins import open3d_library
from hsslam_plugins.icp import Icp, line_normals

WINDOW = SearchWindow(0.2, 0.2, np.radians(10.0))


@pytest.fixture(scope="module")
def icp() -> Icp:
    try:
        return Icp()
    except MatcherUnavailableError as error:
        pytest.skip(f"ICP NOT TESTED: {error}")


@settings(deadline=None, max_examples=50)
@given(st.floats(-3.1, 3.1), st.floats(-5, 5), st.integers(2, 60), st.integers(1, 90))
def test_normals_of_a_wall_stand_on_it(angle: float, distance: float, count: int, neighbours: int) -> None:
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    wall = np.linspace(0.0, 0.05 * count, count)[:, None] * along + distance * across
    normals = line_normals(wall, neighbours, 0.3)
    assert normals.shape == (count, 3)
    assert np.allclose(normals[:, 2], 0.0)
    assert np.allclose(np.abs(normals[:, :2] @ across), 1.0, atol=1e-6)


def test_a_point_without_neighbours_has_no_normal() -> None:
    points = np.array([[0.0, 0.0], [5.0, 0.0], [5.1, 0.0], [9.0, 9.0]])
    normals = line_normals(points, 5, 0.3)
    assert np.allclose(np.linalg.norm(normals, axis=1), [0.0, 1.0, 1.0, 0.0])
    assert line_normals(points[:1], 5, 0.3).tolist() == [[0.0, 0.0, 0.0]]
    assert line_normals(points[:0], 5, 0.3).shape == (0, 3)


def test_it_moves_from_the_guess_to_the_truth(icp, room_pair) -> None:
    first, second, truth = room_pair
    reference = icp.prepare(first)
    for offset in np.random.default_rng(1).uniform(-WINDOW.half, WINDOW.half, (20, 3)):
        result = icp.match(reference, second, truth + offset, WINDOW, np.random.default_rng(0))
        assert result.converged
        assert result.pose[:2] == pytest.approx(truth[:2], abs=0.01)
        assert result.pose[2] == pytest.approx(truth[2], abs=np.radians(0.5))


def test_the_same_bits_every_time_in_any_thread(icp, room_pair) -> None:
    first, second, truth = room_pair
    first = np.vstack([first + 1e-3 * k for k in range(8)])
    reference = icp.prepare(first)
    starts = truth + np.random.default_rng(2).uniform(-WINDOW.half, WINDOW.half, (40, 3))

    def run(start: np.ndarray) -> bytes:
        return icp.match(reference, second, start, WINDOW, np.random.default_rng(0)).pose.tobytes()

    once = [run(start) for start in starts]
    assert [run(start) for start in starts] == once
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(run, starts)) == once


def test_open3ds_threads_can_be_held(icp) -> None:
    assert open3d_library._tbb() is not None, (
        "Open3D's TBB not found: results would differ in their last bits"
    )


def test_it_says_nothing(icp, room_pair, capfd) -> None:
    first, second, truth = room_pair
    icp.match(icp.prepare(first), second, truth, WINDOW, np.random.default_rng(0))
    icp.match(icp.prepare(first), second + 300.0, truth, WINDOW, np.random.default_rng(0))
    assert capfd.readouterr() == ("", "")


def test_a_scan_beyond_reach_has_not_converged(icp, room_pair) -> None:
    first, second, _ = room_pair
    result = icp.match(icp.prepare(first), second + 300.0, np.zeros(3), WINDOW, np.random.default_rng(0))
    assert not result.converged
    assert result.score == 0.0


def test_an_answer_across_the_edge_of_the_window_moves_onto_it(icp, room_pair) -> None:
    first, second, truth = room_pair
    guess = truth + np.array([0.21, 0.0, 0.0])
    reference = icp.prepare(first)
    result = icp.match(reference, second, guess, WINDOW, np.random.default_rng(0))
    assert result.converged
    assert result.pose[0] == pytest.approx(guess[0] - 0.2)
    strict = create("icp", {"window_slack": 0.0})
    rejected = strict.match(reference, second, guess, WINDOW, np.random.default_rng(0))
    assert not rejected.converged
    assert "window" in rejected.diagnostics["rejected"]


def test_keeping_in_the_window_goes_round_the_circle() -> None:
    guess = np.array([1.0, 2.0, np.pi - 0.05])
    outside = np.array([1.22, 2.0, -np.pi + 0.01])
    kept = WINDOW.keep(guess, outside, 0.2)
    assert kept == pytest.approx([1.2, 2.0, np.pi + 0.01])
    assert WINDOW.keep(guess, outside, 0.05) is outside
    assert outside.tolist() == [1.22, 2.0, -np.pi + 0.01]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"distance_end": 2.0}, "distance_end is larger"),
        ({"robust_scale_end": 0.5}, "robust_scale_end is larger"),
        ({"stages": 0}, "stages"),
    ],
)
def test_settings_that_make_no_sense(parameters, message) -> None:
    with pytest.raises(ConfigError, match=message):
        create("icp", parameters)


@pytest.fixture
def forgotten(monkeypatch: pytest.MonkeyPatch):
    """Open3D as if it had not been imported yet."""
    open3d_library.open3d.cache_clear()
    for name in [name for name in sys.modules if name.split(".")[0] == "open3d"]:
        monkeypatch.delitem(sys.modules, name)
    yield monkeypatch
    open3d_library.open3d.cache_clear()


def test_without_the_package_the_pip_line_is_given(forgotten) -> None:
    forgotten.setitem(sys.modules, "open3d", None)
    info = describe("icp")
    assert not info.available
    assert info.reason == "the package open3d is not installed"
    assert info.remedy == "pip install 'hsslam[icp]'"
    assert info.summary
    assert describe("hide").available
    with pytest.raises(MatcherUnavailableError, match=r"hsslam\[icp\]"):
        create("icp")


def fake_open3d(folder: Path, text: str) -> None:
    (folder / "open3d").mkdir()
    (folder / "open3d" / "__init__.py").write_text(text)


@pytest.mark.skipif(sys.platform != "linux", reason="Open3D brings its libraries elsewhere")
def test_without_system_libraries_they_are_named_with_their_packages(forgotten, tmp_path: Path) -> None:
    fake_open3d(tmp_path, "raise ImportError('libGL.so.1: cannot open shared object file')\n")
    forgotten.syspath_prepend(str(tmp_path))
    forgotten.setattr(open3d_library, "_loads", lambda library: library not in ("libGL.so.1", "libX11.so.6"))
    info = describe("icp")
    assert "libGL.so.1, libX11.so.6" in info.reason
    assert "libEGL" not in info.reason
    assert info.remedy == "sudo apt-get install --no-install-recommends libgl1 libx11-6"


def test_a_broken_package_is_told_in_its_own_words(forgotten, tmp_path: Path) -> None:
    fake_open3d(tmp_path, "raise ImportError('undefined symbol: frobnicate')\n")
    forgotten.syspath_prepend(str(tmp_path))
    forgotten.setattr(open3d_library, "_loads", lambda library: True)
    info = describe("icp")
    assert "undefined symbol: frobnicate" in info.reason
    assert "pip install 'hsslam[icp]'" in info.remedy


@pytest.mark.skipif(sys.platform != "linux", reason="Linux wheels only need libusb")
def test_libusb_comes_from_pip_where_the_system_has_none(icp) -> None:
    pytest.importorskip("libusb_package")
    script = (
        "from hsslam_plugins import open3d_library as o\n"
        "real = o._loads\n"
        "o._loads = lambda library: library != 'libusb-1.0.so.0' and real(library)\n"
        "o._lend_libusb()\n"
        "print('libusb' in open('/proc/self/maps').read())\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
