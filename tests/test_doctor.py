"""`hsslam doctor` finds what is broken or missing, says what mends it, and is not taken down by it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hsslam import plugin_files
from hsslam.cli.main import app
from hsslam.doctor import Finding, examine


def without(package: str) -> Callable[[str], str]:
    """`importlib.metadata.version`, where a package is not installed."""
    version = metadata.version

    def found(name: str) -> str:
        if name == package:
            raise metadata.PackageNotFoundError(name)
        return version(name)

    return found


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of packages for this process and those that it starts."""
    place = tmp_path / "site"
    place.mkdir()
    monkeypatch.syspath_prepend(str(place))
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join(filter(None, [str(place), os.environ.get("PYTHONPATH")]))
    )
    return place


def found(data_dir: Path | None = None) -> dict[str, Finding]:
    return {finding.what: finding for finding in examine(data_dir)}


def test_broken_and_missing_parts_are_told_apart_and_mended(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (site / "kiss_icp.py").write_text("raise ModuleNotFoundError('no kiss_icp', name='kiss_icp')\n")
    (site / "crashing.py").write_text("import ctypes\nctypes.string_at(0)\n")
    information = site / "crashing_matcher-1.0.dist-info"
    information.mkdir()
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: crashing-matcher\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[hsslam.matchers]\ncrash = crashing:Crash\n")
    monkeypatch.setenv(plugin_files.VARIABLE, str(tmp_path / "gone.py"))
    (tmp_path / "taken").write_text("")
    (site / "rerun_sdk-7.8.dist-info").mkdir()
    (site / "rerun_sdk-7.8.dist-info" / "METADATA").write_text("Name: rerun-sdk\nVersion: 7.8\n")
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("DISPLAY", ":5")
    findings = found(tmp_path / "taken")
    assert findings["live map"] == Finding("live map", "ok", "shown by rerun-sdk 7.8, or matplotlib")
    assert findings["display"] == Finding("display", "ok", ":5, for --live")
    assert findings["data folder"].status == "broken"
    assert findings["data folder"].remedy == "export HSSLAM_DATA=/a/folder/of/yours"
    assert findings["packages"].status == "ok"
    assert {"ROS bags", "sweeps"} <= findings.keys()  # extras that a verb needs
    assert findings["kernel cache"].status == "ok"
    assert findings["dataset intel"].status == "missing"
    assert "fetch intel --data-dir" in findings["dataset intel"].remedy
    assert findings["plugin files"] == Finding(
        "plugin files", "broken", f"plugin {tmp_path / 'gone.py'}: no such file", "unset HSSLAM_PLUGINS"
    )
    monkeypatch.setenv(plugin_files.VARIABLE, "")
    monkeypatch.setattr("importlib.metadata.version", without("rerun-sdk"))
    findings = found(tmp_path / "data")
    assert findings["live map"].status == "missing"
    assert findings["live map"].remedy == "pip install 'hsslam[live]'"
    assert findings["matcher hide"].status == "ok"
    assert findings["matcher kiss_icp"].status == "missing"
    assert findings["matcher kiss_icp"].remedy == "pip install 'hsslam[kiss-icp]'"
    assert findings["matcher crash"] == Finding(
        "matcher crash", "broken", "crashes (signal 11)", "pip install --force-reinstall crashing-matcher"
    )


@pytest.mark.parametrize(
    ("status", "options", "code"),
    [("ok", (), 0), ("missing", (), 0), ("missing", ("--strict",), 1), ("broken", (), 1)],
)
def test_the_exit_code_is_for_scripts(
    monkeypatch: pytest.MonkeyPatch, status: str, options: tuple[str, ...], code: int
) -> None:
    finding = Finding("thing", status, "a detail", "a remedy")  # type: ignore[arg-type]
    monkeypatch.setattr("hsslam.doctor.examine", lambda data_dir: iter([finding]))
    result = CliRunner().invoke(app, ["doctor", *options])
    assert result.exit_code == code
    assert ("a remedy" in result.stdout) == (status != "ok")
    told = json.loads(CliRunner().invoke(app, ["doctor", "--json"]).stdout)
    assert told == [{"what": "thing", "status": status, "detail": "a detail", "remedy": "a remedy"}]


def test_without_a_place_for_a_cache_kernels_still_compile() -> None:
    code = (
        "import numba.core.caching as caching\n"
        "caching.CacheImpl._locator_classes = []\n"
        "from hsslam.jit import kernel\n"
        "def double(x): return x + x\n"
        "print(kernel(double)(21))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "42", done.stderr
