"""`hsslam run --live`: a map is shown while it grows, and the run is the same whatever becomes of the viewer."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from typer.testing import CliRunner, Result

from hsslam import Config, LaserScan, ScanGeometry, Slam
from hsslam.cli.main import app
from hsslam.live import LiveMap
from hsslam.live.growth import Growth
from hsslam.live.matplotlib_window import MapDrawing
from hsslam.live.snapshot import Snapshot, placed
from hsslam.se2 import transform
from hsslam.slam.events import KeyframeAdded, LoopChecked, Optimised, Tracked

RUN = ("run", "office", "--matcher", "hide", "--scans", "60", "--quiet")
DIFFERENT = {"timings.json", "environment.json", "live.rrd"}

BACKEND = """
import os, time
from matplotlib import pyplot
from matplotlib.backend_bases import FigureManagerBase
from matplotlib.backends.backend_agg import FigureCanvasAgg

WAY = os.environ["WAY_OF_THE_WINDOW"]

class FigureCanvas(FigureCanvasAgg):
    required_interactive_framework = "headless"

    def start_event_loop(self, timeout=0):
        if self.figure.axes[0].get_title(loc="right").startswith("finished"):
            self.figure.savefig(os.environ["PICTURE"] + ".part", format="png")
            os.replace(os.environ["PICTURE"] + ".part", os.environ["PICTURE"])
            pyplot.close(self.figure)
        time.sleep(0.01)

class FigureManager(FigureManagerBase):
    @classmethod
    def pyplot_show(cls, *, block=None):
        if WAY == "closed":
            pyplot.close()
        elif WAY == "raises":
            raise RuntimeError("the toolkit has had enough\\nand more")
        elif WAY == "dies":
            os.abort()
        elif WAY == "hangs":
            time.sleep(60.0)

FigureCanvas.manager_class = FigureManager
"""


def hsslam(*args: str | int | Path) -> Result:
    return CliRunner().invoke(app, [str(arg) for arg in args])


def results(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name not in DIFFERENT}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What the run leaves without a viewer."""
    out = tmp_path_factory.mktemp("plain") / "run"
    assert hsslam(*RUN, "--out", out).exit_code == 0
    return results(out)


