"""The registry: what is installed, what is broken and why, and that the rest does not suffer."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from hsslam.errors import ConfigError, MatcherUnavailableError
from hsslam.matching import (
    Estimate,
    Matcher,
    MatcherConfig,
    create,
    describe,
    load,
    names,
    register,
    registry,
)
from hsslam.probe import tried

BUILT_IN = {"glasm", "hide", "hsl", "icp", "kiss_icp"}

GOOD = """
from hsslam.matching import Estimate, Matcher

class Stay(Matcher):
    summary = "stays where it is"
    def estimate(self, reference, points, guess, window, rng):
        return Estimate(guess)
"""


def install(folder: Path, distribution: str, entries: dict[str, str], modules: dict[str, str]) -> None:
    """Lay out what pip would: a dist-info with entry points, and modules."""
    info = folder / f"{distribution.replace('-', '_')}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {distribution}\nVersion: 1.0\n")
    lines = "\n".join(f"{name} = {value}" for name, value in entries.items())
    (info / "entry_points.txt").write_text(f"[{registry.GROUP}]\n{lines}\n")
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of installed packages on the import path; what is imported from it is forgotten afterwards."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    before = set(sys.modules)
    yield folder
    for name in set(sys.modules) - before:
        if str(folder) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.fixture
def registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget what a test registers."""
    monkeypatch.setattr(registry._matchers, "_registered", {})
    monkeypatch.setattr(registry._matchers, "_files", {})


def test_the_built_in_matchers_are_listed() -> None:
    assert set(names()) >= BUILT_IN
    assert names() == sorted(names())


def test_a_third_party_matcher_is_listed_described_and_made_like_a_built_in(site: Path) -> None:
    install(site, "stay-put", {"stay": "stay_put:Stay"}, {"stay_put": GOOD})
    assert "stay" in names()
    info = describe("stay")
    assert (info.available, info.origin, info.summary) == (True, "stay-put", "stays where it is")
    assert isinstance(create("stay", {"score_distance": 0.05}), load("stay"))


@pytest.mark.parametrize(
    ("module", "reason"),
    [
        ("import no_such_package_anywhere\n", "no_such_package_anywhere"),
        ("raise RuntimeError('half installed')\n", "half installed"),
        ("def broken(:\n", "SyntaxError"),
        ("x = 1\n", "Broken"),
        ("Broken = 3\n", "not a subclass"),
        ("class Broken: pass\n", "not a subclass"),
        (
            GOOD.replace("Stay", "Broken") + "    @classmethod\n    def check_available(cls): 1 / 0\n",
            "ZeroDivision",
        ),
    ],
)
def test_a_broken_plugin_is_listed_as_such_and_takes_nothing_down(
    site: Path, module: str, reason: str
) -> None:
    install(site, "broken-package", {"broken": "broken_module:Broken"}, {"broken_module": module})
    assert "broken" in names()
    info = describe("broken")
    assert not info.available
    assert reason in info.reason
    assert "pip install" in info.remedy
    assert "broken-package" in info.remedy
    assert info.origin == "broken-package"
    assert describe("hide").available
    assert create("hide").config.memory_size == 30


@pytest.mark.parametrize(
    ("module", "patience", "reason"),
    [
        ("import ctypes\nctypes.string_at(0)\n", 60.0, r"its import crashes \(signal 11\)"),
        ("import time\ntime.sleep(3600)\n", 2.0, "its import does not come back within 2 s"),
    ],
)
def test_a_plugin_whose_import_crashes_or_hangs_is_kept_out(
    site: Path, monkeypatch: pytest.MonkeyPatch, module: str, patience: float, reason: str
) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    monkeypatch.setattr("hsslam.matching.registry.tried", partial(tried, patience=patience))
    monkeypatch.setattr(registry._matchers, "_condemned", {})
    install(site, "deadly-package", {"deadly": "deadly_module:Deadly"}, {"deadly_module": module})
    registry.quarantine(["deadly", "hide", "no such name"])
    with pytest.raises(MatcherUnavailableError, match=reason):
        load("deadly")
    assert describe("deadly").remedy == "pip install --force-reinstall deadly-package"


