"""The binding of batches and of tables."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.engine.core import batch
from lagcli.engine.core.batch import LANES, BatchTable
from lagcli.engine.core.library import KERNEL, PORTABLE
from lagcli.engine.core.program import assemble
from lagcli.engine.tape.operations import Op
from lagcli.engine.tape.tape import Tape

#: x + p y, of (x, y, p).
TAPE = Tape(3, (), ((Op.MUL, 3, 1, 2, 0), (Op.ADD, 4, 0, 3, 0)), (4,), 1)


@pytest.mark.parametrize("kernel", {KERNEL, PORTABLE})
@pytest.mark.parametrize("rows", [1, LANES, 2 * LANES + 3])
def test_a_table_is_evaluated_with_the_parameters_of_each(kernel: int, rows: int) -> None:
    table = BatchTable(assemble(TAPE), 3, 1, kernel)
    random = np.random.default_rng(rows)
    tables, p = random.normal(size=(4, rows, 5)), random.normal(size=(4, 1))
    expected = tables[..., 0] + p * tables[..., 1]
    np.testing.assert_allclose(table(tables, p)[:, 0], expected, rtol=1e-15)
    # and of an array that is not contiguous
    np.testing.assert_array_equal(table(tables[::2], p[::2]), table(tables, p)[::2])


def test_tables_without_rows_have_no_outputs() -> None:
    table = BatchTable(assemble(TAPE), 3, 1)
    assert table(np.empty((0, 4, 5)), np.empty((0, 1))).shape == (0, 1, 4)
    assert table(np.empty((2, 0, 5)), np.empty((2, 1))).shape == (2, 1, 0)


def test_without_memory_python_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch.core, "lag_table_create", lambda *_: None)
    with pytest.raises(MemoryError):
        BatchTable(assemble(TAPE), 3, 1)
