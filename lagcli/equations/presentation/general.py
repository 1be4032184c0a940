"""General laws: symbols that belong to the theory, and total time derivatives.

Symbols of the theory differ from the names of a model: if the model has a coordinate φ, a
constraint is f_β = 0, not φ_β = 0.
"""

from __future__ import annotations

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.typeset import Node, Partial, Rate, Sign, Sum, Symbol
from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative
from lagcli.model.model import Model

FORCE = Sign("Qᵢ", "Q_i")
_SCRIPT = {"T": "𝒯", "V": "𝒱", "L": "ℒ", "M": "ℳ", "B": "ℬ", "J": "𝒥"}


class Signs:
    """Symbols of the theory, chosen to differ from the names of the model.

    Parameters
    ----------
    model : Model
    """

    def __init__(self, model: Model):
        from lagcli.equations.render.letters import LATEX_GREEK
        from lagcli.equations.render.names import letter

        taken = {*model.coordinate_names, *model.parameters, *model.definitions}
        letters = {letter(name) for name in taken}
        capitals = (
            Sign(_SCRIPT[x], rf"\mathcal{{{x}}}") if x in taken else Sign(x, x) for x in "TVLMBJ"
        )
        self.kinetic, self.potential, self.lagrangian, *matrices = capitals
        #: M and B of M q̈ = f + Bᵀλ, B q̈ = γ; J of q̇ = J u + c, u the independent velocities.
        self.mass_matrix, self.constraint_matrix, self.null_space = matrices

        def free(*candidates: str) -> str:
            return next((x for x in candidates if x not in letters), candidates[0])

        def sign(*parts: str) -> Sign:
            below = "".join(parts[1:])
            latex = "".join(LATEX_GREEK.get(x, x) + " " for x in parts[1:]).strip()
            base = LATEX_GREEK.get(parts[0], parts[0])
            return (
                Sign(f"{parts[0]}_{below}", f"{base}_{{{latex}}}")
                if below
                else Sign(parts[0], base)
            )

        #: Numbers of coordinates and of constraints.
        self.coordinate_count, self.constraint_count = free("k", "n", "N"), free("r", "s", "p")
        row, coefficient = free("β", "α", "μ"), free("b", "a", "c", "h", "d")
        holonomic = free("φ", "f", "h")
        letters.add(holonomic)
        self.holonomic = sign(holonomic, row)
        self.forcing, self.rhs = sign(free("f", "p", "d")), sign(free("γ", "η", "ζ"))
        self.drift = sign(free("c", "d", "e"))
        rank = self.constraint_matrix
        self.rank = Sign(f"rank {rank.text}", rf"\operatorname{{rank}} {rank.latex}")
        #: Letter of the constraints at velocity level.
        self.velocity_residual = free("ψ", "g", "w")
        self.nonholonomic = sign(self.velocity_residual, row)
        self.coefficient = sign(coefficient, "i", row)
        self.multiplier = sign("λ", row)
        self.block = Sign(f"det {coefficient}", rf"\det {coefficient}")
        self.row, self.coefficient_letter = row, coefficient
        greek = LATEX_GREEK[row]
        self.reaction = Sign(
            f"Σ_{row} {self.multiplier.text} {self.coefficient.text}",
            rf"\textstyle\sum_{{{greek}}} {self.multiplier.latex} {self.coefficient.latex}",
        )


def force(coordinate: Symbol) -> Symbol:
    """Return the symbol of the generalized force on a coordinate."""
    return Symbol(coordinate.name, kind="force")


def total_rate(expression: Basic, equations: Equations) -> Basic:
    """Return d/dt of an expression in q, v and t."""
    free = expression.free_symbols
    terms = [derivative(expression, symbols.TIME)]
    pairs = zip((*equations.q, *equations.v), (*equations.v, *equations.a), strict=True)
    terms += [derivative(expression, x) * rate for x, rate in pairs if x in free]
    return se.Add(*terms)


def law(model: Model) -> tuple[Sum, Node]:
    """Return the sides of d/dt ∂L/∂q̇_i − ∂L/∂q_i = Q_i + Σ_β λ_β b_iβ (8.85)."""
    signs = Signs(model)
    rate = Rate(Partial(signs.lagrangian, Sign("q̇ᵢ", r"\dot{q}_i")))
    left = Sum(((1, rate), (-1, Partial(signs.lagrangian, Sign("qᵢ", "q_i")))))
    if not model.constraints:
        return left, FORCE
    return left, Sum(((1, FORCE), (1, signs.reaction)))


def coefficients(equations: Equations) -> dict[str, list[tuple[Node, ...]]]:
    """Return the definitions of b_iβ for each kind of constraints in a system."""
    found: dict[str, list[tuple[Node, ...]]] = {}
    signs = Signs(equations.model)
    sides = Sum(((1, Sign("lhs", r"\text{lhs}")), (-1, Sign("rhs", r"\text{rhs}"))))
    kinds = {c.constraint.kind for c in equations.constraints}
    if "holonomic" in kinds:
        slope = Partial(signs.holonomic, Sign("qᵢ", "q_i"))
        found["holonomic"] = [(signs.coefficient, slope), (signs.holonomic, sides)]
    if kinds - {"holonomic"}:
        slope = Partial(signs.nonholonomic, Sign("q̇ᵢ", r"\dot{q}_i"))
        found["nonholonomic"] = [(signs.coefficient, slope), (signs.nonholonomic, sides)]
    return found
