"""Many scans matched against one reference, without a return to the interpreter in between.

Returning costs a tenth of a match, and threads that match side by side wait for each other there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hsslam.jit import kernel
from hsslam.kernels.assess import measure
from hsslam.kernels.surface import scan_lines
from hsslam.kernels.window import inside
from hsslam.se2 import Points, Pose, Poses, wrap
from hsslam.search.settle import settle


@dataclass(frozen=True, eq=False)
class Batch:
    """Scans as kernels take them: one after the other in memory.

    Parameters
    ----------
    points : Points
        (M, 2) m, of all scans.
    ends : int64 (N,)
        Where each scan ends among them.
    guesses : Poses
        (N, 3) where each scan is thought to be, in the reference's frame.
    """

    points: Points
    ends: NDArray[np.int64]
    guesses: Poses

    @classmethod
    def of(cls, scans: Sequence[Points], guesses: Poses) -> Batch:
        """Lay out scans of (N_i, 2) finite points."""
        ends = np.cumsum([len(scan) for scan in scans], dtype=np.int64)
        return cls(np.concatenate(scans), ends, np.ascontiguousarray(guesses, dtype=np.float64))

    def __len__(self) -> int:
        return len(self.ends)

    @cached_property
    def lines(self) -> NDArray[np.float64]:
        """Lines (M, 3) through the points, each scan's own."""
        return lines_of_all(self.points, self.ends)

    def scan(self, i: int) -> Points:
        """Points (N_i, 2) of scan ``i``."""
        return part(self.points, self.ends, i)


@kernel
def part(rows: NDArray[np.float64], ends: NDArray[np.int64], i: int) -> NDArray[np.float64]:
    """Rows, of its points or its lines, of scan ``i`` of a batch."""
    return rows[(ends[i - 1] if i > 0 else 0) : ends[i]]


@kernel
def lines_of_all(points: Points, ends: NDArray[np.int64]) -> NDArray[np.float64]:
    """`scan_lines` of each scan of a batch, (M, 3)."""
    lines = np.empty((points.shape[0], 3))
    for i in range(ends.shape[0]):
        part(lines, ends, i)[:] = scan_lines(part(points, ends, i))
    return lines


@kernel
def settle_all(
    pieces: NDArray[np.float64],
    tilts: NDArray[np.float64],
    nearest: NDArray[np.uint32],
    surface_frame: NDArray[np.float64],
    cells: NDArray[np.uint8],
    frame: NDArray[np.float64],
    points: Points,
    lines: NDArray[np.float64],
    ends: NDArray[np.int64],
    guesses: Poses,
    found: Poses,
    half: NDArray[np.float64],
    iterations: int,
    step: float,
    distance: float,
) -> tuple[Poses, NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """What `hsslam.matching.Matcher.match` makes of poses that a search found, scan by scan.

    Parameters
    ----------
    pieces, tilts, nearest, surface_frame : arrays
        Of the reference's `Surface`.
    cells, frame : arrays
        Of the raster that was searched.
    points, lines, ends, guesses : arrays
        Of a `Batch`.
    found : Poses
        (N, 3) what the search found.
    half : float64 (3,)
        Half sides of the window (m, m, rad).
    iterations : int
        Of the refinement, at most; 0 for none.
    step : float
        As for `hsslam.search.settle.settle`.
    distance : float
        See `hsslam.matching.MatcherConfig.score_distance`.

    Returns
    -------
    (Poses (N, 3), float64 (N, 3, 3), float64 (N,), bool (N,))
        Poses, their covariances and scores, and whether they are in the window; the guess where one is not.
    """
    count = ends.shape[0]
    poses, covariances = np.empty((count, 3)), np.empty((count, 3, 3))
    scores, converged = np.empty(count), np.empty(count, dtype=np.bool_)
    for i in range(count):
        scan, its, guess = part(points, ends, i), part(lines, ends, i), guesses[i]
        pose: Pose = found[i].copy()
        if iterations > 0:
            pose, _, _ = settle(
                pieces, nearest, surface_frame, cells, frame, scan, its, pose, guess, half, iterations, step
            )
        converged[i] = inside(guess, half, pose)
        poses[i] = pose if converged[i] else guess
        poses[i, 2] = wrap(poses[i, 2])
        scores[i], covariances[i], _ = measure(
            pieces, tilts, nearest, surface_frame, scan, its, poses[i], half, distance
        )
    return poses, covariances, scores, converged
