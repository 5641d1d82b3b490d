"""What the pipeline remembers of every scan, and what it forgets at the end."""

from __future__ import annotations

import gc

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from hsslam.config import Config
from hsslam.datasets.simulator import SimulatedDataset
from hsslam.slam.pipeline import Slam
from hsslam.slam.scan_table import Rows, ScanTable


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 3000), st.sampled_from([(), (3,), (2, 2)]))
def test_rows_come_back_in_order_however_many(count: int, shape: tuple[int, ...]) -> None:
    rows = Rows(*shape)
    for i in range(count):
        rows.append(np.full(shape, float(i)))
    assert len(rows) == count
    assert rows.values.shape == (count, *shape)
    assert all((row == i).all() for i, row in enumerate(rows.values))


def test_a_scan_that_becomes_a_keyframe_hangs_on_itself() -> None:
    table = ScanTable()
    for i in range(2):
        table.append(
            0.1 * i, np.zeros(3), np.zeros(3), 0, np.ones(3), np.zeros(3), np.eye(3), np.ones((4, 2))
        )
    table.becomes_keyframe(1)
    assert table.anchors.tolist() == [0, 1]
    assert table.relatives.tolist() == [[1, 1, 1], [0, 0, 0]]


def test_references_of_loops_are_let_go_at_the_end() -> None:
    config = Config()
    slam = Slam(config)
    scans = list(SimulatedDataset("office", seed=1, scans=150).scans())
    for scan in scans:
        slam.process(scan)
    kind = type(config.matcher.create().prepare(scans[0].robot_points))

    def alive() -> int:
        return sum(isinstance(held, kind) for held in gc.get_objects())

    before = alive()
    for _ in slam.finish():
        pass
    gc.collect()
    assert before > 2
    assert alive() <= 2  # the tracker's
