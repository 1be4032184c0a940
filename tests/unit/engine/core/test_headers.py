"""The core's headers: written at build time, and those of the tables as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from lagcli.engine import core
from lagcli.engine.core.headers import headers
from lagcli.engine.core.status import LaneStatus, Status


@pytest.mark.parametrize("name", headers())
def test_the_core_was_built_with_these_headers(name: str) -> None:
    written = Path(core.__file__).with_name(name)
    if not written.exists():
        pytest.skip("the core was not built here")
    assert written.read_text(encoding="utf-8") == headers()[name], "build the core again"


def test_rows_become_c() -> None:
    text = headers()["tables.h"]
    assert "    X(OP_ADD, 3, A + B) \\\n" in text
    assert "#define SERIES_MULSUM_PLACES 6\n" in text
    assert f"    LAG_OFF, /* {Status.OFF.sentence} */\n" in text


def test_statuses_are_numbered_in_order() -> None:
    assert [int(status) for status in (*Status, *LaneStatus)] == [*range(29), *range(4)]


def test_layouts_become_c() -> None:
    text = headers()["layout.h"]
    offset = "int lag_first_{}(const lag_system *s)\n{{\n    (void)s;\n    return {};\n"
    assert offset.format("rhs", "s->nm + s->nq + s->nb") in text
    offset = offset.replace("first", "sample")
    assert offset.format("multipliers", "1 + s->nq + s->nq + s->nq") in text
