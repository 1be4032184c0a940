"""Steps that show independent and dependent coordinates, and the dependent velocities."""

from __future__ import annotations

import symengine as se
from symengine import Basic

from lagcli.equations.presentation import general
from lagcli.equations.presentation.formulas import Formulas, Line, Step
from lagcli.equations.presentation.typeset import (
    ZERO,
    Node,
    Number,
    Power,
    Product,
    Quotient,
    Root,
    Sign,
    Sum,
    Symbol,
    VirtualDisplacement,
    forward,
    product_of,
    quotient_of,
    sum_of,
    symbols_in,
    weight,
    whole,
)
from lagcli.equations.reduction.partition import CoordinatePartition, DependentRate
from lagcli.equations.reduction.small_systems import cancelled


def split_step(f: Formulas, p: CoordinatePartition) -> Step:
    """Return the section on coordinates and degrees of freedom (8.79 to 8.84)."""
    k, r, rank = len(f.coordinates), len(f.equations.constraints), len(p.constraints)
    count = f"{r} relation{'s' * (r != 1)}"
    signs = general.Signs(f.model)
    all_of, held = (Sign(x, x) for x in (signs.coordinate_count, signs.constraint_count))
    lines = [
        Line((all_of, whole(k)), note="coordinates"),
        Line((held, whole(r)), note="constraints"),
    ]
    if rank < r:
        lines.append(Line((signs.rank, whole(rank)), note="at the start"))
    less = held if rank == r else signs.rank
    difference = sum_of([(1, all_of), (-1, less)])
    lines.append(Line((difference, whole(k - rank)), note="degrees of freedom"))
    lines += [Line((f.coordinates[i],), note="independent") for i in p.independent]
    lines += [Line((f.coordinates[i],), note="dependent") for i in p.dependent]
    if not r:
        return Step("Coordinates and degrees of freedom", tuple(lines), "There are no constraints.")
    remark = f"The virtual displacements satisfy {count} (8.79)"
    remark += f", of which {rank} are independent." if rank < r else "."
    if p.surplus:
        names = ", ".join(f.equations.constraints[i].constraint.name for i in p.surplus)
        remark += f" At the start {names} follow{'s' * (len(p.surplus) == 1)} from the others."
    return Step("Coordinates and degrees of freedom", tuple(lines), remark)


def determinant_step(f: Formulas, p: CoordinatePartition) -> Step | None:
    """Return the determinant of the dependent block of B, and where it is zero (8.80 to 8.84)."""
    if not p.dependent:
        return None
    alone = [x for x in p.determinants if _is_monomial(f.arrange(x))]
    sums = [f.arrange(x) for x in p.determinants if x not in alone]
    nodes = [f.arrange(se.Mul(*alone)), *sums]
    signs = general.Signs(f.model)
    shown = [Line((signs.block, _multiplied(nodes)))]
    places = list(dict.fromkeys(x for node in nodes for x in _factors(node) if _moves(f, x)))
    shown += [Line((place, ZERO), note="the determinant is zero here") for place in places]
    remark = (
        f"{signs.coefficient_letter} has the columns of the dependent coordinates. Where its"
        " determinant is not zero, they follow from the independent ones, and λ can be chosen as in"
        " (8.82)."
    )
    if not places:
        remark += " It is zero nowhere."
    return Step("Determinant of the dependent coordinates", tuple(shown), remark)


def _is_monomial(node: Node) -> bool:
    """Whether a formula is a product without sums."""
    _, node = forward(node)
    factors = node.factors if isinstance(node, Product) else (node,)
    return not any(isinstance(x, Sum) for x in factors)


def _multiplied(nodes: list[Node]) -> Node:
    sign, parts = 1, []
    for node in nodes:
        s, rest = forward(node)
        sign *= s
        parts.append(rest)
    found = product_of(parts)
    return found if sign > 0 else sum_of([(-1, found)])


def _factors(node: Node) -> list[Node]:
    """Return the factors of a formula, without powers, roots and denominators."""
    match node:
        case Sum() if len(node.terms) == 1:
            return _factors(node.terms[0][1])
        case Product():
            return [x for factor in node.factors for x in _factors(factor)]
        case Quotient():
            return _factors(node.numerator)
        case Power():
            return _factors(node.base)
        case Root():
            return _factors(node.radicand)
    return [] if isinstance(node, Number) else [node]


def _moves(f: Formulas, node: Node) -> bool:
    """Whether a factor depends on coordinates or time."""
    moving = {*f.model.coordinate_names, *f.model.definitions, "t"}
    return any(name in moving for name in symbols_in([node]))


def fraction(f: Formulas, above: Basic, below: Basic) -> Node:
    """Return a fraction with arranged numerator and denominator, reduced if that is shorter."""
    (shorter,), common = cancelled([above], below)
    for value in (1, -1):
        if se.expand(shorter - value * common) == 0:
            return whole(value)
    found = [_fraction(f, shorter, common), _fraction(f, above, below)]
    best = min(found, key=weight)
    quotient = f.arrange(above / below)  # tan θ
    return quotient if weight(quotient) < weight(best) - 1 else best


def _fraction(f: Formulas, above: Basic, below: Basic) -> Node:
    sign_below, divisor = forward(f.arrange(below))
    sign_above, top = forward(f.arrange(above))
    return sum_of([(sign_below * sign_above, quotient_of(top, divisor))])


def rate_node(f: Formulas, rate: DependentRate) -> Node:
    """Return a dependent velocity in terms of others."""
    return fraction(f, *rate.over(f.equations.v))


def displacement_line(f: Formulas, rate: DependentRate) -> Line:
    """Return a dependent virtual displacement in terms of others."""
    terms = []
    for j, x in rate.numerators.items():
        moved = product_of(
            [fraction(f, x, rate.denominator), VirtualDisplacement(f.coordinates[j])]
        )
        terms.append((1, moved))
    return Line((VirtualDisplacement(f.coordinates[rate.coordinate]), sum_of(terms)))


def velocity(symbol: Symbol) -> Symbol:
    """Return the velocity of a coordinate."""
    return Symbol(symbol.name, 1)
