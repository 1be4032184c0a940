"""The core's header of tables: written at build time, and that of the tables as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.engine import core
from lagcli.engine.core.headers import tables_header
from lagcli.engine.core.status import LaneStatus, Status

WRITTEN = Path(core.__file__).with_name("tables.h")


@pytest.mark.skipif(not WRITTEN.exists(), reason="the core was not built here")
def test_the_core_was_built_with_these_tables() -> None:
    assert WRITTEN.read_text(encoding="utf-8") == tables_header(), "build the core again"


def test_rows_become_c() -> None:
    text = tables_header()
    assert "    X(OP_ADD, 3, A + B) \\\n" in text
    assert "#define SERIES_MULSUM_PLACES 6\n" in text
    assert f"    LAG_OFF, /* {Status.OFF.sentence} */\n" in text


def test_statuses_are_numbered_in_order() -> None:
    assert [int(status) for status in (*Status, *LaneStatus)] == [*range(14), *range(4)]
