"""Settings: overrides, files, suggestions, round trips."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from hsslam.config import Config, MatcherSection, apply_override, dump, load_config, merge
from hsslam.errors import ConfigError
from hsslam.matching import names


def write(folder: Path, text: str) -> Path:
    path = folder / "settings.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_defaults_need_no_file() -> None:
    assert load_config() == Config()
    assert load_config().matcher.name == "hide"


@pytest.mark.parametrize("name", ["glasm", "hide", "hsl", "icp", "kiss_icp"])
def test_one_line_of_yaml_swaps_the_matcher(tmp_path: Path, name: str) -> None:
    config = load_config(write(tmp_path, f"matcher: {name}\n"))
    assert config.matcher.name == name
    assert type(config.matcher.parameters).__name__.lower() == f"{name.replace('_', '')}config"


def test_every_matcher_installed_here_is_taken() -> None:
    for name in names():
        assert MatcherSection(name=name).parameters is not None


def test_parameters_stand_beside_the_name(tmp_path: Path) -> None:
    config = load_config(write(tmp_path, "matcher: {name: hsl, memory_size: 40}\n"))
    assert config.matcher.parameters.memory_size == 40
    assert config.matcher.create().config.memory_size == 40


@pytest.mark.parametrize(
    ("overrides", "path", "value"),
    [
        (["seed=7"], "seed", 7),
        (["keyframes.distance=0.5"], "keyframes.distance", 0.5),
        (["tracker.window.half_x=0.3"], "tracker.window.half_x", 0.3),
        (["loops.enabled=false"], "loops.enabled", False),
        (["graph.robust=gnc"], "graph.robust", "gnc"),
        (["matcher=hsl"], "matcher.name", "hsl"),
        (["matcher.memory_size=40"], "matcher.parameters.memory_size", 40),
        (["matcher=hsl", "matcher.memory_size=41"], "matcher.parameters.memory_size", 41),
        (["matcher.name=glasm", "matcher.bits=10"], "matcher.parameters.bits", 10),
        (["seed=1", "seed=2"], "seed", 2),
        (["loop_matcher=glasm"], "loop_matcher.name", "glasm"),
        (["loop_matcher.memory_size=50"], "loop_matcher.parameters.memory_size", 50),
        (["loop_matcher=null"], "loop_matcher", None),
    ],
)
def test_set_reaches_every_setting(overrides: list[str], path: str, value: object) -> None:
    found: object = load_config(overrides=overrides)
    for part in path.split("."):
        found = getattr(found, part)
    assert found == value


def test_set_wins_over_chosen_over_file_over_base(tmp_path: Path) -> None:
    path = write(tmp_path, "seed: 2\nkeyframes: {distance: 0.2, angle_deg: 2.0}\n")
    base = {"seed": 1, "keyframes": {"distance": 0.1, "angle_deg": 1.0, "submap_size": 1}}
    chosen = {"keyframes": {"distance": 0.3}}
    config = load_config(path, ["keyframes.distance=0.4"], base=base, chosen=chosen)
    assert (config.seed, config.keyframes.distance, config.keyframes.angle_deg) == (2, 0.4, 2.0)
    assert config.keyframes.submap_size == 1
    assert load_config(path, base=base, chosen=chosen).keyframes.distance == 0.3


def test_a_section_given_in_part_keeps_its_own_defaults(tmp_path: Path) -> None:
    path = write(tmp_path, "tracker: {window: {half_x: 0.3}}\nloops: {window: {half_x: 0.9}}\n")
    config, default = load_config(path), Config()
    assert config.tracker.window == default.tracker.window.model_copy(update={"half_x": 0.3})
    assert config.loops.window == default.loops.window.model_copy(update={"half_x": 0.9})
    assert config.tracker.min_score == default.tracker.min_score


def test_another_matcher_starts_from_its_own_defaults(tmp_path: Path) -> None:
    path = write(tmp_path, "matcher: {name: hsl, improvisations: 300}\n")
    assert load_config(path, chosen={"matcher": "glasm"}).matcher.name == "glasm"
    kept = load_config(path, chosen={"matcher": "hsl"}).matcher.parameters
    assert kept.improvisations == 300


def test_reading_changes_none_of_its_arguments() -> None:
    base = {"keyframes": {"distance": 0.1}}
    chosen = {"matcher": {"name": "hsl"}}
    load_config(overrides=["keyframes.distance=0.9", "matcher.memory_size=40"], base=base, chosen=chosen)
    assert base == {"keyframes": {"distance": 0.1}}
    assert chosen == {"matcher": {"name": "hsl"}}


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("sed=3", "sed: unknown setting; did you mean 'seed'?"),
        ("keyframes.distanse=1", "keyframes.distanse: unknown setting; did you mean 'distance'?"),
        ("tracker.window.half_z=1", "tracker.window.half_z: unknown setting; did you mean 'half_"),
        ("matcher.memory_sise=40", "memory_sise: unknown setting; did you mean 'memory_size'?"),
        ("matcher=hid", "no matcher is named 'hid'; did you mean 'hide'?"),
        ("keyframes.distance=-1", "keyframes.distance: "),
        ("keyframes.distance=far", "keyframes.distance: "),
        ("keyframes.distance=.nan", "keyframes.distance: "),
        ("graph.robust=hubber", "graph.robust: "),
        ("matcher.memory_size=-3", "memory_size: "),
        ("seed", "--set takes key=value"),
        ("=3", "--set takes key=value"),
        ("keyframes..distance=3", "--set takes key=value"),
        ("seed=[1", "--set seed: not a YAML value"),
        ("seed.deep=1", "seed"),
    ],
)
def test_a_bad_override_is_one_clear_line(override: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=[override])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_setting_below_a_number_has_nowhere_to_go() -> None:
    with pytest.raises(ConfigError, match="seed holds 3"):
        apply_override({"seed": 3}, "seed.deep=1")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("keyframe: {}\n", "keyframe: unknown setting; did you mean 'keyframes'?"),
        ("seed: [1\n", "not YAML"),
        ("- 1\n- 2\n", "expected settings (key: value), found list"),
        ("seed: minus\n", "seed: "),
        ("matcher: {memory_size: 40}\n", "matcher.name: "),
        ("matcher: !!python/object/apply:os.getcwd []\n", "not YAML"),
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(ConfigError) as caught:
        load_config(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)


def test_a_bad_line_is_numbered(tmp_path: Path) -> None:
    path = write(tmp_path, "seed: 1\nkeyframes: {distance: 1\nloops: 3\n")
    with pytest.raises(ConfigError, match=r"settings\.yaml:[23]: not YAML"):
        load_config(path)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nothing\.yaml: cannot be read: No such file"):
        load_config(tmp_path / "nothing.yaml")


def test_an_empty_file_means_the_defaults(tmp_path: Path) -> None:
    assert load_config(write(tmp_path, "# nothing\n")) == Config()


def test_several_mistakes_are_told_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(overrides=["seed=-1", "loops.radius=0"])
    assert "seed: " in str(caught.value)
    assert "loops.radius: " in str(caught.value)


@settings(deadline=None, max_examples=40)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["glasm", "hide", "hsl", "icp", "kiss_icp"]),
    st.none() | st.sampled_from(["hsl", "icp"]),
    st.floats(1e-3, 1e3),
    st.booleans(),
)
def test_the_resolved_yaml_reads_back_as_the_same_config(
    tmp_path_factory, seed, name, loop, distance, on
) -> None:
    config = load_config(
        base={
            "seed": seed,
            "matcher": name,
            "loop_matcher": loop,
            "keyframes": {"distance": distance},
            "loops": {"enabled": on},
        }
    )
    text = dump(config)
    path = write(tmp_path_factory.mktemp("config"), text)
    again = load_config(path)
    assert dump(again) == text
    assert again.model_dump() == config.model_dump()


def test_the_resolved_yaml_holds_every_value_of_the_matcher_too() -> None:
    plain = yaml.safe_load(dump(load_config(overrides=["matcher.memory_size=40"])))
    assert plain["matcher"]["name"] == "hide"
    assert plain["matcher"]["memory_size"] == 40
    assert set(type(Config().matcher.parameters).model_fields) < set(plain["matcher"])
    assert set(plain) == set(Config.model_fields)


def test_every_setting_is_described() -> None:
    def bare(model: type, prefix: str) -> list[str]:
        out = []
        for name, field in model.model_fields.items():
            inner = field.annotation
            if isinstance(inner, type) and hasattr(inner, "model_fields") and inner is not MatcherSection:
                out += bare(inner, f"{prefix}{name}.")
            elif not field.description:
                out.append(prefix + name)
        return out

    assert bare(Config, "") == []


def test_a_config_does_not_change_after_validation() -> None:
    config = Config()
    with pytest.raises(ValidationError):
        config.seed = 3


def test_merge_is_deep_and_keeps_its_arguments() -> None:
    under = {"a": {"b": 1, "c": 2}, "d": 3}
    assert merge(under, {"a": {"b": 9}, "e": 4}) == {"a": {"b": 9, "c": 2}, "d": 3, "e": 4}
    assert under == {"a": {"b": 1, "c": 2}, "d": 3}
