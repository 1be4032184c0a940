"""Numbers in streams that must not be taken for others."""

from __future__ import annotations

import numpy as np

from lagcli.engine.program.nodes import INDEXED, LONGEST, VECTOR
from lagcli.engine.tape.operations import Op
from lagcli.engine.taylor.series_nodes import SeriesOp


def test_operations_on_vectors_are_no_other_operations() -> None:
    for operations in (Op, SeriesOp):
        assert not {VECTOR + op for op in operations} & set(operations)


def test_no_step_is_taken_for_a_list() -> None:
    # streams are int32; a step between places, which are not negative, is larger
    assert np.iinfo(np.int32).min == INDEXED < -np.iinfo(np.int32).max


def test_vectors_are_whole_batches_of_eight() -> None:
    assert LONGEST % 8 == 0
