"""Conserved quantities, from the linear symmetries of a system."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from fractions import Fraction
from typing import Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ONE, TWO, ZERO
from lagcli.equations.symmetry.linear import Extent, Symmetry, linear_symmetries
from lagcli.equations.symmetry.monomials import coefficients, symbolic
from lagcli.model.expression.algebra import is_zero

#: Limits of the number of terms, which is an upper bound and often ten times the actual number:
#: `lagcli check` may take some seconds, a run some 20 ms.
THOROUGH, QUICK = 3e6, 1e3

Kind = Literal["energy", "jacobi", "momentum"]
Row = Mapping[int, Basic]


class ConservedQuantity(NamedTuple):
    """Conserved quantity: I = ±(p·ξ + F), or τ h − p·ξ + F.

    Parameters
    ----------
    name : str
        ``p_theta`` for a cyclic coordinate; ``energy``, ``jacobi``; ``J_1``, ``J_2``, … otherwise.
    kind : str
        ``energy``: h = T + V; ``jacobi``: h = q̇·∂L/∂q̇ − L otherwise, or with ξ; ``momentum``.
    field : mapping of int to expression
        The nonzero components of ξ by coordinate, linear in q.
    time : expression
        τ: 1 if the symmetry shifts time, else 0.
    gauge : expression
        F(q), whose time derivative is the change of L by ξ and τ.
    multiples : mapping of (int, int) to expression
        μ in B ξ + τ b_0 = μ φ, by constraint and by position constraint.
    expression : expression
        I in q, v, t and the parameters.
    momentum_form : expression
        I in the momenta p_q and h.
    general : bool
        Whether it is conserved for all values of the parameters, not only for those of the model.
    """

    name: str
    kind: Kind
    field: Row
    time: Basic
    gauge: Basic
    multiples: Mapping[tuple[int, int], Basic]
    expression: Basic
    momentum_form: Basic
    general: bool = False

    @property
    def in_momenta(self) -> str:
        """The quantity in the momenta p_q and h, as text: ``x*p_y - y*p_x``."""
        terms = list(coefficients(self.momentum_form).items())
        terms.sort(key=lambda pair: str(pair[0]))
        signs, factors = zip(*(_factor(x, str(term)) for term, x in terms), strict=True)
        text = "".join(f" {s} {f}" for s, f in zip(signs, factors, strict=True))
        return text.removeprefix(" + ").replace(" - ", "-", text.startswith(" - "))


class Conserved(NamedTuple):
    """The conserved quantities found in a system.

    Parameters
    ----------
    quantities : tuple of ConservedQuantity
    extent : str
        ``linear``: all linear symmetries were searched; ``translations``: those with constant ξ;
        ``absent coordinates``: coordinates that do not occur in the equations.
    """

    quantities: tuple[ConservedQuantity, ...]
    extent: Extent


def conserved_quantities(equations: Equations, effort: float = THOROUGH) -> Conserved:
    """Find the conserved quantities of linear symmetries, and Jacobi's integral.

    Parameters
    ----------
    equations : Equations
    effort : float
        `THOROUGH` or `QUICK`.

    Returns
    -------
    Conserved
        For the model's parameter values; `lagcli.equations.symmetry.generality` determines whether
        they matter.
    """
    symmetries, extent = linear_symmetries(equations, equations.model.parameter_values, effort)
    return Conserved(_named(equations, _lasting(equations, symmetries)), extent)


def monitored_quantities(equations: Equations) -> tuple[ConservedQuantity, ...]:
    """Find conserved quantities besides the energy, within some 20 ms.

    Parameters
    ----------
    equations : Equations
    """
    symmetries, _ = linear_symmetries(equations, equations.model.parameter_values, QUICK)
    found = _lasting(equations, [s for s in symmetries if not s.is_energy])
    return _named(equations, found)


def _lasting(equations: Equations, symmetries: list[Symmetry]) -> list[Symmetry]:
    """Return the symmetries whose quantities remain constant when constraints switch.

    Impacts and friction conserve momenta as constraints do, since B ξ = 0 for all rows. They
    dissipate energy, and assignments by events change any quantity.
    """
    model = equations.model
    if any(e.action.set or e.action.impulse for e in model.events):
        return []
    if model.switches or any(x != ZERO for x in equations.reactive_forces):
        return [s for s in symmetries if not s.time]
    return symmetries


def _named(equations: Equations, symmetries: list[Symmetry]) -> tuple[ConservedQuantity, ...]:
    """Return the quantities of symmetries: momenta of cyclic coordinates first, energy last."""
    found = [q for q in (_quantity(equations, s) for s in symmetries) if not is_zero(q.expression)]
    found.sort(key=lambda q: (q.time != ZERO, q.name == ""))
    numbers = iter(range(1, len(found) + 1))
    return tuple(q if q.name else q._replace(name=f"J_{next(numbers)}") for q in found)


def _quantity(equations: Equations, symmetry: Symmetry) -> ConservedQuantity:
    scale = symbolic(1 / _size(equations, symmetry))
    q = equations.q
    parts: dict[int, list[Basic]] = defaultdict(list)
    for (i, j), x in sorted(symmetry.linear.items()):
        parts[i].append(scale * symbolic(x) * q[j])
    for i, x in symmetry.shift.items():
        parts[i].append(scale * symbolic(x))
    gauge = [symbolic(x) * q[i] for i, x in symmetry.gauge_linear.items()]
    for (i, j), x in symmetry.gauge_quadratic.items():
        gauge.append(symbolic(x) * q[i] * q[j] / (TWO if i == j else ONE))
    return quantity_of(
        equations,
        {i: se.Add(*parts[i]) for i in sorted(parts)},
        scale * symbolic(symmetry.time),
        scale * se.Add(*gauge),
        {place: scale * symbolic(x) for place, x in symmetry.multiples.items()},
    )


def quantity_of(
    equations: Equations,
    field: Row,
    time: Basic,
    gauge: Basic,
    multiples: Mapping[tuple[int, int], Basic],
) -> ConservedQuantity:
    """Return the quantity of a symmetry; the arguments are those of `ConservedQuantity`."""
    eq, sign = equations, -ONE if time != ZERO else ONE
    names = eq.model.coordinate_names
    p_names = [se.Symbol(f"p_{name}") for name in names]
    momentum = se.Add(*[eq.momenta[i] * x for i, x in field.items()])
    short = se.Add(*[p_names[i] * x for i, x in field.items()])
    kind: Kind = "momentum"
    name = ""
    if time != ZERO:
        kind = name = "jacobi"
        if not field and is_zero(eq.energy - eq.kinetic - eq.potential):
            kind = name = "energy"
    elif len(field) == 1 and gauge == ZERO:
        ((i, x),) = field.items()
        name = f"p_{names[i]}" if x == ONE else ""
    return ConservedQuantity(
        name=name,
        kind=kind,
        field=field,
        time=time,
        gauge=gauge,
        multiples=multiples,
        expression=sign * (momentum - time * eq.energy - gauge),
        momentum_form=se.expand(sign * (short - time * se.Symbol("h") - gauge)),
    )


def _size(equations: Equations, symmetry: Symmetry) -> Fraction:
    """Return the number by which a symmetry is divided so that its largest component is 1.

    A rotation of a unit quaternion with rate 1 changes it by half of that.
    """
    if symmetry.time:
        return symmetry.time
    first = [*symmetry.linear.items(), *(((i, -1), x) for i, x in symmetry.shift.items())]
    (row, _), value = min(first)
    moved = {i for i, _ in symmetry.linear} | set(symmetry.shift)
    return abs(value) * (2 if row in _quaternions(equations) & moved else 1)


def _quaternions(equations: Equations) -> set[int]:
    """Return the coordinates of unit quaternions: those of constraints e·e = 1."""
    found: set[int] = set()
    for c in equations.constraints:
        ratios = {b / equations.q[i] for i, b in c.row.items()}
        constant = len(ratios) == 1 and not ratios.pop().free_symbols
        if c.position is not None and len(c.row) == 4 and constant:
            found.update(c.row)
    return found


def _factor(coefficient: Basic, term: str) -> tuple[str, str]:
    """Return the sign of a term, and its text without the sign."""
    numerator, denominator = map(int, coefficient.get_num_den())
    front = f"{abs(numerator)}*" if abs(numerator) != 1 else ""
    below = f"/{denominator}" if denominator != 1 else ""
    return "-" if numerator < 0 else "+", f"{front}{term.replace('**', '^')}{below}"
