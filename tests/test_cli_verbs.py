"""`hsslam match`, `datasets` and `compare`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from hsslam.cli.compare import resolve
from hsslam.cli.main import app
from hsslam.datasets.catalogue import open_dataset
from hsslam.io.tum import read_tum
from hsslam.matching import registry
from hsslam.se2 import between, inverse, pose, transform


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def hsslam(*args: str | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def test_match_of_two_scans_finds_the_true_pose_and_draws_it() -> None:
    result = hsslam("match", "office", "100", "104", "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    truth = open_dataset("office").truth()
    assert truth is not None
    error = between(between(truth.poses[100], truth.poses[104]), np.array(found["pose"]))
    assert np.hypot(error[0], error[1]) < 0.05
    assert abs(error[2]) < np.radians(1.0)
    assert np.linalg.eigvalsh(np.array(found["covariance"]))[0] > 0.0
    assert 0.0 < found["score"] <= 1.0
    assert found["evaluations"] > 0
    assert Path("match.png").read_bytes().startswith(b"\x89PNG")


def test_a_picture_does_not_replace_another() -> None:
    Path("match.png").write_text("precious")
    result = hsslam("match", "office", "10", "11", "--matcher", "hsl")
    assert result.exit_code == 0, result.output
    assert "match-2.png" in result.stdout
    assert Path("match.png").read_text() == "precious"
    assert Path("match-2.png").exists()


def test_match_of_two_files_from_a_guess() -> None:
    rng = np.random.default_rng(0)
    wall = np.linspace(0.0, 4.0, 80)
    room = np.concatenate(
        (np.column_stack((wall, 0.3 * np.sin(3.0 * wall))), np.column_stack((0.0 * wall, wall)))
    )
    true = pose(1.0, -0.5, 0.1)
    moved = transform(inverse(true), room)
    np.savetxt("a.csv", room, delimiter=",")
    np.save("b.npy", moved + rng.normal(0.0, 0.001, moved.shape))
    result = hsslam("match", "a.csv", "b.npy", "--guess", "1.1,-0.6,9", "--json", "--picture", "p.png")
    assert result.exit_code == 0, result.output
    np.testing.assert_allclose(json.loads(result.stdout)["pose"], true, atol=0.02)
    assert Path("p.png").exists()


def test_datasets_are_listed_with_what_fetches_them() -> None:
    rows = json.loads(hsslam("datasets", "list", "--data-dir", "nowhere", "--json").stdout)
    assert {row["name"]: row["where"] for row in rows} == {
        "office": "built in",
        "corridor": "built in",
        "hall": "built in",
        "intel": "hsslam datasets fetch intel",
        "mit-csail": "hsslam datasets fetch mit-csail",
    }
    listed = hsslam("datasets", "list", "--data-dir", "nowhere").stdout
    assert "data folder: nowhere" in listed


@pytest.mark.parametrize("suffix", ["clf", "clf.gz", "log.bz2"])
def test_a_simulated_log_reads_back_with_its_truth(suffix: str) -> None:
    assert hsslam("datasets", "simulate", "corridor", "--scans", "30", "--out", f"c.{suffix}").exit_code == 0
    truth = open_dataset("corridor", scans=30).truth()
    assert truth is not None
    np.testing.assert_allclose(read_tum("c.truth.tum").poses, truth.poses, atol=1e-8)
    found = json.loads(hsslam("datasets", "info", f"c.{suffix}", "--json").stdout)
    assert found["scan_count"] == 30
    assert found["beams"] == {"180": 30}
    assert found["truth"]


def test_the_laser_of_a_simulation_can_be_chosen() -> None:
    made = hsslam("datasets", "simulate", "hall", "--scans", "3", "--laser", "urg-04lx", "--out", "h.clf")
    assert made.exit_code == 0
    (beams,) = json.loads(hsslam("datasets", "info", "h.clf", "--json").stdout)["beams"]
    assert int(beams) > 400
    wrong = hsslam("datasets", "simulate", "hall", "--laser", "hokuyo", "--out", "i.clf")
    assert wrong.exit_code == 2
    assert "urg-04lx" in wrong.stderr
    assert not Path("i.clf").exists()


def test_fetch_passes_progress_and_prints_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    from hsslam.datasets import fetch as module

    asked: list[object] = []

    def fake(name: str, data_dir: Path | None, progress: module.Progress) -> str:
        asked.append((name, data_dir))
        progress("intel.clf.bz2", 5, 10)
        progress("intel.clf.bz2", 10, 10)
        progress("intel.relations", 3, 0)
        return "checked: 13,631 scans"

    monkeypatch.setattr(module, "fetch", fake)
    result = hsslam("datasets", "fetch", "intel", "--data-dir", "here")
    assert result.exit_code == 0, result.output
    assert asked == [("intel", Path("here"))]
    assert result.stdout.strip() == "checked: 13,631 scans"


def test_compare_takes_names_in_a_row_and_leaves_a_report() -> None:
    result = hsslam(
        "compare",
        "--matchers",
        "hsl",
        "hide",
        "--trials",
        "8",
        "--no-slam",
        "--dataset",
        "hall",
        "--out",
        "c",
    )
    assert result.exit_code == 0, result.output
    assert "report: c/report.html" in result.stdout
    rows = [line.split()[:2] for line in result.stdout.splitlines()]
    assert ["hsl", "8"] in rows
    assert ["hide", "8"] in rows
    assert Path("c/report.html").exists()
    again = hsslam("compare", "hall", "--matchers", "hsl,hide", "--trials", "9", "--no-slam", "--out", "c")
    assert again.exit_code == 2
    assert "trials.count" in again.stderr


def test_settings_of_a_comparison() -> None:
    Path("c.yaml").write_text(
        "matchers: [hsl, {name: hide, label: small, memory_size: 12}]\n"
        "trials: {count: 7}\n"
        "slam: {map: {resolution: 0.1}}\n"
    )
    config = resolve(
        Path("c.yaml"), [], {"seed": 5}, ["small.evaluations=50", "trials.half_xy=0.1", "seed=6"]
    )
    assert config.seed == 6
    assert [contestant.label for contestant in config.contestants] == ["hsl", "small"]
    assert config.contestants[1].parameters["memory_size"] == 12
    assert config.contestants[1].parameters["evaluations"] == 50
    assert (config.trials.count, config.trials.half_xy) == (7, 0.1)
    assert config.slam.map.resolution == 0.1
    only = resolve(Path("c.yaml"), ["small", "glasm"], {}, ["tracker.min_score=0.4"])
    assert [contestant.name for contestant in only.contestants] == ["hide", "glasm"]
    assert only.slam.tracker.min_score == 0.4


def test_the_five_take_part_unless_others_or_all_are_named() -> None:
    five = ["hsl", "hide", "glasm", "icp", "kiss_icp"]
    assert [c.name for c in resolve(None, [], {}, []).contestants] == five
    assert [c.name for c in resolve(None, ["all"], {}, []).contestants] == registry.names()
