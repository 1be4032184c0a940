"""General laws: symbols that belong to the theory, and total time derivatives."""

from __future__ import annotations

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.presentation.typeset import Node, Partial, Rate, Sign, Sum, Symbol
from lagcli.model import model as symbols
from lagcli.model.expression.functions import derivative
from lagcli.model.model import Model

FORCE = Sign("Qᵢ", "Q_i")
_SCRIPT = {"T": "𝒯", "V": "𝒱", "L": "ℒ"}


class Signs:
    """Symbols of T, V and L; in script if the model declares the same name."""

    def __init__(self, model: Model):
        taken = {*model.coordinate_names, *model.parameters, *model.definitions}
        self.kinetic, self.potential, self.lagrangian = (
            Sign(_SCRIPT[x], rf"\mathcal{{{x}}}") if x in taken else Sign(x, x) for x in "TVL"
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
    lagrangian = Signs(model).lagrangian
    rate = Rate(Partial(lagrangian, Sign("q̇ᵢ", r"\dot{q}_i")))
    left = Sum(((1, rate), (-1, Partial(lagrangian, Sign("qᵢ", "q_i")))))
    if not model.constraints:
        return left, FORCE
    reaction = Sign("Σ_β λ_β b_iβ", r"\textstyle\sum_{\beta} \lambda_\beta b_{i\beta}")
    return left, Sum(((1, FORCE), (1, reaction)))


def coefficients(equations: Equations) -> list[tuple[Node, ...]]:
    """Return the definitions of b_iβ for the kinds of constraints in a system."""
    found: list[tuple[Node, ...]] = []
    b = Sign("b_iβ", r"b_{i\beta}")
    sides = Sum(((1, Sign("lhs", r"\text{lhs}")), (-1, Sign("rhs", r"\text{rhs}"))))
    kinds = {c.constraint.kind for c in equations.constraints}
    if "holonomic" in kinds:
        phi = Sign("φ_β", r"\varphi_\beta")
        found += [(b, Partial(phi, Sign("qᵢ", "q_i"))), (phi, sides)]
    if "nonholonomic" in kinds:
        psi = Sign("ψ_β", r"\psi_\beta")
        found += [(b, Partial(psi, Sign("q̇ᵢ", r"\dot{q}_i"))), (psi, sides)]
    return found
