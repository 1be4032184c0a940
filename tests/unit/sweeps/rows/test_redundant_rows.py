"""Rows with redundant constraints in lanes: each as its single run, and as closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rows_alone import check_like_alone, rows_together

import lagcli
from lagcli.engine.core.status import LaneStatus
from lagcli.engine.integrate import batch

ROOT = Path(__file__).parents[4]
PARALLELOGRAM = (ROOT / "models" / "parallelogram.yaml").read_text(encoding="utf-8")
ROD = """
parameters: {m: 1, l: 1, g: 9.81, k: 2, b: 0, c: 0}
coordinates: [x, y]
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  rod: x^2 + y^2 = l^2
  again: k*(x^2 + y^2 - l^2) = b + c*t
initial: {x: {guess: 1}, y: {guess: -0.2}, x': 0.3, y': {guess: 0}}
"""


@pytest.fixture
def in_lanes(monkeypatch):
    """The number of rows that were done in lanes."""
    used = []
    original = batch.BatchIntegrator

    def kept(*arguments):
        used.append(original(*arguments))
        return used[-1]

    monkeypatch.setattr(batch, "BatchIntegrator", kept)
    return lambda: sum(int((x.status[:-1] == LaneStatus.DONE).sum()) for x in used)


def test_multipliers_are_shared_by_least_norm(in_lanes):
    """Of two rows B and k B, which alone would have λ, the shares are λ (1, k)/(1 + k²)."""
    factors = [2.0, 1e-6, 1e6, -3.0, 1.0]
    rod = ROD.replace("  again: k*(x^2 + y^2 - l^2) = b + c*t\n", "")
    alone = lagcli.simulate(lagcli.load_text(rod), t_end=3.0, samples=21, rtol=1e-12)
    table = [[k] for k in factors]
    group, rows = rows_together(lagcli.load_text(ROD), ["k"], table, t_end=3.0, rtol=1e-10)
    assert in_lanes() == len(factors)
    layout = group.variants.system.sample_layout
    for k, (samples, _, rank) in zip(factors, rows, strict=True):
        assert rank == 1
        expected = alone.multipliers * np.array([1.0, k]) / (1.0 + k * k)
        np.testing.assert_allclose(samples[:, layout.multipliers], expected, rtol=1e-7)


@pytest.mark.parametrize(
    ("column", "values", "ends", "lanes"),
    [
        # flat, where the rank is lower than beside it; almost flat; and elsewhere
        (
            "alpha_1",
            [-0.5, 0.0, -np.pi, -1e-6, -1.0],
            ["completed", "no start", "completed", "no start", "completed"],
            2,
        ),
        # the flat configuration is passed on the way
        ("alpha_1'", [0.0, 6.0, 3.0], ["completed", "failed", "completed"], 2),
        # the middle crank is redundant only if it is as long as the others
        (
            "k",
            [0.5, 0.5001, 0.5 + 1e-9, 0.4, 0.5],
            ["completed", "no start", "no start", "no start", "completed"],
            2,
        ),
    ],
)
def test_what_changes_the_rank_runs_alone(column, values, ends, lanes, in_lanes):
    text = PARALLELOGRAM.replace("parameters:\n", "parameters:\n  k: 0.5 m\n")
    for name in ("cos", "sin"):
        text = text.replace(f"= d/2 + l*{name}(alpha_3)", f"= d/2 + k*{name}(alpha_3)")
        text = text.replace(f"= l*{name}(alpha_3)", f"= k*{name}(alpha_3)")
    model = lagcli.load_text(text)
    found = check_like_alone(model, [column], [[x] for x in values], 1e-7, t_end=1.0, rtol=1e-9)
    assert found == ends
    assert in_lanes() == lanes


def test_contradicting_rows_end_as_they_do_alone(in_lanes):
    table = [[0, 0], [1e-3, 0], [1e-12, 0], [0, 1e-9], [0, 1e-3], [0, 1e-12]]
    ends = check_like_alone(lagcli.load_text(ROD), ["b", "c"], table, 1e-7, t_end=1.0, rtol=1e-9)
    assert ends[0] == "completed"
    assert "no start" in ends
    assert in_lanes() == ends.count("completed")


def test_rows_that_become_dependent_stay_in_their_lanes(in_lanes):
    """A spatial four-bar that turns fully: no three of its six rows suffice all the way."""
    model = lagcli.load(ROOT / "tests" / "found" / "bennett.yaml")
    table = [[1.0, 9.81], [0.7, 9.0], [1.3, 10.5]]
    ends = check_like_alone(model, ["m", "g"], table, 1e-6, t_end=2.0, rtol=1e-9)
    assert ends == ["completed"] * 3
    assert in_lanes() == 3


def test_a_row_does_not_depend_on_its_company():
    model = lagcli.load(ROOT / "tests" / "found" / "bennett.yaml")
    table = np.column_stack([np.linspace(0.7, 1.3, 9), np.linspace(10.5, 9.0, 9)])
    _, together = rows_together(model, ["m", "g"], table, t_end=1.5)
    for some in ([4], [8, 0, 2]):
        _, apart = rows_together(model, ["m", "g"], table[some], t_end=1.5)
        for i, (samples, run, _) in zip(some, apart, strict=True):
            np.testing.assert_array_equal(samples, together[i][0])
            assert run.counts == together[i][1].counts
