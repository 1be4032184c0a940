"""The equations of a model on the page."""

from __future__ import annotations

from html import escape

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.overview import in_matrices
from lagcli.equations.render.formula_mathml import MathmlFormula
from lagcli.equations.render.formula_text import TextFormula
from lagcli.equations.render.html import equation
from lagcli.equations.render.names import Notation
from lagcli.equations.render.numbers import written_decimals

#: Number of coordinates above which the page shows no equations.
MOST = 12


def equations_html(equations: Equations) -> str:
    """Return the equations of motion and the constraints in HTML; empty for a large system.

    Parameters
    ----------
    equations : Equations
    """
    f = Formulas(equations)
    if len(f.coordinates) > MOST or in_matrices(f):
        return ""
    names, decimals = Notation(f.model), written_decimals(f.model)
    mathml, text = MathmlFormula(names, decimals), TextFormula(names, decimals)
    motion = [f.equation_line(i) for i in range(len(f.coordinates))]
    parts = ["<h3>Equations of motion</h3>", *(equation(x, mathml, text) for x in motion)]
    if equations.constraints:
        parts.append("<h3>Constraints</h3>")
    for c in equations.constraints:
        name = escape(c.constraint.name)
        parts.append(f"<div>{name}{equation(f.constraint_line(c), mathml, text)}</div>")
    return "".join(parts)
