"""Fitness functions of plugins stand beside the built-in ones: in settings, in the schema, in every search."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hsslam import plugin_files
from hsslam.errors import ConfigError
from hsslam.matching import SearchWindow, create
from hsslam.matching.conformance import check_matcher
from hsslam.search import fitness_names
from hsslam_plugins.hide import HideConfig

PLUGIN = """
from dataclasses import replace
import numpy as np
from hsslam.search import register_fitness, Raster

def heavy_tails(points, surface, half_side, resolution):
    smooth = Raster.smooth(surface.segments, half_side, resolution)
    return replace(smooth, cells=np.rint(255.0 * np.sqrt(smooth.cells / 255.0)).astype(np.uint8))

register_fitness("heavy_tails", heavy_tails)
"""


@pytest.fixture
def heavy_tails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(plugin_files.VARIABLE, "")
    file = tmp_path / "heavy.py"
    file.write_text(PLUGIN)
    plugin_files.use(file)


def test_a_plugins_fitness_function_conforms_in_every_search(heavy_tails: None) -> None:
    assert fitness_names() == ["paper", "surface", "sides", "likelihood", "heavy_tails"]
    assert "heavy_tails" in HideConfig.model_json_schema()["properties"]["fitness"]["enum"]
    check_matcher(create("hide", {"fitness": "heavy_tails"}))


def test_it_finds_the_pose_without_refinement(
    heavy_tails: None, room_pair: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> None:
    reference, scan, truth = room_pair
    for name in ("hsl", "hide"):
        matcher = create(name, {"fitness": "heavy_tails", "refine": False, "half_side": 0.1})
        window, rng = SearchWindow(0.15, 0.15, 0.15), np.random.default_rng(0)
        found = matcher.match(matcher.prepare(reference), scan, truth + 0.05, window, rng)
        assert np.abs(found.pose - truth).max() < 0.04


def test_a_misspelt_one_comes_with_a_suggestion() -> None:
    with pytest.raises(ConfigError, match=r"hide\.fitness: no fitness function is named .*'likelihood'"):
        create("hide", {"fitness": "likelyhood"})


def test_an_installed_package_declares_one(tmp_path: Path) -> None:
    (tmp_path / "heavy.py").write_text(PLUGIN.partition("\nregister_fitness")[0])
    information = tmp_path / "heavy-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: heavy\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[hsslam.fitness]\nheavy = heavy:heavy_tails\n")
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n"
        "from hsslam.matching import create\n"
        "print(create('hide', {'fitness': 'heavy'}).config.fitness)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "heavy", done.stderr


def test_one_that_returns_no_raster_is_named(heavy_tails: None, tmp_path: Path) -> None:
    file = tmp_path / "none.py"
    file.write_text(
        "from hsslam.search import register_fitness\nregister_fitness('empty', lambda *given: None)\n"
    )
    plugin_files.use(file)
    with pytest.raises(ConfigError, match="fitness function 'empty': expected it to return a hsslam"):
        create("hide", {"fitness": "empty"}).prepare(np.zeros((5, 2)))
