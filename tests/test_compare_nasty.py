"""Whatever a matcher does, it costs its own row of a comparison: a plugin file for each way to misbehave."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from hsslam import plugin_files
from hsslam.errors import ConfigError
from hsslam_eval.compare import CompareConfig, DatasetSpec, compare
from hsslam_eval.compare_config import LimitSection
from hsslam_eval.comparison import Comparison, MatcherOutcome
from hsslam_eval.jobs import JOB_FILE, Job
from hsslam_eval.report import write_report
from hsslam_eval.supervise import supervise
from hsslam_eval.workspace import Workspace

PLUGIN = '''
import ctypes, os, subprocess, sys, threading, time
import numpy as np
from hsslam.matching import Estimate, Matcher, MatcherConfig

class Nasty(Matcher):
    def estimate(self, reference, points, guess, window, rng):
        return self.misbehave(guess)

class NastyGood(Nasty):
    def misbehave(self, guess):
        return Estimate(guess)

class NastySpins(Nasty):
    """Holds the interpreter's lock: no signal handler written in Python would ever run."""
    def misbehave(self, guess):
        print("going to bed", flush=True)
        ctypes.PyDLL(None).sleep(3600)

class NastyNan(Nasty):
    def misbehave(self, guess):
        return Estimate(guess * np.nan, covariance=np.full((3, 3), np.nan))

class NastyCovariance(Nasty):
    def misbehave(self, guess):
        return Estimate(guess, covariance=np.full((3, 3), np.nan))

class NastySegfault(Nasty):
    def misbehave(self, guess):
        print("about to go", flush=True)
        ctypes.string_at(0)

class NastyLeaves(Nasty):
    def misbehave(self, guess):
        os._exit(0)

class NastyExits(Nasty):
    def misbehave(self, guess):
        sys.exit("that's it")

class NastyOrphan(Nasty):
    """Leaves a child that holds every descriptor open, and dies."""
    def misbehave(self, guess):
        subprocess.Popen(["sleep", "3600"], close_fds=False)
        os._exit(7)

class NastyLingers(Nasty):
    """Gives its answers, then does not let the process end."""
    def __init__(self, config=None):
        super().__init__(config)
        threading.Thread(target=time.sleep, args=(3600,)).start()
    def misbehave(self, guess):
        return Estimate(guess)

class BrokenConfig(MatcherConfig):
    @classmethod
    def model_validate(cls, *args, **kwargs):
        raise ZeroDivisionError("in its own validator")

class NastyConfig(NastyGood):
    Config = BrokenConfig

class NastyScribbles(Nasty):
    """Writes into descriptors that are not its own."""
    def misbehave(self, guess):
        for descriptor in range(3, 30):
            try:
                os.write(descriptor, b"\\n[1, 2]\\nnot JSON\\n")
            except OSError:
                pass
        return Estimate(guess)
