"""Where blocks stand."""

from __future__ import annotations

from lagcli.engine.layout import Counts
from lagcli.engine.linear.blocks import Blocks, inputs_of

BLOCKS = Blocks(Counts(nq=2, nc=1, nh=1, nm=4, nb=2), 2)


def test_blocks_follow_each_other() -> None:
    assert Counts(nq=6, nc=3, nh=3, nm=12, nb=6) == BLOCKS.total
    assert [BLOCKS.coordinates(k) for k in range(3)] == [slice(0, 2), slice(2, 4), slice(4, 6)]
    assert BLOCKS.constraints(2) == slice(2, 3)


def test_inputs_are_time_coordinates_velocities_and_parameters() -> None:
    q, v, p = inputs_of(BLOCKS, 2)
    assert [0, *q, *v, *p] == list(range(1 + 6 + 6 + 2))
    assert len(q) == len(v) == 6
