"""Relative uncertainty against the shortest of all paths, found by relaxing every link until nothing changes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsslam.slam.uncertainty import MOST_LINKS, RelativeUncertainty

Link = tuple[int, int, float, float]


def by_relaxation(links: list[Link], newest: int, poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 2) variances by Bellman-Ford."""
    cost = np.full((len(poses), 2), np.inf)
    cost[newest] = 0.0
    for _ in range(len(poses)):
        for first, second, xy, theta in links:
            for here, there in ((first, second), (second, first)):
                lever = float(((poses[here] - poses[newest])[:2] ** 2).sum())
                reached = cost[here, 0] + xy + theta * lever
                if reached < cost[there, 0]:
                    cost[there] = reached, cost[here, 1] + theta
    return cost


def chain(count: int) -> tuple[list[Link], NDArray[np.float64]]:
    """Keyframes a metre apart, along a ring, each known from the one before."""
    angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    radius = count / (2.0 * np.pi)
    poses = np.column_stack((radius * np.cos(angles), radius * np.sin(angles), angles))
    return [(i, i + 1, 1e-4, 1e-5) for i in range(count - 1)], poses


def told(links: list[Link]) -> RelativeUncertainty:
    uncertainty = RelativeUncertainty()
    for link in links:
        uncertainty.add(*link)
    return uncertainty


@settings(deadline=None, max_examples=60)
@given(st.integers(2, 25), st.integers(0, 40), st.integers(0, 10_000))
@example(7, 32, 2956)  # more links at a keyframe than are kept
def test_paths_are_the_shortest(count: int, extra: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = rng.uniform(-5.0, 5.0, (count, 3))
    ends = [(i, i + 1) for i in range(count - 1) if rng.random() < 0.9]  # the graph may fall apart
    ends += [(int(a), int(b)) for a, b in rng.integers(0, count, (extra, 2)) if a != b]
    degrees = np.bincount(np.array(ends, dtype=np.int64).ravel(), minlength=count)
    ends = [end for end in ends if degrees[list(end)].max() <= MOST_LINKS]  # so that none is left out
    links = [(a, b, float(rng.uniform(1e-5, 1e-2)), float(rng.uniform(1e-6, 1e-3))) for a, b in ends]
    targets = rng.integers(0, count, 5)
    found = told(links).seen_from(count - 1, targets, poses)
    np.testing.assert_allclose(found, by_relaxation(links, count - 1, poses)[targets], rtol=1e-9)


def test_variances_add_up_along_a_chain_and_a_loop_shrinks_them() -> None:
    links, poses = chain(40)
    uncertainty, targets = told(links), np.array([0, 20, 38, 39])
    before = uncertainty.seen_from(39, targets, poses)
    assert before[:, 1] == pytest.approx([39e-5, 19e-5, 1e-5, 0.0])
    assert before[3] == pytest.approx([0.0, 0.0])
    assert (np.diff(before[:, 0]) < 0.0).all()
    uncertainty.add(0, 39, 1e-4, 1e-5)
    after = uncertainty.seen_from(39, targets, poses)
    assert after[0] == pytest.approx([1e-4, 1e-5])
    assert after[2] == pytest.approx(before[2])


def test_what_no_path_reaches_is_unknown() -> None:
    uncertainty = told([(0, 1, 1e-4, 1e-5), (2, 3, 1e-4, 1e-5)])
    found = uncertainty.seen_from(3, np.array([0, 2]), np.zeros((4, 3)))
    assert np.isinf(found[0]).all()
    assert np.isfinite(found[1]).all()


def test_there_is_room_for_more_keyframes_and_links_than_at_first() -> None:
    links, poses = chain(9000)
    found = told(links).seen_from(8999, np.array([0]), poses)
    assert found[0, 1] == pytest.approx(8999e-5)


def test_where_ever_more_paths_meet_some_are_left_out_and_none_is_made_up() -> None:
    links, poses = chain(4 * MOST_LINKS)
    hub = [(0, second, 1e-6, 1e-7) for second in range(10, len(poses))]
    newest = len(poses) - 1
    every = np.arange(newest)
    found = told([*links, *hub]).seen_from(newest, every, poses)
    best = by_relaxation([*links, *hub], newest, poses)[:-1]
    assert found[0] == pytest.approx(best[0])  # the way back to what is old is as good as ever
    assert (found >= best * (1.0 - 1e-9)).all()
    assert (found[:, 0] > 1.5 * best[:, 0]).any()
    assert np.isfinite(found).all()
