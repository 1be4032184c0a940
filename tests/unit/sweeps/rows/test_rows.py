"""Rows of a sweep: what is made ready once, and how many are run together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.settings.settings import SettingsOverrides
from lagcli.sweeps.plan.plan import Spec, make_plan
from lagcli.sweeps.row_results import COMPLETED, MissingRows, RowStatus
from lagcli.sweeps.rows.rows import Runner
from lagcli.sweeps.rows.workers import Chunks

ROOT = Path(__file__).parents[4]


@pytest.fixture
def counted(count_calls):
    """Count the programs assembled and the orders of elimination found."""
    from lagcli.engine.core import batch as core_batch
    from lagcli.engine.integrate import batch, prepared

    return count_calls(
        (batch, "assemble"),
        (prepared, "assemble"),
        (core_batch, "assemble"),
        (prepared, "order_at"),
    )


def runner(path: Path, vary: str, **settings) -> Runner:
    model = lagcli.load(path)
    plan = make_plan(model, [vary], None, 0)
    measures = (("a", f"final({model.coordinate_names[0]})"),)
    chosen = SettingsOverrides(**settings)
    return Runner(Spec(model.text, "", {}, {}, chosen, plan, measures, "measures"))


@pytest.mark.parametrize(
    ("path", "vary", "settings"),
    [
        # in lanes, from guessed starts, of which each has its own order
        ("tests/found/stewart.yaml", "rp=0.5:0.7:0.05", {"t_end": 0.1, "samples": 2}),
        # with redundant constraints; runs leave the lanes at a singular configuration
        (
            "models/parallelogram.yaml",
            "alpha_1'=5:7:0.5",
            {"t_end": 0.1, "through_singular": True},
        ),
        # one by one: no lanes for this method
        ("models/four_bar.yaml", "m_1=1:2:0.25", {"t_end": 0.1, "method": "Radau"}),
    ],
)
def test_programs_are_assembled_once_for_all_rows(path, vary, settings, counted):
    rows = runner(ROOT / path, vary, **settings)
    first = rows.run(np.arange(2), lambda: None)
    once = counted["assemble"]
    assert once
    rest = rows.run(np.arange(2, 5), lambda: None)
    assert counted["assemble"] == once
    assert {*first.status, *rest.status} == {COMPLETED}


@pytest.mark.parametrize("seconds", [0.001, 0.1, 0.3, 1.0])
def test_chunks_fill_the_lanes(seconds):
    chunks = Chunks(MissingRows(RowStatus(1000)), 0, 2)
    for _ in range(5):
        numbers = chunks.next()
        assert len(numbers) % 8 == 0
        chunks.took(len(numbers), seconds * len(numbers))


def test_rows_that_take_long_come_one_by_one():
    chunks = Chunks(MissingRows(RowStatus(1000)), 0, 2)
    chunks.took(len(chunks.next()), 16 * 20.0)
    assert len(chunks.next()) == 1
