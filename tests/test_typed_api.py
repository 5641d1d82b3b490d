"""A user's program is checked against hsslam's types: the package is marked as typed, and nothing in it is Any."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import resources
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

PROGRAM = """
from pathlib import Path
import numpy as np
from pydantic import Field
from hsslam.config import Config, KeyframeSection, load_config
from hsslam.datasets.catalogue import open_dataset
from hsslam.matching import Estimate, Matcher, MatcherConfig, Points, Pose, Reference, SearchWindow, create
from hsslam.matching.conformance import check_matcher, conformance_checks
from hsslam.search import minimize
from hsslam.slam.pipeline import Slam
from hsslam_eval.compare import CompareConfig, DatasetSpec, compare
from hsslam_plugins.hide import HideConfig

class MineConfig(MatcherConfig):
    reach: float = Field(default=0.3, gt=0.0)

class Mine(Matcher[MineConfig]):
    Config = MineConfig
    summary = "mine"
    def estimate(
        self, reference: Reference, points: Points, guess: Pose, window: SearchWindow, rng: np.random.Generator
    ) -> Estimate:
        reveal_type(self.config.reach)
        return Estimate(guess)

matcher = create("hide", {"evaluations": 300})
points = np.zeros((9, 2))
result = matcher.match(matcher.prepare(points), points, np.zeros(3), SearchWindow(1, 1, 1), np.random.default_rng(0))
reveal_type(result.pose)
reveal_type(result.score)
check_matcher(Mine(MineConfig(reach=0.2)))
reveal_type(conformance_checks()[0][0])
slam = Slam(Config(seed=1, keyframes=KeyframeSection(distance=0.4)))
slam = Slam(load_config(overrides=["matcher=hsl"]))
print(HideConfig(memory_size=40))
for event in slam.run(open_dataset("office").scans()):
    reveal_type(event)
reveal_type(slam.result().trajectory.poses)
print(minimize(lambda x: float(x.sum()), [(0.0, 1.0)]).fun)
config = CompareConfig.model_validate({"matchers": ["hide"]})
reveal_type(compare(config, DatasetSpec(name="office"), Path("out")).matchers[0].failures[0].reason)
"""

WRONG = """
from hsslam.matching import SearchWindow, create
create(3)
SearchWindow(0.1, 0.1)
"""


def mypy(program: Path) -> str:
    command = [
        "--strict",
        "--config-file=",
        f"--cache-dir={ROOT / '.mypy_cache'}",
        "--explicit-package-bases",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *command, "--follow-untyped-imports", program],
        capture_output=True,
        text=True,
        check=False,
        cwd=program.parent,
    )
    return done.stdout + done.stderr


@pytest.mark.parametrize("package", ["hsslam", "hsslam_plugins", "hsslam_eval"])
def test_the_packages_are_marked_as_typed(package: str) -> None:
    assert (resources.files(package) / "py.typed").is_file()


def test_a_users_program_is_typed_through_and_through(tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    (tmp_path / "wrong.py").write_text(WRONG)
    # Without pydantic's plugin, which a user need not have.
    options = ["--strict", "--config-file=", f"--cache-dir={ROOT / '.mypy_cache' / 'user'}"]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, "program.py", "wrong.py"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    errors = [line for line in done.stdout.splitlines() if "error:" in line]
    assert [line.partition(": error")[0] for line in errors] == ["wrong.py:3", "wrong.py:4"], done.stdout
    revealed = re.findall(r'Revealed type is "(.*)"', done.stdout)
    assert len(revealed) == PROGRAM.count("reveal_type(")
    assert [kind for kind in revealed if kind == "Any"] == []
    assert revealed[0].endswith("float")
