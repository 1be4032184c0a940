"""The values of ``--vary``: grids, lists and ranges in units, and errors that point into them."""

from __future__ import annotations

import numpy as np
import pytest

from lagcli.errors import ModelError, UsageError
from lagcli.model.loader import load_text
from lagcli.sweeps.plan.factors import Distribution
from lagcli.sweeps.plan.vary import Drawn, read_vary

MODEL = load_text(
    "coordinates: [x]\nparameters: {m: 2 kg, l: 1 m}\nT: m*x'^2/2\nV: 0\ninitial: {x: 0, x': 0}\n"
)


def values(text: str) -> list[float]:
    factor = read_vary(text, MODEL)
    assert not isinstance(factor, Drawn)
    found: list[float] = factor.rows(np.arange(factor.length))[:, 0].tolist()
    return found


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("m=1:1.3:0.1", [1.0, 1.1, 1.2, 1.3]),  # each rounded once
        ("m=2:1:-1/2", [2.0, 1.5, 1.0]),
        ("l=0.2,30 cm", [0.002, 0.3]),  # the last unit is that of all
        ("l=20 cm, 0.3 m", [0.2, 0.3]),
        ("l=linspace(0, 2, 3) cm", [0.0, 0.01, 0.02]),
        ("m=linspace(4, 5, 1)", [4.0]),
        ("m=logspace(0.01, 1, 3)", [0.01, 0.1, 1.0]),
        ("x'=2*(1 + 1), 0", [4.0, 0.0]),
        ("l=linspace(1 cm, 2 cm, 3)", [0.01, 0.015, 0.02]),
        ("l=1 mm:1 cm:3 mm", [0.001, 0.004, 0.007, 0.01]),
        ("l=logspace(1 mm, 1 m, 2)", [0.001, 1.0]),
    ],
)
def test_grids_and_lists(text: str, expected: list[float]) -> None:
    assert values(text) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "kind", "a", "b"),
    [
        ("m=1..2", "uniform", 1.0, 2.0),
        ("l=normal(20, 1) cm", "normal", 0.2, 0.01),
        ("l=normal(400 mm, 0.1 mm)", "normal", 0.4, 0.0001),
        ("l=1 mm..2 cm", "uniform", 0.001, 0.02),
        ("m=loguniform(0.1, 10)", "loguniform", 0.1, 10.0),
    ],
)
def test_ranges(text: str, kind: str, a: float, b: float) -> None:
    drawn = read_vary(text, MODEL)
    assert isinstance(drawn, Drawn)
    assert drawn.distribution == Distribution(kind, a, b)


@pytest.mark.parametrize(
    ("text", "message", "column", "length"),
    [
        ("m=1:2", "a grid has a first value, a last value and a step", 1, 3),
        ("m=1:2:-0.1", "steps of -0.1 do not lead from 1 to 2", 5, 4),
        ("m=1:2:1e-12", "these are more than 10^9 values", 5, 5),
        ("m=linspace(1, 2)", "`linspace` takes three numbers", 10, 4),
        ("m=logspace(0, 1, 3)", "both ends of `logspace` are values greater than 0", 10, 1),
        ("l=1 cm, 2, 3 m", "some of these values have a unit, and some have none", 6, 2),
        (
            "l=normal(1 m, 2 m) m",
            "there is a unit within the parentheses, and another behind them",
            18,
            1,
        ),
        ("l=normal(1 m, 2)", "some of these values have a unit, and some have none", 12, 2),
        ("l=normal(1, 2) foo", "`foo` is not a unit", 14, 3),
        ("m=2..1", "the range 2 to 1 is empty", 1, 4),
        ("m=normal(1, 0)", "the deviation must be greater than 0", 1, 12),
        ("m=loguniform(-1, 1)", "a logarithmic range is greater than 0", 1, 17),
        ("m=1, 1e308*1.9", "this is not a finite number", 3, 10),
        ("m=1, log(-1)", "this is not a real number", 4, 7),
    ],
)
def test_errors_point_to_the_place(text: str, message: str, column: int, length: int) -> None:
    with pytest.raises(ModelError) as caught:
        read_vary(text, MODEL)
    (found,) = caught.value.diagnostics
    assert found.message == message
    assert found.location is not None
    assert (found.location.column, found.location.length) == (column, length)


@pytest.mark.parametrize("text", ["m", "m=", "=1", "m=@table.csv"])
def test_what_has_no_name_or_no_values(text: str) -> None:
    with pytest.raises(UsageError, match="--vary"):
        read_vary(text, MODEL)
