"""A mistake in a file of settings is named by file and line; one made elsewhere is not blamed on the file."""

from __future__ import annotations

from pathlib import Path

import pytest

from hsslam.cli.compare import resolve as resolve_comparison
from hsslam.cli.sweep import read as read_sweep
from hsslam.config import load_config
from hsslam.errors import ConfigError


def complaint(path: Path, overrides: tuple[str, ...] = ()) -> str:
    with pytest.raises(ConfigError) as caught:
        load_config(path, overrides)
    text = str(caught.value)
    assert "\n" not in text
    return text.replace(f"{path.parent}/", "")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seed: 1\n\nkeyframes:\n  distance: -3\n", "s.yaml:4: keyframes.distance: input should be greater"),
        ("seed: 1\nkeyframes: 3\n", "s.yaml:2: keyframes: input should be a valid dictionary"),
        ("keyframes: {distance: 1, dist: 3}\n", "s.yaml:1: keyframes.dist: unknown setting"),
        ("matcher:\n  name: hide\n  memorysize: 4\n", "s.yaml:3: hide.memorysize: unknown setting; did you"),
        ("matcher: hide\nloop_matcher:\n  name: hsl\n  memory_size: x\n", "s.yaml:4: hsl.memory_size: input"),
        ("seed: 1\nmatcher: hidee\n", "s.yaml:2: no matcher is named 'hidee'; did you mean 'hide'?"),
        ("seed: 1\npreset: ofice\n", "s.yaml:2: no preset is named 'ofice'; did you mean 'office'?"),
        ("preset: [corridor,\n  ofice]\n", "s.yaml:2: no preset is named 'ofice'"),
        ("preset: 3\n", "s.yaml:1: preset: expected a name or a list of names, found 3"),
        ("seed: 1\nkeyframes: {distance: 1}\nseed: 2\n", "s.yaml:3: seed is given twice, first in line 1"),
        ("loops:\n  radius: 1\n  radius: 2\n", "s.yaml:3: radius is given twice, first in line 2"),
        (
            "matcher:\n\tname: hide\n",
            "s.yaml:2: not YAML: found character '\\t' that cannot start any token; i",
        ),
        ("- seed\n", "s.yaml:1: expected settings (key: value), found list"),
    ],
)
def test_a_mistake_is_named_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(text)
    assert complaint(path).startswith(said)


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"PK\x03\x04\x00\x00", b"seed: \x07\n"])
def test_a_file_that_is_no_text_is_refused_in_a_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "s.yaml"
    path.write_bytes(content)
    assert complaint(path) == "s.yaml: expected settings in YAML, found a file that is no text"


def test_what_an_option_got_wrong_is_not_blamed_on_the_file(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("matcher:\n  name: hide\n  memory_size: 20\nkeyframes:\n  distance: 0.3\n")
    assert complaint(path, ("keyframes.distance=-1",)).startswith("keyframes.distance: input should be")
    assert complaint(path, ("matcher.memory_size=0",)).startswith("hide.memory_size: input should be")
    assert complaint(path, ("matcher.memory=0",)).startswith("hide.memory: unknown setting")


def test_comparisons_and_sweeps_name_the_line_too(tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text("datasets: [office]\nmatchers:\n  - hide\n  - {name: hsl, memory: 2}\n")
    with pytest.raises(ConfigError, match=r"s\.yaml:4: hsl\.memory: unknown setting"):
        read_sweep(path)
    path.write_text("matchers: [hide]\ntrials:\n  cuont: 3\n")
    with pytest.raises(ConfigError, match=r"s\.yaml:3: trials\.cuont: unknown setting; did you mean 'count'"):
        resolve_comparison(path, (), {}, ())
    path.write_text("matchers: [hide]\n")
    with pytest.raises(ConfigError, match=r"s\.yaml: datasets: field required"):
        read_sweep(path)
