"""Formulas of conserved quantities: written out only where they are short."""

from __future__ import annotations

import pytest
from symengine import Basic

import lagcli
from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.presentation.conserved import conserved_step
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.symmetry.conserved import conserved_quantities
from lagcli.equations.symmetry.linear import QUICK
from lagcli.equations.typesetting.nodes import Node

#: N masses on springs in a row: the energy is conserved.
ROW = """
coordinates: {"x[1..N]": m}
parameters: {N: 3, m: 1 kg, k: 2 N/m^3}
T: sum(m/2*x[i]'^2, i = 1..N)
V: sum(k/2*x[i]^4, i = 1..N)
initial: {"x[i = 1..N]": 0.1, "x[i = 1..N]'": 0}
"""


@pytest.mark.parametrize(("count", "sides"), [(3, 2), (200, 1)])
def test_a_quantity_of_very_many_symbols_is_not_arranged(
    count: int, sides: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would be too long, and to arrange that of a chain of 1000 takes seconds."""
    equations = derive(lagcli.load_text(ROW, set={"N": count}))
    found = {q.name: q for q in conserved_quantities(equations, QUICK).quantities}
    formulas, energy = Formulas(equations), found["energy"]
    arranged: list[Basic] = []
    original = formulas.arrange

    def arrange(expression: Basic) -> Node:
        arranged.append(expression)
        return original(expression)

    monkeypatch.setattr(formulas, "arrange", arrange)
    step = conserved_step(formulas, energy)
    assert len(step.lines[0].sides) == sides
    assert (energy.expression in arranged) == (sides == 2)
