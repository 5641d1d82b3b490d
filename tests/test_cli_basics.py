"""The command's manners: errors in one line, exit codes, settings, instant help."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner, Result

from hsslam.cli.config import config_schema
from hsslam.cli.main import app
from hsslam.cli.matchers import parameters
from hsslam.version import __version__


def hsslam(*args: str | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def shown(*args: str | Path) -> dict[str, object]:
    result = hsslam("config", "show", *args)
    assert result.exit_code == 0, result.stderr
    loaded = yaml.safe_load(result.stdout)
    assert isinstance(loaded, dict)
    return loaded


def test_the_package_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "hsslam", "--version"], capture_output=True, text=True, check=True
    )
    assert __version__ in done.stdout


def test_start_up_imports_nothing_heavy() -> None:
    code = (
        "import sys, hsslam.cli.main\n"
        "heavy = {'numpy', 'numba', 'gtsam', 'matplotlib', 'scipy', 'open3d', 'kiss_icp', 'pydantic', 'yaml',"
        " 'pooch', 'jinja2'}\n"
        "print(*sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_help_lists_every_verb() -> None:
    result = hsslam("--help")
    assert result.exit_code == 0
    for verb in ("run", "compare", "match", "eval", "matchers", "datasets", "config"):
        assert f"\n  {verb} " in result.stdout


@pytest.mark.parametrize("group", [(), ("config",), ("datasets",), ("matchers",), ("plugin",)])
def test_no_verb_is_described_by_half_a_sentence(
    group: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    shown = hsslam(*group, "--help").stdout
    assert "Commands:" in shown
    assert [line for line in shown.splitlines()[1:] if line.endswith("...")] == []


def test_version() -> None:
    assert hsslam("--version").stdout.strip() == f"hsslam {__version__}"


@pytest.mark.parametrize(
    ("args", "code", "said"),
    [
        (["config", "show", "--set", "matcher.memory_sze=4"], 2, "did you mean 'memory_size'?"),
        (["config", "show", "--set", "trakcer.min_score=0.4"], 2, "did you mean 'tracker'?"),
        (
            ["config", "show", "--set", "tracker.min_score=4"],
            2,
            "tracker.min_score: input should be less than",
        ),
        (["config", "show", "--set", "seed"], 2, "--set takes key=value"),
        (["config", "show", "--matcher", "hid"], 2, "did you mean 'hide'?"),
        (["config", "show", "--config", "nowhere.yaml"], 2, "nowhere.yaml: cannot be read"),
        (["config", "validate", "nowhere.yaml"], 2, "nowhere.yaml: cannot be read"),
        (["matchers", "describe", "hid"], 2, "did you mean 'hide'?"),
        (["datasets", "info", "nowhere.clf"], 3, "nowhere.clf: no such file"),
        (["datasets", "fetch", "office"], 3, "simulated"),
        (["datasets", "simulate", "office", "--out", "log.txt"], 3, "expected a name that ends in"),
        (["run"], 2, "say what to run on"),
        (["run", "nowhere.clf"], 3, "nowhere.clf: no such file"),
        (["run", "office", "--resume", "a", "--out", "b"], 2, "leave out --out"),
        (["run", "--resume", "nowhere"], 3, "no run to resume"),
        (["run", "office", "--on-error", "panic"], 2, "--on-error is stop or skip"),
        (["match", "office", "1"], 2, "two scans' numbers"),
        (["match", "office", "1", "two"], 2, "two scans' numbers"),
        (["match", "office", "1", "2", "--guess", "1,2"], 2, "--guess: expected x,y,degrees"),
        (["match", "office", "1", "2", "--window", "0,1,2"], 2, "three positive numbers"),
        (["match", "office", "1", "2000"], 3, "there is no scan 2000"),
        (["eval", "nowhere.tum", "--dataset", "office"], 3, "nowhere.tum"),
        (["compare", "office", "--dataset", "hall"], 2, "named twice"),
        (
            ["compare", "office", "hall", "--datasets", "corridor"],
            2,
            "named twice: office hall and --datasets",
        ),
        (["compare", "office", "nowhere.clf"], 3, "nowhere.clf: no such file"),
        (["compare", "--matchers", "hsl", "hid", "--no-slam"], 2, "did you mean 'hide'?"),
        (["compare", "--matchers", "hide", "--set", "matcher.memory_size=9"], 2, "hide.memory_size=9"),
        (["compare", "--matchers", "hide", "--set", "trials.cuont=9"], 2, "did you mean 'count'?"),
        (["compare", "--matchers", "hide", "--protocol", "magic"], 2, "protocol"),
    ],
)
def test_what_the_user_can_mend_is_one_line_and_an_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, args: list[str], code: int, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = hsslam(*args)
    assert result.exit_code == code
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("hsslam: error: ")
    assert said in line
    assert list(tmp_path.iterdir()) == []


def test_a_bug_keeps_its_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> dict[str, object]:
        raise ZeroDivisionError

    monkeypatch.setattr("hsslam.cli.config.config_schema", broken)
    assert isinstance(hsslam("config", "schema").exception, ZeroDivisionError)


def test_ctrl_c_is_one_line_and_130(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted() -> dict[str, object]:
        raise KeyboardInterrupt

    monkeypatch.setattr("hsslam.cli.config.config_schema", interrupted)
    result = hsslam("config", "schema")
    assert result.exit_code == 130
    assert result.stderr.strip() == "hsslam: interrupted"


def test_the_command_line_wins_over_the_file(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text("matcher: {name: hide, memory_size: 40}\nseed: 4\n")
    assert shown("--config", file)["matcher"]["memory_size"] == 40  # type: ignore[index]
    same = shown("--config", file, "--matcher", "hide", "--seed", "5")
    assert same["matcher"]["memory_size"] == 40  # type: ignore[index]
    assert same["seed"] == 5
    other = shown("--config", file, "--matcher", "hsl", "--set", "matcher.memory_size=12")
    assert other["matcher"]["name"] == "hsl"  # type: ignore[index]
    assert other["matcher"]["memory_size"] == 12  # type: ignore[index]
    assert shown("--config", file, "--matcher", "hsl")["matcher"]["memory_size"] == 30  # type: ignore[index]


def test_set_alone_means_the_default_matcher_and_loops_follow_the_tracker() -> None:
    assert shown("--set", "matcher.memory_size=40")["matcher"]["name"] == "hide"  # type: ignore[index]
    loops = shown("--matcher", "hsl", "--set", "loop_matcher.memory_size=40")["loop_matcher"]
    assert (loops["name"], loops["memory_size"]) == ("hsl", 40)  # type: ignore[index]
    assert shown("--loop-matcher", "glasm")["loop_matcher"]["name"] == "glasm"  # type: ignore[index]


def test_what_show_prints_is_valid(tmp_path: Path) -> None:
    file = tmp_path / "f.yaml"
    file.write_text(hsslam("config", "show", "--matcher", "glasm").stdout)
    assert hsslam("config", "validate", file).stdout.strip() == f"{file}: valid"


def test_schema_knows_every_matcher_and_its_parameters() -> None:
    schema = config_schema()
    assert json.loads(hsslam("config", "schema").stdout) == schema
    variants = schema["$defs"]["MatcherSection"]["anyOf"]
    hide = next(v for v in variants if v.get("properties", {}).get("name") == {"const": "hide"})
    assert hide["properties"]["memory_size"]["default"] == 30
    assert "hide" in variants[0]["enum"]


def test_matchers_are_listed_and_described() -> None:
    listed = json.loads(hsslam("matchers", "list", "--json").stdout)
    assert {"hsl", "hide", "glasm", "icp", "kiss_icp"} <= {matcher["name"] for matcher in listed}
    assert hsslam("matchers").stdout == hsslam("matchers", "list").stdout
    described = hsslam("matchers", "describe", "hide").stdout
    (row,) = [line for line in described.splitlines() if line.startswith("memory_size ")]
    assert row.split()[:4] == ["memory_size", "int", "30", "[4,"]


def test_an_unavailable_matcher_says_why_and_what_mends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from hsslam.matching import registry
    from hsslam.matching.registry import MatcherInfo

    broken = MatcherInfo("icp", "hsslam", False, "", "No module named 'open3d'", "pip install 'hsslam[icp]'")
    monkeypatch.setattr(registry, "names", lambda: ["icp"])
    monkeypatch.setattr(registry, "describe", lambda name: broken)
    said = hsslam("matchers").stdout
    assert "unavailable: No module named 'open3d'" in said
    assert "pip install 'hsslam[icp]'" in said


def test_parameters_of_a_schema_are_flattened() -> None:
    schema = {
        "properties": {
            "a": {
                "type": "number",
                "default": 1.5,
                "exclusiveMinimum": 0,
                "maximum": 2,
                "description": "of a",
            },
            "b": {"anyOf": [{"type": "integer", "minimum": 1}, {"type": "null"}], "default": None},
            "c": {"enum": ["x", "y"], "default": "x"},
            "inner": {"$ref": "#/$defs/Inner"},
        },
        "$defs": {"Inner": {"properties": {"d": {"type": "boolean"}}}},
    }
    assert list(parameters(schema)) == [
        ("a", "float", "1.5", "(0, 2]", "of a"),
        ("b", "int | null", "none", "[1, inf)", ""),
        ("c", "x | y", "x", "", ""),
        ("inner.d", "bool", "required", "", ""),
    ]
