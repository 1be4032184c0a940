"""The start of a run: why there is none."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import NumericalError

ROD = """name: a rod of length l
coordinates: [x, y]
parameters: {{l: {l}, m: 1, g: 9.81}}
T: m*(x'^2 + y'^2)/2
V: m*g*y
constraints:
  rod: {rod}
initial: {{x: {{guess: 0.3}}, y: {{guess: 0.4}}, x': {{guess: 0}}, y': {{guess: 0}}}}
simulation: {{t_end: 1, samples: 3}}
"""
FORMS = ("x^2 + y^2 = l^2", "norm([x, y]) = l", "1e6*(x^2 + y^2) = 1e6*l^2")


@pytest.mark.parametrize("rod", FORMS)
def test_a_rod_of_no_length_is_refused_with_its_line(rod: str) -> None:
    """Its force has no direction, and the projection would follow rounding errors."""
    text = ROD.format(l=0, rod=rod)
    with pytest.raises(NumericalError) as caught:
        lagcli.simulate(lagcli.load_text(text))
    (found,) = caught.value.diagnostics
    assert "the constraint `rod` holds only where it has no gradient" in found.message
    assert found.location is not None
    assert found.location.line == 7


@pytest.mark.parametrize("length", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("rod", FORMS)
def test_a_short_rod_is_none(rod: str, length: float) -> None:
    """However far the guess: 0.5 m."""
    text = ROD.format(l=length, rod=rod)
    t = lagcli.simulate(lagcli.load_text(text), t_end=0.01 * length**0.5)
    assert t.status == "completed", t.message
    assert abs((t.q**2).sum(axis=1) ** 0.5 / length - 1).max() < 1e-9


def test_a_constraint_whose_terms_vanish_keeps_its_gradient() -> None:
    text = ROD.format(l=0, rod="x = 0\n  other: sin(y) = l")
    t = lagcli.simulate(lagcli.load_text(text))
    assert t.status == "completed", t.message
    assert abs(t.multipliers[:, 1] - 9.81).max() < 1e-12


def test_a_zero_row_at_the_start_is_said_with_its_line() -> None:
    text = ROD.format(l=0, rod=FORMS[0])
    text = text.replace("{guess: 0.3}", "0").replace("{guess: 0.4}", "0")
    t = lagcli.simulate(lagcli.load_text(text))
    assert t.status == "failed"
    assert "the constraint `rod` has no gradient there" in t.message
    assert t.message.endswith("`rod` is on line 7 of the model")
