"""The growing map in the viewer of rerun, or in a recording that it opens later."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.io.atomic import atomic_path
from hsslam.live.latest import Latest
from hsslam.live.snapshot import Snapshot, placed
from hsslam.live.viewers import ViewerError

APPLICATION = "hsslam"

TOGETHER = 50
"""Keyframes whose points are one entity: sent again when one of them has moved, or has come."""

MOVED_XY = 0.01
MOVED_THETA = 0.002
"""A keyframe that moved less (m, rad) is left where it was shown, but in the final map."""

FLUSH = 20.0
"""How long what was logged may take to reach the viewer or the file (s)."""

GONE = "the window was closed, or could not be opened (`rerun` by itself says why)"

COLOURS = {
    "map": (200, 200, 200),
    "trajectory": (86, 180, 233),
    "loops": (213, 94, 0),
    "scan": (0, 158, 115),
    "robot": (240, 228, 66),
}


class MapStream:
    """Logs a map as it grows: what has not changed since it was logged is not logged again.

    Parameters
    ----------
    stream : rerun.RecordingStream
        Where to.
    """

    def __init__(self, stream: Any) -> None:
        import rerun

        self._rerun = rerun
        self._stream = stream
        self._logged: dict[int, tuple[int, NDArray[np.float64]]] = {}

    def log(self, snapshot: Snapshot) -> None:
        """Log another state of the map."""
        rr, stream = self._rerun, self._stream
        stream.set_time("scan", sequence=snapshot.scan)
        stream.set_time("log time", duration=snapshot.stamp)
        self._log_map(snapshot)
        way = snapshot.trajectory
        stream.log("map/trajectory", rr.LineStrips2D([way], colors=COLOURS["trajectory"], draw_order=20.0))
        stream.log("map/loops", rr.LineStrips2D(snapshot.ties, colors=COLOURS["loops"], draw_order=10.0))
        owners = np.zeros(len(snapshot.scan_points), dtype=np.int32)
        scan = placed(snapshot.scan_points, owners, snapshot.scan_pose[None, :])
        stream.log("map/newest scan", rr.Points2D(scan, colors=COLOURS["scan"], draw_order=30.0))
        x, y, theta = snapshot.scan_pose
        ahead = [0.5 * np.cos(theta), 0.5 * np.sin(theta)]
        stream.log(
            "map/robot",
            rr.Arrows2D(vectors=[ahead], origins=[[x, y]], colors=COLOURS["robot"], draw_order=40.0),
        )
        stream.log("status", rr.TextLog(snapshot.status))

    def _log_map(self, snapshot: Snapshot) -> None:
        bounds = np.searchsorted(snapshot.owners, np.arange(0, len(snapshot.poses) + TOGETHER, TOGETHER))
        for number, (begin, end) in enumerate(pairwise(bounds)):
            poses = snapshot.poses[number * TOGETHER : (number + 1) * TOGETHER]
            count, shown = self._logged.get(number, (-1, poses))
            if count == end - begin and len(shown) == len(poses):
                off = np.abs(poses - shown)
                if snapshot.final:
                    same = bool(np.all(off == 0.0))
                else:
                    same = bool(np.all(off[:, :2] < MOVED_XY) and np.all(off[:, 2] < MOVED_THETA))
                if same:
                    continue
            self._logged[number] = (int(end - begin), poses)
            points = placed(snapshot.points[begin:end], snapshot.owners[begin:end], snapshot.poses)
            self._stream.log(f"map/points/{number:05d}", self._rerun.Points2D(points, colors=COLOURS["map"]))


def run(inbox: Latest[Snapshot], title: str, recording: str, shown: Callable[[], None]) -> None:
    """Log what comes in until nothing more comes.

    Parameters
    ----------
    inbox : Latest of Snapshot
        Where snapshots come in.
    title : str
        Name of the recording.
    recording : str
        The file to record to; empty opens the viewer instead.
    shown : callable
        Called when all is logged, and the recording is complete.

    Raises
    ------
    ViewerError
        The viewer is gone.
    """
    import rerun
    from rerun import blueprint

    view = blueprint.Blueprint(
        blueprint.Spatial2DView(origin="map", name=title, background=(25, 25, 25)), collapse_panels=True
    )
    with atomic_path(recording) if recording else nullcontext() as file:
        stream = rerun.RecordingStream(APPLICATION)
        stream.send_recording_name(title)
        if file is not None:
            stream.save(file, default_blueprint=view)
        else:
            # The viewer lies beside the Python that it is installed for, which need not be on the path.
            os.environ["PATH"] = os.pathsep.join(
                (str(Path(sys.executable).parent), os.environ.get("PATH", ""))
            )
            stream.spawn(default_blueprint=view, hide_welcome_screen=True)
        drawing = MapStream(stream)
        while (snapshot := inbox.take()) is not None:
            drawing.log(snapshot)
            try:
                stream.flush(timeout_sec=FLUSH)
            except Exception as error:  # the library's errors have no root of their own
                fault = f"{recording}: cannot be written: {error}" if recording else GONE
                raise ViewerError(fault) from error
        stream.disconnect()
    shown()
