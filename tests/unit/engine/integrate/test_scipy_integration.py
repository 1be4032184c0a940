"""A run of the reference engine, from within."""

import numpy as np

from lagcli.engine.contract import Block
from lagcli.engine.integrate.scipy_integration import ScipyIntegration
from tests.support.pendulum_by_hand import pendulum_system, request


def test_samples_wait_until_they_fill_a_block() -> None:
    blocks: list[Block] = []
    run = ScipyIntegration(pendulum_system(), request(block_rows=3), blocks.append, None)
    run.integrate()
    assert all(len(block.time) == 3 for block in blocks)
    emitted = len(blocks)
    run.emit()
    times = np.concatenate([block.time for block in blocks])
    assert len(blocks) - emitted <= 1
    np.testing.assert_array_equal(times, request().times)