'''
DATASET = DatasetSpec(name="office", seed=3, scans=30)


@pytest.fixture(scope="module", autouse=True)
def nasty_plugin(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    file = tmp_path_factory.mktemp("plugin") / "nasty.py"
    file.write_text(PLUGIN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(plugin_files.VARIABLE, "")
        plugin_files.use(file)
        yield file


def config(*matchers: str, **settings: object) -> CompareConfig:
    return CompareConfig.model_validate(
        {"matchers": matchers, "trials": {"count": 3, "warm_up": 1}, **settings}
    )


def row(comparison: Comparison, label: str) -> MatcherOutcome:
    return next(matcher for matcher in comparison.matchers if matcher.label == label)


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> tuple[Comparison, Path]:
    """Every ill-bred matcher, a good one last."""
    out = tmp_path_factory.mktemp("trials")
    kinds = "segfault leaves exits orphan config nan scribbles lingers good"
    labels = [f"nasty_{kind}" for kind in kinds.split()]
    return compare(config(*labels, run_slam=False), DATASET, out), out


@pytest.mark.parametrize(
    ("label", "said"),
    [
        ("nasty_segfault", r"signal 11 \(SIGSEGV\) in string_at \(__init__.py:\d+\).*about to go"),
        ("nasty_leaves", r"of its own accord and left no result"),
        ("nasty_exits", r"SystemExit: that's it"),
        ("nasty_orphan", r"exit code 7"),
        ("nasty_config", r"ZeroDivisionError: in its own validator"),
    ],
)
def test_it_costs_its_own_row_and_says_why(trials: tuple[Comparison, Path], label: str, said: str) -> None:
    outcome = row(trials[0], label)
    assert outcome.trials is None
    (failure,) = outcome.failures
    assert re.search(said, failure.reason), failure.reason
    assert "\n" not in failure.reason


def test_nan_costs_the_trials_that_gave_it(trials: tuple[Comparison, Path]) -> None:
    outcome = row(trials[0], "nasty_nan")
    assert outcome.failures == []
    assert outcome.trials is not None and outcome.trials.unanswered == {"the answer is not finite": 3}


@pytest.mark.parametrize("label", ["nasty_good", "nasty_scribbles", "nasty_lingers"])
def test_the_others_have_theirs(trials: tuple[Comparison, Path], label: str) -> None:
    outcome = row(trials[0], label)
    assert outcome.failures == []
    assert outcome.trials is not None and outcome.trials.unanswered == {}


def test_the_report_names_every_failure(trials: tuple[Comparison, Path]) -> None:
    comparison, out = trials
    write_report(comparison, out)
    page, text = ((out / name).read_text() for name in ("report.html", "report.md"))
    for matcher in comparison.failed:
        assert matcher.label in page
        assert matcher.failures[0].reason.split(" (")[0] in text


def test_no_process_is_left_behind(trials: tuple[Comparison, Path]) -> None:
    """The orphan's child would keep the name of its command for an hour."""
    running = [
        entry for entry in Path("/proc").glob("[0-9]*/cmdline") if _reads(entry) == b"sleep\x003600\x00"
    ]
    assert [entry for entry in running if _session_is_gone(entry.parent)] == []


def _reads(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _session_is_gone(process: Path) -> bool:
    session = _reads(process / "stat").rpartition(b")")[2].split()[3]
    return not (Path("/proc") / session.decode()).exists()


def test_slam_goes_on_past_them_too(tmp_path: Path) -> None:
    done = compare(config("nasty_nan", "nasty_covariance", run_trials=False), DATASET, tmp_path)
    lost = row(done, "nasty_nan")
    assert lost.slam is not None and lost.slam.matched <= 1
    own = row(done, "nasty_covariance")
    assert own.slam is not None and own.failures == []


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"step": 5.0}, "took no step for 5 s (limits.step)"),
        ({"step": 0.0, "total": 5.0}, "took longer than 5 s (limits.total)"),
    ],
)
def test_a_matcher_that_hangs_is_given_up(
    trials: tuple[Comparison, Path], tmp_path: Path, limits: dict[str, float], said: str
) -> None:
    done = compare(config("nasty_spins", run_slam=False, limits=limits), DATASET, tmp_path)
    (failure,) = done.matchers[0].failures
    assert said in failure.reason
    assert "in misbehave (nasty.py:" in failure.reason
    assert "its last line: going to bed" in failure.reason


def test_compiling_is_no_step_of_the_matcher(tmp_path: Path) -> None:
    worker = tmp_path / "compiles.py"
    worker.write_text(
        "import json, os, sys, time\n"
        "with os.fdopen(int(sys.argv[-1]), 'w', buffering=1) as out:\n"
        "    tell = lambda **said: print(json.dumps(said), file=out)\n"
        "    tell(compiling=True); time.sleep(1.5); tell(compiling=False)\n"
        "    time.sleep(float(sys.argv[1]))\n"
    )
    # -P keeps the current folder off the path of the worker; only an installed name or PYTHONPATH is found.
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
        limits = LimitSection(step=1.0)
        assert supervise("compiles", ["0"], tmp_path / "log.txt", limits, lambda message: None) == ""
        said = supervise("compiles", ["30"], tmp_path / "log.txt", limits, lambda message: None)
    assert "took no step for 1 s (limits.step)" in said


def test_a_worker_tells_of_compiling(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plugin = tmp_path / "compiles.py"
    plugin.write_text(
        "import numba\n"
        "from hsslam.matching import Estimate, Matcher\n"
        "class Compiles(Matcher):\n"
        "    def estimate(self, reference, points, guess, window, rng):\n"
        "        return Estimate(numba.njit(lambda pose: pose)(guess))\n"
    )
    monkeypatch.setenv(plugin_files.VARIABLE, "")
    plugin_files.use(plugin)
    of = {"count": 1, "warm_up": 0, "resamples": 100}
    job = Job.model_validate(
        {"kind": "trials", "dataset": DATASET, "matcher": {"name": "compiles"}, "trials": of}
    )
    (tmp_path / JOB_FILE).write_text(job.model_dump_json())
    reading, writing = os.pipe()
    command = [sys.executable, "-m", "hsslam_eval.worker", str(tmp_path), str(writing)]
    with os.fdopen(reading) as told:
        subprocess.run(command, pass_fds=[writing], check=True, capture_output=True)
        os.close(writing)
        said = [message["compiling"] for line in told if "compiling" in (message := json.loads(line))]
    assert said and said == [True, False] * (len(said) // 2)


def test_limits_may_change_but_not_the_plugin(tmp_path: Path, nasty_plugin: Path) -> None:
    Workspace.prepare(tmp_path, config("nasty_good"), DATASET)
    Workspace.prepare(tmp_path, config("nasty_good", limits={"step": 9}), DATASET)
    nasty_plugin.write_text(PLUGIN + "# another one\n")
    with pytest.raises(ConfigError, match=r"holds another comparison \(plugins.nasty.py was"):
        Workspace.prepare(tmp_path, config("nasty_good"), DATASET)


def test_ctrl_c_ends_a_worker_that_hangs(tmp_path: Path) -> None:
    def press(stage: str, matcher: str, done: int, total: int) -> None:
        if any("going to bed" in log.read_text() for log in tmp_path.glob("jobs/*/log.txt")):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compare(config("nasty_spins", run_slam=False), DATASET, tmp_path, press)
    mine = [
        entry for entry in Path("/proc").glob("[0-9]*/cmdline") if str(tmp_path).encode() in _reads(entry)
    ]
    assert mine == []
