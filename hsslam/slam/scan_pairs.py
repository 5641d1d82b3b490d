"""Last step, too: every scan is matched against the very keyframes that were driven through before and after it.

A map is as sharp as the keyframes in it agree; two scans a moment apart need agree with each other alone, so they
tell better how the robot moved in between, and the map how all the way lies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsslam.config import Config
from hsslam.matching.interface import Matcher
from hsslam.se2 import Points, Pose, Poses, between, compose_many
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.scan_table import Rows
from hsslam.slam.windows import at_edge, difference, overlap_window


class ScanPairs:
    """Scans matched against scans; iterates over tuples of the four below."""

    def __init__(self) -> None:
        self._scans, self._relatives, self._covariances = Rows(2, dtype=np.int64), Rows(3), Rows(3, 3)

    def append(self, first: int, second: int, relative: Pose, covariance: NDArray[np.float64]) -> None:
        """Add a match.

        Parameters
        ----------
        first, second : int
            Numbers of the scans.
        relative : Pose
            Of the second, in the frame of the first.
        covariance : float64 (3, 3)
            In the frame of the first (m, m, rad).
        """
        self._scans.append((first, second))
        self._relatives.append(relative)
        self._covariances.append(covariance)

    def __len__(self) -> int:
        return len(self._scans)

    def partners(self, scans: int) -> NDArray[np.int64]:
        """How many of ``scans`` scans' matches each is a part of, (scans,)."""
        return np.bincount(self._scans.values.ravel(), minlength=scans)

    def __iter__(self) -> Iterator[tuple[int, int, Pose, NDArray[np.float64]]]:
        scans = self._scans.values.tolist()
        rows = zip(scans, self._relatives.values, self._covariances.values, strict=True)
        return ((first, second, relative, covariance) for (first, second), relative, covariance in rows)


def match_with_keyframes(
    config: Config,
    matcher: Matcher[Any],
    keyframe_points: Sequence[Points],
    poses: Poses,
    scans: Sequence[NDArray[np.float32]],
    anchors: NDArray[np.int64],
    relatives: Poses,
) -> ScanPairs:
    """Match every scan against ``graph.rescan_neighbours`` keyframes before it, and as many after it.

    Parameters and their order are those of `hsslam.slam.rescan.match_scans`. The search begins where the scan was
    tracked, which owes nothing to the map that it is matched against afterwards.

    Returns
    -------
    ScanPairs
        The keyframe's scan first.
    """
    rules, pairs = config.graph, ScanPairs()
    reach = rules.rescan_neighbours
    window = overlap_window(rules)
    tracked = compose_many(poses[anchors], relatives)
    # The scan that became a keyframe is the first that hangs on it.
    starts = np.append(np.searchsorted(anchors, np.arange(len(poses))), len(scans))
    for k in range(len(poses)):
        own = int(starts[k])
        around = range(starts[max(k - reach, 0)], starts[min(k + reach, len(poses))])
        if not reach or len(around) < 2:
            continue
        reference = matcher.prepare(keyframe_points[k])
        for i in around:
            if i == own:
                continue
            guess = between(poses[k], tracked[i])
            rng = generator(config.seed, Purpose.PAIR, own, i)
            result = matcher.match(reference, scans[i].astype(np.float64), guess, window, rng)
            inside = not at_edge(difference(result.pose, guess), window)
            if result.converged and inside and result.score >= rules.overlap_min_score:
                pairs.append(own, i, result.pose, result.covariance)
    return pairs
