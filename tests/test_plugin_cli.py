"""`hsslam plugin`: what `new` writes works as it is; `check` finds what is wrong with a matcher, and survives it."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from hsslam import plugin_files
from hsslam.cli.main import app
from hsslam.matching import create, registry
from hsslam.matching.conformance import conformance_checks
from hsslam.matching.conformance.probe import match_room

PROMISES = len(conformance_checks())


def hsslam(*args: str | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


@pytest.fixture(autouse=True)
def no_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forget the files that a test names."""
    monkeypatch.setenv(plugin_files.VARIABLE, "")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("new") / "my_first_matcher"
    result = hsslam("plugin", "new", "my_first_matcher", folder)
    assert result.exit_code == 0, result.stderr
    assert f"hsslam plugin check my_first_matcher --plugin {folder}/my_first_matcher.py" in result.stdout
    yield folder


def test_new_writes_a_package_that_declares_its_matcher(package: Path) -> None:
    files = {str(path.relative_to(package)) for path in package.rglob("*") if path.is_file()}
    assert files == {
        "my_first_matcher.py",
        "tests/test_my_first_matcher.py",
        "pyproject.toml",
        "README.md",
    }
    project = tomllib.loads((package / "pyproject.toml").read_text())["project"]
    assert project["name"] == "my-first-matcher"
    assert project["entry-points"][registry.GROUP] == {"my_first_matcher": "my_first_matcher:MyFirstMatcher"}


@pytest.mark.parametrize(
    "command",
    [
        ["check", "--select", "E,F,W,I,UP,B,D100,D101,D102,D103,RUF", "--per-file-ignores", "tests/*:D"],
        ["format", "--check", "--diff"],
    ],
)
def test_what_new_writes_is_in_good_style(package: Path, command: list[str]) -> None:
    options = ["--isolated", "--no-cache", "--line-length", "88", "."]
    ruff = shutil.which("ruff", path=Path(sys.executable).parent) or "ruff"
    done = subprocess.run(
        [ruff, *command, *options], capture_output=True, text=True, check=False, cwd=package
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_its_own_tests_pass(package: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", package],
        capture_output=True,
        text=True,
        check=False,
        cwd=package,
    )
    assert done.returncode == 0, done.stdout
    assert f"{PROMISES + 1} passed" in done.stdout


def test_check_finds_it_good_and_races_it(package: Path) -> None:
    file = package / "my_first_matcher.py"
    result = hsslam(
        *("plugin", "check", "my_first_matcher", "--plugin", file, "--against", "hide", "--trials", 20)
    )
    assert result.exit_code == 0, result.stdout + result.stderr
    assert f"{PROMISES} of {PROMISES} promises kept" in result.stdout
    rows = [line.split() for line in result.stdout.splitlines()]
    assert ["my_first_matcher", "20"] in [row[:2] for row in rows]
    assert ["hide", "20"] in [row[:2] for row in rows]


def test_a_file_is_a_matcher_everywhere(package: Path) -> None:
    file = package / "my_first_matcher.py"
    listed = hsslam("matchers", "list", "--plugin", file)
    (row,) = [line for line in listed.stdout.splitlines() if line.startswith("my_first_matcher")]
    assert row.split(None, 3)[1:3] == ["file", "my_first_matcher.py"]
    assert "reach" in hsslam("matchers", "describe", "my_first_matcher", "--plugin", file).stdout


def test_a_file_matches_and_runs(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = package / "my_first_matcher.py"
    options = ("--plugin", file, "--matcher", "my_first_matcher", "--set", "matcher.reach=0.25")
    matched = hsslam("match", "office", "10", "12", *options)
    assert matched.exit_code == 0, matched.stderr
    ran = hsslam("run", "office", "--scans", 20, *options, "--out", "run", "--quiet")
    assert ran.exit_code == 0, ran.stderr
    assert "reach: 0.25" in Path("run/config.yaml").read_text()
    told = json.loads(Path("run/environment.json").read_text())["plugins"]
    assert told["my_first_matcher.py"] == hashlib.sha256(file.read_bytes()).hexdigest()


BAD = """
import os, time
from hsslam.matching import Estimate, Matcher

class Lazy(Matcher):
    summary = "answers with the guess"
    def estimate(self, reference, points, guess, window, rng):
        return Estimate(guess)

class Gone(Lazy):
    def estimate(self, reference, points, guess, window, rng):
        os._exit(3)

class Stuck(Lazy):
    def prepare(self, points):
        time.sleep(3600)

class Unmade(Lazy):
    def __init__(self, config=None):
        raise OSError("no such device")
"""


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("lazy", ["accuracy", "median answer is", f"of {PROMISES} promises kept"]),
        (
            "gone",
            [
                "pickle",
                "its process ended with exit code 3",
                f"2 of {PROMISES} promises kept; {PROMISES - 3} were not",
            ],
        ),
        ("stuck", ["pickle", "took no step for 5 s and was ended in prepare (bad.py:"]),
        ("unmade", ["making it", "raised OSError: no such device", f"0 of {PROMISES}"]),
    ],
)
def test_check_says_what_is_wrong(tmp_path: Path, name: str, said: list[str]) -> None:
    file = tmp_path / "bad.py"
    file.write_text(BAD)
    match_room(
        create("pl_icp")
    )  # kernels are in the cache now, and are not compiled on the time that is limited
    result = hsslam("plugin", "check", name, "--plugin", file, "--no-trials", "--time-limit", 5)
    assert result.exit_code == 1
    for words in said:
        assert words in result.stdout


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["plugin", "new", "My-Matcher"], 2, "try my_matcher"),
        (["plugin", "new", "NearestNeighbour"], 2, "try nearest_neighbour"),
        (["plugin", "new", "class"], 2, "lower case"),
        (["plugin", "new", "hide"], 2, "a matcher named 'hide' exists already"),
        (["plugin", "new", "numpy"], 2, "a Python module named 'numpy' exists already"),
        (["plugin", "new", "fresh", "full"], 3, "full: exists already"),
        (["plugin", "check", "hid"], 2, "did you mean 'hide'?"),
        (["plugin", "check", "hide", "--exempt", "speed"], 2, "--exempt speed: no such check"),
        (["matchers", "--plugin", "nowhere.py"], 2, "nowhere.py: no such file"),
        (["matchers", "--plugin", "full/text.txt"], 2, "expected a Python file"),
        (["matchers", "--plugin", "full/wrong.py"], 2, "wrong.py:2: cannot be loaded: ZeroDivisionError"),
        (["matchers", "--plugin", "full/syntax.py"], 2, "syntax.py:1: cannot be loaded: SyntaxError"),
        (["matchers", "--plugin", "full/leaves.py"], 2, "leaves.py:1: cannot be loaded: SystemExit"),
        (["matchers", "--plugin", "full/taken.py"], 2, "a matcher named 'hide' exists already"),
    ],
)
def test_what_the_author_can_mend_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], code: int, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    texts = {
        "text.txt": "",
        "wrong.py": "x = 1\n1 / 0\n",
        "syntax.py": "def f(:\n",
        "leaves.py": "raise SystemExit(4)\n",
        "taken.py": "from hsslam.matching import Matcher\nclass Hide(Matcher):\n"
        "    def estimate(self, *args): ...\n",
    }
    (tmp_path / "full").mkdir()
    for name, text in texts.items():
        (tmp_path / "full" / name).write_text(text)
    result = hsslam(*args)
    assert result.exit_code == code, result.stdout
    (line,) = result.stderr.splitlines()
    assert said in line
    assert [path.name for path in tmp_path.iterdir()] == ["full"]