def test_quarantine_lets_the_sound_ones_pass(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")]))
    install(site, "stay-put", {"stay": "stay_put:Stay"}, {"stay_put": GOOD})
    registry.quarantine(["stay"])
    assert describe("stay").available


def test_making_a_broken_matcher_says_why_and_what_to_type(site: Path) -> None:
    install(
        site, "broken-package", {"broken": "broken_module:Broken"}, {"broken_module": "import missing_dep_x"}
    )
    with pytest.raises(MatcherUnavailableError, match=r"missing_dep_x.*mend it with: pip install"):
        create("broken")


def test_an_abstract_matcher_does_not_take_the_listing_down(site: Path) -> None:
    text = "from hsslam.matching import Matcher\nclass Half(Matcher):\n    pass\n"
    install(site, "half-done", {"half": "half_done:Half"}, {"half_done": text})
    assert "half" in names()
    describe("half")
    assert describe("hide").available


def test_two_packages_with_one_name_collide(site: Path) -> None:
    install(site, "stay-put", {"stay": "stay_put:Stay"}, {"stay_put": GOOD})
    install(site, "stay-too", {"stay": "stay_too:Stay"}, {"stay_too": GOOD})
    with pytest.raises(ConfigError, match=r"'stay'.*uninstall one") as caught:
        names()
    assert "stay_put:Stay" in str(caught.value)
    assert "stay_too:Stay" in str(caught.value)


def test_the_same_package_seen_twice_does_not_collide(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(site, "stay-put", {"stay": "stay_put:Stay"}, {"stay_put": GOOD})
    second = site.parent / "second"
    install(second, "stay-put", {"stay": "stay_put:Stay"}, {"stay_put": GOOD})
    monkeypatch.syspath_prepend(str(second))
    assert names().count("stay") == 1


class Mine(Matcher[MatcherConfig]):
    summary = "mine"

    def estimate(self, reference, points, guess, window, rng):
        return Estimate(guess)


class Other(Mine):
    pass


def test_registered_matchers_are_known_at_once(registered: None) -> None:
    register("mine", Mine)
    register("mine", Mine)
    assert "mine" in names()
    assert isinstance(create("mine"), Mine)
    assert (describe("mine").available, describe("mine").origin) == (True, "registered")


def test_registered_names_must_be_free(registered: None) -> None:
    register("mine", Mine)
    with pytest.raises(ConfigError, match="'mine' exists already"):
        register("mine", Other)
    with pytest.raises(ConfigError, match="'hide' exists already"):
        register("hide", Mine)


@pytest.mark.parametrize(("typed", "meant"), [("hid", "hide"), ("kis_icp", "kiss_icp"), ("glazm", "glasm")])
def test_a_misspelt_name_comes_with_a_suggestion(typed: str, meant: str) -> None:
    with pytest.raises(ConfigError, match=f"no matcher is named '{typed}'; did you mean '{meant}'?"):
        load(typed)


def test_a_name_like_no_other_comes_with_the_list() -> None:
    with pytest.raises(ConfigError) as caught:
        create("xyzzy")
    assert all(name in str(caught.value) for name in BUILT_IN)
    assert "did you mean" not in str(caught.value)


def test_a_misspelt_parameter_comes_with_a_suggestion() -> None:
    with pytest.raises(ConfigError, match=r"hide\.memory_sise: unknown setting; did you mean 'memory_size'?"):
        create("hide", {"memory_sise": 40})


def test_a_parameter_out_of_range_names_itself_and_what_was_found() -> None:
    with pytest.raises(ConfigError, match=r"hide\.memory_size: .*found -3"):
        create("hide", {"memory_size": -3})


def test_listing_imports_no_plugin() -> None:
    script = (
        "import sys; from hsslam.matching import names; names();"
        "print([m for m in sys.modules if m.startswith(('hsslam_plugins', 'open3d', 'kiss_icp'))])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
