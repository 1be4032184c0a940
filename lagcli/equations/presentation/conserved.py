"""Conserved quantities with their proofs."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import islice

import symengine as se
from symengine import Basic

from lagcli.equations.presentation.formulas import Formulas, Signs
from lagcli.equations.symmetry.conserved import ConservedQuantity, Proof
from lagcli.equations.typesetting.nodes import (
    ZERO,
    Line,
    Node,
    Partial,
    Sign,
    Step,
    Symbol,
    VirtualDisplacement,
    product_of,
    sum_of,
    weight,
)
from lagcli.model.model import Model, coordinate

#: Largest number of characters of a formula that is written out.
_LONG = 300
#: Operations per character of an arranged formula; the most in the models of the tests is 2.6.
_SHORTENED = 5
#: Largest number of operations of a product that is arranged.
_OPERATIONS = 400
#: Largest number of constraints whose products are listed.
_CONSTRAINTS = 12


def title_of(quantity: ConservedQuantity, model: Model) -> str:
    """Return a description of a conserved quantity."""
    names, signs = model.coordinate_names, Signs(model)
    jacobi = signs.jacobi.text
    along = ", ".join(islice((names[i] for i in quantity.field), 8))
    along += ", …" if len(quantity.field) > 8 else ""
    coordinates = set(map(coordinate, names))
    constant = all(coordinates.isdisjoint(x.free_symbols) for x in quantity.field.values())
    if quantity.gauge != 0 and quantity.time != 0:
        return f"Jacobi's integral {jacobi} and the work of constant forces"
    if quantity.kind == "energy":
        return f"energy, {jacobi} = {signs.kinetic.text} + {signs.potential.text}"
    if quantity.kind == "jacobi":
        if quantity.field:
            return f"Jacobi's integral, in a frame that moves with {along}"
        return f"Jacobi's integral {jacobi}"
    if quantity.name == f"p_{along}":
        return f"momentum of {along}, a cyclic coordinate"
    return f"momentum along {along}" if constant else f"momentum of a rotation of {along}"


def conserved_step(
    f: Formulas, quantity: ConservedQuantity, value: float | None = None, unit: str | None = None
) -> Step:
    """Return a conserved quantity with its proof.

    Parameters
    ----------
    f : Formulas
        Formulas of its system.
    quantity : ConservedQuantity
    value : float, optional
        Its value at the initial state.
    unit : str, optional
        Unit of the value.
    """
    lines = [Line(_sides(f, quantity), quantity.name), *_proof(f, quantity)]
    measured = f" {unit}" if unit and unit != "1" else ""
    said = [] if value is None else [f"Value at the start: {minus(value + 0.0)}{measured}."]
    if not quantity.general:
        said.append(
            "It is conserved for these values of the parameters; for others, its coefficients"
            " change, or it is not conserved."
        )
    title = title_of(quantity, f.model)
    return Step(f"Conserved: {title}", tuple(lines), " ".join(said) or None)


def minus(value: float) -> str:
    """Return a number with a Unicode minus sign."""
    return f"{value:.6g}".replace("-", "−")


def _sides(f: Formulas, quantity: ConservedQuantity) -> tuple[Node, ...]:
    """Return the quantity in terms of the momenta ∂L/∂q̇, and written out if that is short."""
    signs = Signs(f.model)
    lagrangian = signs.lagrangian
    sign = -1 if quantity.time != 0 else 1
    terms: list[tuple[int, Node]] = []
    if quantity.time != 0:
        terms.append((1, signs.jacobi))
    for i, x in quantity.field.items():
        momentum = Partial(lagrangian, Symbol(f.coordinates[i].name, 1))
        terms.append((sign, product_of([f.arrange(x), momentum])))
    terms.append((-sign, f.arrange(quantity.gauge)))
    short = sum_of(terms)
    if se.count_ops(quantity.expression) > _SHORTENED * _LONG:  # arranging it takes seconds
        return (short,)
    written = f.arrange(quantity.expression)
    return (short, written) if weight(written) <= _LONG else (short,)


def _proof(f: Formulas, quantity: ConservedQuantity) -> list[Line]:
    """Return the symmetry and the conditions that it satisfies, term by term."""
    proof = Proof(f.equations, quantity)
    displacements = [
        Line((VirtualDisplacement(f.coordinates[i]), f.arrange(x)))
        for i, x in quantity.field.items()
    ]
    if quantity.time != 0:
        displacements.append(Line((Sign("δt", r"\delta t"), f.arrange(quantity.time))))
    rate = f.arrange(proof.rate(quantity.gauge))
    change = _sum(f, proof.products())
    displacements.append(Line((Sign("δL", r"\delta L"), *([change] if change else []), rate)))
    lines = []
    for beta, c in enumerate(f.equations.constraints):
        change = _sum(f, proof.constraint_products(beta))
        if change is None:
            continue
        multiple = f.arrange(proof.multiple(beta))
        sides = (change, ZERO) if multiple == ZERO else (change, multiple, ZERO)
        lines.append(Line(sides, c.constraint.name))
    return [*displacements, *lines[:_CONSTRAINTS]]


def _sum(f: Formulas, products: Iterable[tuple[Basic, Basic]]) -> Node | None:
    """Return a sum of products as written, or its number of terms; None if all vanish."""
    kept = [(x, y) for x, y in products if x != 0 and y != 0]
    if not kept:
        return None
    if sum(se.count_ops(x) + se.count_ops(y) for x, y in kept) <= _OPERATIONS:
        node = sum_of((1, product_of([f.arrange(x), f.arrange(y)])) for x, y in kept)
        if weight(node) <= _LONG:
            return node
    return Sign(f"({len(kept)} products)", rf"({len(kept)}\;\text{{products}})")
