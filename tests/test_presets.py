"""Presets, the commented config of `hsslam init`, and where `preset` may stand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner, Result

from hsslam import presets
from hsslam.cli.config import config_schema
from hsslam.cli.main import app
from hsslam.config import Config, dump, load_config
from hsslam.config_template import commented
from hsslam.errors import ConfigError
from hsslam_eval.compare_config import CompareConfig

SENSORS = ["hokuyo-utm30lx", "rplidar-a2", "sick-lms200", "urg-04lx"]
PLACES = ["corridor", "office", "warehouse"]


def hsslam(*args: str | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def test_names() -> None:
    assert presets.names("sensor") == SENSORS
    assert presets.names("place") == PLACES
    assert presets.names() == SENSORS + PLACES


@pytest.mark.parametrize("name", SENSORS + PLACES)
def test_every_preset_is_valid_changes_only_defaults_and_says_why(name: str) -> None:
    preset = presets.load(name)
    assert preset.summary and preset.text.count("#") >= 2
    changed, default = load_config(presets=[name]).model_dump(), Config().model_dump()
    told = presets.settings(name)
    assert (changed != default) == bool(told)

    def check(given: dict[str, object], before: dict[str, object]) -> None:
        for key, value in given.items():
            if isinstance(value, dict):
                check(value, before[key])  # type: ignore[arg-type]
            else:
                assert value != before[key], f"{name} sets {key} to what it is anyway"

    check(told, default)


def test_presets_lie_under_the_file_and_over_the_base(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text("preset: warehouse\nkeyframes: {distance: 0.3}\n")
    config = load_config(path)
    assert (config.keyframes.distance, config.loops.radius) == (0.3, 6.0)
    assert config.loops.window == Config().loops.window
    window = load_config(presets=["corridor"]).tracker.window
    assert window.half_theta_deg == Config().tracker.window.half_theta_deg
    assert load_config(path, base={"loops": {"radius": 1.0}}).loops.radius == 6.0
    assert load_config(path, ["loops.radius=4"]).loops.radius == 4.0


def test_a_later_preset_wins_and_an_option_stands_in_for_the_files(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text("preset: [corridor, rplidar-a2, warehouse]\n")
    assert load_config(path).loops.radius == 6.0
    assert load_config(path).keyframes.distance == 0.2
    path.write_text("preset: [warehouse, corridor]\n")
    assert load_config(path).tracker.window.half_x == 0.05
    assert load_config(path, presets=["office"]) == Config()


def test_a_preset_may_stand_wherever_settings_are_validated() -> None:
    assert load_config(overrides=["preset=corridor"]).tracker.window.half_x == 0.05
    compared = CompareConfig.model_validate({"matchers": ["hide"], "slam": {"preset": "corridor"}})
    assert compared.slam.tracker.window.half_x == 0.05
    assert "preset" not in yaml.safe_load(dump(load_config(presets=["corridor"])))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("preset: ofice", r"no preset is named 'ofice'; did you mean 'office'\? \(there are: hokuyo-utm30lx"),
        ("preset: {name: office}", "preset: expected a name or a list of names, found {'name': 'office'}"),
        ("preset: [1]", "expected a name or a list of names"),
    ],
)
def test_a_bad_preset_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(ConfigError, match=said):
        load_config(tmp_path / "c.yaml")


@pytest.mark.parametrize("matcher", ["hide", "icp", "exhaustive"])
@pytest.mark.parametrize("names", [[], ["corridor", "rplidar-a2"]])
def test_the_commented_config_reads_back_as_the_config(
    tmp_path: Path, matcher: str, names: list[str]
) -> None:
    config = load_config(overrides=[f"matcher={matcher}", "loop_matcher=hsl"], presets=names)
    (tmp_path / "c.yaml").write_text(commented(config, names))
    assert load_config(tmp_path / "c.yaml").model_dump() == config.model_dump()


def test_every_setting_has_a_comment_over_it() -> None:
    lines = commented(Config()).splitlines()
    settings = [k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
    assert len(settings) > 60
    bare = [
        lines[k] for k in settings if not lines[k - 1].lstrip().startswith("#") and "name:" not in lines[k]
    ]
    assert bare == []
    assert max(map(len, lines)) <= 110


def test_init_writes_a_file_that_runs_use_and_never_overwrites(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = hsslam("init")
    assert result.exit_code == 0 and "hsslam run DATASET --config hsslam.yaml" in result.output
    assert load_config("hsslam.yaml").model_dump() == Config().model_dump()
    Path("hsslam.yaml").write_text("mine")
    refused = hsslam("init")
    assert refused.exit_code == 3 and "is there already and is not overwritten" in refused.stderr
    assert Path("hsslam.yaml").read_text() == "mine"
    result = hsslam(
        "init", "sub/c.yaml", "--preset", "corridor", "--matcher", "hsl", "--set", "matcher.memory_size=40"
    )
    assert result.exit_code == 0, result.output
    text = Path("sub/c.yaml").read_text()
    assert "With the preset corridor:" in text
    assert (
        "    # half side of the search window along x (m); 0.2 without the preset\n    half_x: 0.05\n" in text
    )
    assert load_config("sub/c.yaml").matcher.model_dump()["memory_size"] == 40


def test_config_show_and_presets() -> None:
    shown = hsslam("config", "show", "--preset", "warehouse", "--preset", "rplidar-a2")
    assert yaml.safe_load(shown.stdout)["keyframes"]["distance"] == 0.2
    listed = hsslam("config", "presets")
    assert all(name in listed.stdout for name in SENSORS + PLACES)
    assert [
        row["name"] for row in json.loads(hsslam("config", "presets", "--json").stdout)
    ] == SENSORS + PLACES
    assert "half_x: 0.05" in hsslam("config", "presets", "corridor").stdout
    assert config_schema()["properties"]["preset"]["anyOf"][0]["enum"] == SENSORS + PLACES


def test_a_resumed_run_is_not_given_another_preset(tmp_path: Path) -> None:
    run = ("run", "corridor", "--scans", "5", "--quiet", "--preset", "corridor")
    assert hsslam(*run, "--out", tmp_path / "r").exit_code == 0
    assert load_config(tmp_path / "r" / "config.yaml").tracker.window.half_x == 0.05
    assert hsslam("run", "--resume", tmp_path / "r", "--quiet").exit_code == 0
    other = hsslam("run", "--resume", tmp_path / "r", "--preset", "warehouse")
    assert other.exit_code == 2 and "config.loops.radius was 3.0, now 6.0" in other.stderr


def test_a_presets_reasons_are_wrapped_as_paragraphs() -> None:
    text = commented(load_config(presets=["rplidar-a2"]), ["rplidar-a2"])
    assert "the error falls\n# from 9.0 to 4.2 cm in the hall" in text
