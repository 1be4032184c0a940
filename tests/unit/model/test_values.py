"""Values that depend on varied quantities have the values of a model loaded with these."""

from __future__ import annotations

import pytest
import symengine as se

from lagcli.model.loader import load_text
from lagcli.model.values import dependent_values

TEXT = """
coordinates: [x[1..2], y]
parameters:
  m: 2 kg
  l: 50 cm
  J: m*l^2/3
  w[i = 1..2]: i*sqrt(J)
  fixed: 7
T: (w[1]*x[1]'^2 + w[2]*x[2]'^2 + y'^2)/2
initial: {x[i = 1..2]: "i*l*x0", x[i]': 0, y: 2*l, y': 0, }
"""
TEXT = TEXT.replace("x0", "fixed").replace("x[i]': 0", "x[1..2]': 0").replace(", }", "}")


def at(expression: se.Basic, **values: float) -> float:
    return float(expression.subs(values).n(real=True))


def test_dependent_values_are_those_of_a_changed_model() -> None:
    found = dependent_values(load_text(TEXT), {"l", "m"})
    changed = load_text(TEXT, set={"l": "0.8 m", "m": "5 kg"})
    assert set(found) == {"m", "l", "J", "w[1]", "w[2]", "x[1]", "x[2]", "y"}
    positions = {n: entry.value for n, entry in changed.initial_positions.items()}
    wanted = changed.parameter_values | positions
    for name, expression in found.items():
        assert at(expression, l=0.8, m=5.0) == pytest.approx(wanted[name], rel=1e-14), name


def test_a_varied_quantity_hides_what_it_was_computed_from() -> None:
    found = dependent_values(load_text(TEXT), {"J", "l", "y", "x[1]'"})
    assert found["J"] == se.Symbol("J")
    assert found["y"] == se.Symbol("y")
    assert found["x[1]'"] == se.Symbol("x[1]'")
    assert found["w[2]"].free_symbols == {se.Symbol("J")}
    assert "m" not in found
    assert "fixed" not in found