@pytest.fixture(autouse=True)
def headless(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A toolkit that needs no display, and whose window does what the environment says."""
    (tmp_path / "window_backend.py").write_text(BACKEND)
    path = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, path)))
    monkeypatch.setenv("MPLBACKEND", "module://window_backend")
    monkeypatch.setenv("PICTURE", str(tmp_path / "window.png"))
    monkeypatch.setenv("WAY_OF_THE_WINDOW", "stays")
    return monkeypatch


def test_without_a_display_a_run_says_so_in_a_line_and_is_the_same(
    tmp_path: Path, plain: dict[str, bytes]
) -> None:
    result = hsslam(*RUN, "--live", "--viewer", "matplotlib", "--out", tmp_path / "run")
    assert result.exit_code == 0, result.output
    assert result.stderr == "hsslam: live map: no display, so no window; the run goes on without it\n"
    assert results(tmp_path / "run") == plain


def test_a_window_shows_the_final_map_and_the_run_is_the_same(
    tmp_path: Path, plain: dict[str, bytes], window: pytest.MonkeyPatch
) -> None:
    result = hsslam(*RUN, "--live", "--viewer", "matplotlib", "--out", tmp_path / "run")
    assert (result.exit_code, result.output) == (0, "")
    assert results(tmp_path / "run") == plain
    deadline = time.monotonic() + 60.0  # the window closes itself a moment after the run has ended
    while time.monotonic() < deadline and not (tmp_path / "window.png").exists():
        time.sleep(0.05)
    assert (tmp_path / "window.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("way", "said"),
    [
        ("closed", "the window was closed"),
        ("raises", "RuntimeError: the toolkit has had enough"),
        ("dies", "the viewer crashed (signal 6)"),
        ("hangs", "the viewer did not answer within 3 s"),
    ],
)
def test_a_window_that_fails_costs_a_line_and_not_the_run(
    tmp_path: Path, plain: dict[str, bytes], window: pytest.MonkeyPatch, way: str, said: str
) -> None:
    window.setenv("WAY_OF_THE_WINDOW", way)
    window.setattr("hsslam.live.feed.PATIENCE", 3.0)
    result = hsslam(*RUN, "--live", "--viewer", "matplotlib", "--out", tmp_path / "run")
    assert result.exit_code == 0, result.output
    assert result.stderr == f"hsslam: live map: {said}; the run goes on without it\n"
    assert results(tmp_path / "run") == plain


def test_a_display_that_is_not_there_costs_a_line(
    tmp_path: Path, plain: dict[str, bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", ":987")
    result = hsslam(*RUN, "--live", "--viewer", "matplotlib", "--out", tmp_path / "run")
    assert result.exit_code == 0, result.output
    (line,) = result.stderr.splitlines()
    assert line.startswith("hsslam: live map: matplotlib can open no window: there is no display :987")
    assert results(tmp_path / "run") == plain


@pytest.fixture
def display(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """An X server without a screen to look at."""
    server = shutil.which("Xvfb")
    if server is None:
        pytest.skip("Xvfb is not installed: no real window is opened")
    pytest.importorskip("tkinter")
    reading, writing = os.pipe()
    process = subprocess.Popen(
        [server, "-displayfd", str(writing), "-nolisten", "tcp"],
        pass_fds=[writing],
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as told:
            name = f":{told.readline().strip()}"
        monkeypatch.setenv("DISPLAY", name)
        yield name
    finally:
        process.terminate()
        process.wait()


def test_a_real_window_opens_and_the_run_is_the_same(
    tmp_path: Path, plain: dict[str, bytes], display: str
) -> None:
    result = hsslam(*RUN, "--live", "--viewer", "matplotlib", "--out", tmp_path / "run")
    assert (result.exit_code, result.output) == (0, "")
    assert results(tmp_path / "run") == plain


def test_without_a_display_rerun_records_and_the_run_is_the_same(
    tmp_path: Path, plain: dict[str, bytes]
) -> None:
    pytest.importorskip("rerun")
    out = tmp_path / "run"
    result = hsslam(*RUN, "--live", "--out", out)
    assert result.exit_code == 0, result.output
    recording = out / "live.rrd"
    assert result.stderr == (
        f"hsslam: live map: no display; recorded instead, to look at later: rerun {recording}\n"
    )
    assert recording.read_bytes().startswith(b"RRF2")
    assert recording.stat().st_size > 20_000
    assert results(out) == plain


def test_a_recording_that_cannot_be_written_costs_a_line(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    said: list[str] = []
    (tmp_path / "file").write_text("")
    slam = Slam(Config())
    with LiveMap(slam, "rerun", recording=tmp_path / "file" / "live.rrd", say=said.append) as live:
        live.update(slam.process(empty_scan()))
        live.update(slam.finish())
    assert "no display; recorded" in said[0]
    assert said[1].endswith("live.rrd: cannot be written: File exists; the run goes on without it")


@pytest.mark.parametrize(
    ("options", "code", "said"),
    [
        (("--live", "--viewer", "gl"), 2, "the viewer is one of auto, rerun, matplotlib, found 'gl'"),
        (("--viewer", "rerun"), 2, "give --live too"),
        (("--live", "--viewer", "rerun"), 4, "mend it with: pip install 'hsslam[live]'"),
    ],
)
def test_a_wrong_wish_is_told_before_a_folder_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], code: int, said: str
) -> None:
    monkeypatch.setattr("hsslam.live.viewers.rerun_installed", lambda: False)
    result = hsslam(*RUN, *options, "--out", tmp_path / "run")
    assert result.exit_code == code
    assert said in result.stderr
    assert not (tmp_path / "run").exists()


def test_without_rerun_and_display_the_line_says_what_would_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hsslam.live.viewers.rerun_installed", lambda: False)
    said: list[str] = []
    with LiveMap(Slam(Config()), recording=tmp_path / "live.rrd", say=said.append):
        pass
    assert said == [
        "live map: no display, so no window; the run goes on without it "
        "(a recording needs pip install 'hsslam[live]')"
    ]


def test_an_error_of_the_run_is_the_run_s(window: pytest.MonkeyPatch) -> None:
    window.setenv("WAY_OF_THE_WINDOW", "closed")
    with (
        pytest.raises(ZeroDivisionError),
        LiveMap(Slam(Config()), "matplotlib", say=lambda line: None) as live,
    ):
        live.update(1 // 0 for _ in range(1))


def empty_scan(index: int = 0) -> LaserScan:
    geometry = ScanGeometry(-np.pi / 2, np.pi / 180, range_max=30.0)
    return LaserScan(float(index), np.full(181, 2.0), geometry, index=index)


def tracked(scan: int, pose: tuple[float, float, float]) -> Tracked:
    return Tracked(scan, 10.0 + scan, np.array(pose), 0, np.zeros(3), np.eye(3), 1.0, True, 1)


def loop(first: int, second: int, accepted: bool) -> LoopChecked:
    return LoopChecked(first, second, accepted, "", np.zeros(3), np.eye(3), 1.0, 1)


def test_a_snapshot_holds_what_happened_where_the_graph_has_it_now() -> None:
    growth = Growth()
    scans = [empty_scan(0), empty_scan(1)]
    growth.add((tracked(0, (0.0, 0.0, 0.0)), KeyframeAdded(0, 0, np.zeros(3))), scans[0])
    growth.add((tracked(1, (1.0, 0.0, 0.5)), KeyframeAdded(1, 1, np.ones(3))), scans[1])
    growth.add((loop(0, 1, True), loop(0, 1, False)))
    growth.add([Optimised("final", 2.0, 1.0)])
    poses = np.array([[0.0, 0.0, 0.0], [5.0, 6.0, 0.7]])
    snapshot = growth.snapshot(poses)
    points = placed(snapshot.points, snapshot.owners, snapshot.poses)
    expected = np.concatenate([transform(p, s.robot_points) for p, s in zip(poses, scans, strict=True)])
    np.testing.assert_allclose(points, expected, atol=1e-5)
    np.testing.assert_array_equal(snapshot.ties, [[[0.0, 0.0], [5.0, 6.0]]])
    np.testing.assert_array_equal(snapshot.trajectory, [[0.0, 0.0], [5.0, 6.0], [1.0, 0.0]])
    assert snapshot.status == "final: scan 2, 2 keyframes, 1 loops accepted"
    assert snapshot.stamp == 1.0
    assert len(snapshot.scan_points) == 181
    final = growth.snapshot(poses, final=True)
    assert (final.final, len(final.scan_points), tuple(final.scan_pose)) == (True, 0, (5.0, 6.0, 0.7))


def test_what_is_remembered_is_bounded_and_no_keyframe_is_forgotten() -> None:
    growth = Growth(most_points=2000)
    for number in range(200):
        scan = empty_scan(number)
        growth.add((tracked(number, (0.0, 0.0, 0.0)), KeyframeAdded(number, number, np.zeros(3))), scan)
    snapshot = growth.snapshot(np.zeros((200, 3)))
    assert 500 < len(snapshot.points) <= 2000
    assert len(snapshot.points) == len(snapshot.owners)
    np.testing.assert_array_equal(np.unique(snapshot.owners), np.arange(200))
    np.testing.assert_allclose(np.hypot(*snapshot.points.T), 2.0, rtol=1e-5)


def a_map(size: float, *, final: bool = False, scan: int = 5) -> Snapshot:
    corners = np.array([[0.0, 0.0], [size, 0.0], [size, size / 2], [0.0, size / 2]], dtype=np.float32)
    return Snapshot(
        points=corners,
        owners=np.zeros(4, dtype=np.int32),
        poses=np.zeros((1, 3)),
        loops=np.zeros((0, 2), dtype=np.int64),
        scan_points=np.zeros((0, 2), dtype=np.float32),
        scan_pose=np.zeros(3),
        scan=scan,
        stamp=1.0,
        stage="tracking",
        final=final,
    )


def test_the_view_follows_the_map_until_the_user_zooms() -> None:
    figure = Figure(layout="constrained")
    FigureCanvasAgg(figure)
    drawing = MapDrawing(figure, "office, hide")
    (axes,) = figure.axes
    for size in (4.0, 4.2, 40.0):
        drawing.draw(a_map(size))
        figure.canvas.draw()
        assert axes.get_xlim()[0] <= 0.0 and size <= axes.get_xlim()[1]
        assert axes.get_ylim()[0] <= 0.0 and size / 2 <= axes.get_ylim()[1]
        assert axes.get_xlim()[1] - axes.get_xlim()[0] < 2.0 * size
    axes.set_xlim(1.0, 2.0)
    axes.set_ylim(1.0, 2.0)
    drawing.draw(a_map(90.0, final=True))
    figure.canvas.draw()
    assert (axes.get_xlim(), axes.get_ylim()) == ((1.0, 2.0), (1.0, 2.0))
    assert axes.get_title(loc="right").startswith("tracking: scan 6, 1 keyframes")


class Logged:
    """Stands where a stream of rerun stands; remembers the names of what was logged."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def log(self, name: str, *what: Any) -> None:
        self.names.append(name)

    def set_time(self, timeline: str, **when: Any) -> None: ...


def test_only_what_moved_or_came_is_logged_again() -> None:
    pytest.importorskip("rerun")
    from hsslam.live.rerun_stream import TOGETHER, MapStream

    stream = Logged()
    drawing = MapStream(stream)
    count = 2 * TOGETHER + 3
    poses = np.zeros((count, 3))
    points = np.ones((count, 2), dtype=np.float32)

    def parts(poses: np.ndarray[Any, Any], *, final: bool = False) -> list[str]:
        stream.names.clear()
        known = len(poses)
        drawing.log(
            Snapshot(
                points[:known],
                np.arange(known, dtype=np.int32),
                poses.copy(),
                np.zeros((0, 2), dtype=np.int64),
                points[:0],
                np.zeros(3),
                known,
                0.0,
                "tracking",
                final,
            )
        )
        return [name.removeprefix("map/points/") for name in stream.names if "points" in name]

    assert parts(poses[:-2]) == ["00000", "00001", "00002"]
    assert parts(poses) == ["00002"]
    assert parts(poses) == []
    poses[TOGETHER, 0] = 0.5
    assert parts(poses) == ["00001"]
    poses[0, 0] = 0.001
    assert parts(poses) == []
    assert parts(poses, final=True) == ["00000"]
