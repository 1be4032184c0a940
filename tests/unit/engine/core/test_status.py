"""Reasons for which the core returns: the numbers are those that C was compiled with."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import lagcli.engine.core
from lagcli.engine.core.headers import headers
from lagcli.engine.core.status import LaneStatus, Status


@pytest.mark.parametrize(
    ("status", "name", "prefix"),
    [(Status, "lag_status", "LAG_"), (LaneStatus, "lag_lane_status", "LAG_LANE_")],
)
def test_c_numbers_the_statuses_alike(
    status: type[Status] | type[LaneStatus], name: str, prefix: str
) -> None:
    """An enumeration of C counts from 0 in the order of its names."""
    body = re.search(rf"enum {name} {{\n(.*?)}};", headers()["tables.h"], re.DOTALL)
    assert body
    names = re.findall(r"^    (\w+),", body[1], re.MULTILINE)
    assert {n.removeprefix(prefix): i for i, n in enumerate(names)} == {
        s.name: int(s) for s in status
    }
    assert all(n.startswith(prefix) for n in names)


def test_every_status_has_a_sentence_of_its_own() -> None:
    sentences = [s.sentence for s in (*Status, *LaneStatus)]
    # both know the end
    assert len(set(sentences)) == len(sentences) - 1
    assert Status.DONE.sentence == LaneStatus.DONE.sentence


def test_the_core_names_no_other_statuses() -> None:
    folder = Path(lagcli.engine.core.__file__).parent
    used = set()
    for file in folder.glob("*.[ch]"):
        if file.name != "tables.h":
            used |= set(re.findall(r"return (LAG_[A-Z_]+);", file.read_text(encoding="utf-8")))
    # reasons to reject a model are those of lagmodel.h alone
    used = {name for name in used if not name.startswith("LAG_MODEL_")}
    known = {f"LAG_{s.name}" for s in Status} | {f"LAG_LANE_{s.name}" for s in LaneStatus}
    assert used
    assert used <= known
