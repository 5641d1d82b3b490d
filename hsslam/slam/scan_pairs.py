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
from hsslam.matching.results import Matches
from hsslam.se2 import Pose, between_many, compose_many
from hsslam.slam.keyframes import Keyframes
from hsslam.slam.randomness import Purpose, generator
from hsslam.slam.scan_table import Rows, ScanTable
from hsslam.slam.side_by_side import side_by_side, threads_for
from hsslam.slam.windows import at_edges, differences, overlap_window


class ScanPairs:
    """Scans matched against scans; iterates over tuples of the four below."""

    def __init__(self) -> None:
        self._scans, self._relatives, self._covariances = Rows(2, dtype=np.int64), Rows(3), Rows(3, 3)

    def extend(self, first: int, seconds: Sequence[int], matches: Matches) -> None:
        """Add matches against one scan.

        Parameters
        ----------
        first, seconds : int, sequence of int
            Number of the scan, and those of the scans that were matched against it.
        matches : Matches
            Of the seconds, in the frame of the first.
        """
        for second, relative, covariance in zip(seconds, matches.poses, matches.covariances, strict=True):
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
    config: Config, matcher: Matcher[Any], keyframes: Keyframes, scans: ScanTable
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
    if not reach:
        return pairs
    window = overlap_window(rules)
    poses, sessions, anchors = keyframes.poses, keyframes.sessions.numbers, scans.anchors
    tracked = compose_many(poses[anchors], scans.relatives)
    # The scan that became a keyframe is the first that hangs on it.
    starts = np.append(np.searchsorted(anchors, np.arange(len(poses))), len(scans)).tolist()

    def matched(k: int) -> tuple[list[int], Matches]:
        own = starts[k]
        around = np.arange(starts[max(k - reach, 0)], starts[min(k + reach, len(poses))])
        others = around[(sessions[anchors[around]] == sessions[k]) & (around != own)].tolist()
        if not others:
            return others, Matches.of([])
        guesses = between_many(np.tile(poses[k], (len(others), 1)), tracked[others])
        rng = generator(config.seed, Purpose.PAIR, own)
        points = [scans.points[i].astype(np.float64) for i in others]
        found = matcher.match_many(matcher.prepare(keyframes.points[k]), points, guesses, window, rng)
        good = found.converged & (found.scores >= rules.overlap_min_score)
        good &= ~at_edges(differences(found.poses, guesses), window)
        return [others[i] for i in np.flatnonzero(good)], found.only(good)

    for k, (others, matches) in enumerate(
        side_by_side(matched, len(poses), threads_for(matcher, rules.threads))
    ):
        pairs.extend(starts[k], others, matches)
    return pairs
