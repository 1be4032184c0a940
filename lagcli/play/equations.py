"""The equations of a model as the page shows them."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.overview import in_matrices
from lagcli.equations.typesetting.mathml import MathmlFormula, equation
from lagcli.equations.typesetting.nodes import Line
from lagcli.equations.typesetting.notation import Notation
from lagcli.equations.typesetting.text import TextFormula
from lagcli.equations.typesetting.writer import written_decimals
from lagcli.pictures.balance import Balance, live_equation

#: Number of coordinates above which the page shows no equations.
MOST_COORDINATES = 12


class PlayEquations:
    """The equations of a model as the page shows them; none for a large system.

    Parameters
    ----------
    equations : Equations
    cuttable : bool
        Whether constraints have buttons that release them.

    Attributes
    ----------
    html : str
        The equations of motion, and the constraints.
    balance : Balance
        The terms of the equations.
    """

    def __init__(self, equations: Equations, cuttable: bool = True):
        f = Formulas(equations)
        large = len(f.coordinates) > MOST_COORDINATES or in_matrices(f)
        motion = {} if large else {i: f.equation_line(i) for i in range(len(f.coordinates))}
        self.balance = Balance(f, motion)
        self.html = "" if large else self._html(f, motion, cuttable)

    def _html(self, f: Formulas, motion: Mapping[int, Line], cuttable: bool) -> str:
        names, decimals = Notation(f.model), written_decimals(f.model)
        mathml, text = MathmlFormula(names, decimals), TextFormula(names, decimals)
        parts = ["<h3>Equations of motion</h3>"]
        parts += [live_equation(i, x, self.balance, mathml, text) for i, x in motion.items()]
        constraints = f.equations.constraints
        if constraints:
            parts.append("<h3>Constraints</h3>")
        for c in constraints:
            name = escape(c.constraint.name)
            button = f'<button type="button" data-cut="{name}" aria-pressed="false">Cut</button>'
            parts.append(
                f'<div class="cuttable"><span>{name}</span>{button if cuttable else ""}'
                f"{equation(f.constraint_line(c), mathml, text)}</div>"
            )
        return "".join(parts)
