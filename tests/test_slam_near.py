"""The index of keyframes near by against looking at all of them."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.slam.near import CELL, ENOUGH, HEADINGS, NearIndex


def by_looking_at_all(
    poses: NDArray[np.float64], among: NDArray[np.int64], stop: int, radius: float, most: int
) -> list[int]:
    among = among[among < stop]
    distances = np.hypot(*(poses[among, :2] - poses[-1, :2]).T)
    order = np.argsort(distances, kind="stable")
    return [int(among[k]) for k in order if distances[k] <= radius][:most]


@settings(deadline=None, max_examples=80)
@given(
    st.integers(0, 10_000),
    st.integers(1, 2500),
    st.sampled_from([0.3, 4.0, 100.0]),
    st.floats(0.01, 8.0),
    st.integers(1, 200),
)
def test_the_nearest_come_first_and_none_is_missed(
    seed: int, count: int, extent: float, radius: float, most: int
) -> None:
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-extent, extent, (count, 3)).round(2)  # rounded: some are at the same distance
    poses[:, 2] = rng.uniform(-math.pi, math.pi, count)
    index = NearIndex()
    remembered: list[int] = []
    places: Counter[tuple[int, ...]] = Counter()
    for k, pose in enumerate(poses):
        index.add(pose)
        place = (*(pose[:2] // CELL).astype(int), int((pose[2] + math.pi) / (2 * math.pi) * HEADINGS))
        if places[place] < ENOUGH:
            remembered.append(k)
        places[place] += 1
    assert len(index) == len(remembered)
    for moved in (poses, poses[::-1]):
        index.rebuild(moved)
        stop = int(rng.integers(0, count + 1))
        found, distances = index.of(moved[-1], stop, radius, most)
        expected = by_looking_at_all(moved, np.array(remembered), stop, radius, most)
        assert found.tolist() == expected
        assert (distances == np.hypot(*(moved[found, :2] - moved[-1, :2]).T)).all()


def test_a_place_is_not_remembered_without_end() -> None:
    index = NearIndex()
    for _ in range(1000):
        index.add(np.array([0.1, 0.1, 0.1]))
    assert len(index) == ENOUGH
    assert index.of(np.zeros(3), 1000, 1.0, 200)[0].tolist() == list(range(ENOUGH))
    index.add(np.array([0.1, 0.1, 2.0]))
    assert index.of(np.zeros(3), 1001, 1.0, 200)[0].tolist() == [*range(ENOUGH), 1000]
