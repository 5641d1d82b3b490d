"""The index of keyframes near by against looking at all of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.slam.near import NearIndex


def by_looking_at_all(
    poses: NDArray[np.float64], keyframe: int, stop: int, radius: float, most: int
) -> list[int]:
    distances = np.hypot(*(poses[:stop, :2] - poses[keyframe, :2]).T)
    order = np.argsort(distances, kind="stable")
    return [int(k) for k in order if distances[k] <= radius][:most]


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
    index = NearIndex()
    for pose in poses:
        index.add(pose)
    for moved in (poses, poses[::-1]):
        index.rebuild(moved)
        stop = int(rng.integers(0, count + 1))
        found, distances = index.of(count - 1, stop, radius, most)
        assert found.tolist() == by_looking_at_all(moved, count - 1, stop, radius, most)
        assert (distances == np.hypot(*(moved[found, :2] - moved[count - 1, :2]).T)).all()
