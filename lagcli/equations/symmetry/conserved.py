"""Conserved quantities, from the linear symmetries of a system."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, product
from typing import Literal, NamedTuple

import symengine as se
from symengine import Basic

from lagcli.equations.derivation.lagrange import Equations
from lagcli.equations.derivation.motion import ONE, TWO, ZERO
from lagcli.equations.symmetry.jumps import jumps
from lagcli.equations.symmetry.linear import (
    THOROUGH,
    Extent,
    Monomials,
    Symmetry,
    coefficients,
    conditions_of,
    lasting_symmetries,
    rational,
    symbolic,
    term_count,
)
from lagcli.model.expression.algebra import is_zero
from lagcli.model.model import Model

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
        For the model's parameter values; `lagcli.equations.symmetry.conserved` determines whether
        they matter.
    """
    symmetries, extent = lasting_symmetries(equations, effort)
    return Conserved(named_quantities(equations, symmetries), extent)


def named_quantities(
    equations: Equations, symmetries: Sequence[Symmetry]
) -> tuple[ConservedQuantity, ...]:
    """Return the quantities of symmetries: momenta of cyclic coordinates first, energy last.

    Those that jump are not conserved: the conditions of a symmetry hold beside a jump only.
    """
    parameters = equations.model.parameter_values
    quantities = [
        q
        for q in (_quantity(equations, s) for s in symmetries)
        if not (is_zero(q.expression) or jumps(q.expression, parameters))
    ]
    quantities.sort(key=lambda q: (q.time != ZERO, q.name == ""))
    numbers = iter(range(1, len(quantities) + 1))
    return tuple(q if q.name else q._replace(name=f"J_{next(numbers)}") for q in quantities)


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
    momentum_letter, jacobi = _free_names(eq.model)
    p_names = [se.Symbol(f"{momentum_letter}_{name}") for name in names]
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
        momentum_form=se.expand(sign * (short - time * se.Symbol(jacobi) - gauge)),
    )


def _free_names(model: Model) -> tuple[str, str]:
    """Return the letter of momenta and the name of Jacobi's integral, which the model lacks."""
    taken = frozenset(model.declared_names)
    letters = ("p", "P", "momentum")
    free = (x for x in letters if taken.isdisjoint(f"{x}_{q}" for q in model.coordinate_names))
    return next(free, letters[0]), next((x for x in ("h", "H") if x not in taken), "jacobi")


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
    components: set[int] = set()
    for c in equations.constraints:
        ratios = {b / equations.q[i] for i, b in c.row.items()}
        constant = len(ratios) == 1 and not ratios.pop().free_symbols
        if c.position is not None and len(c.row) == 4 and constant:
            components.update(c.row)
    return components


def _factor(coefficient: Basic, term: str) -> tuple[str, str]:
    """Return the sign of a term, and its text without the sign."""
    numerator, denominator = map(int, coefficient.get_num_den())
    front = f"{abs(numerator)}*" if abs(numerator) != 1 else ""
    below = f"/{denominator}" if denominator != 1 else ""
    return "-" if numerator < 0 else "+", f"{front}{term.replace('**', '^')}{below}"


class Proof:
    """The conditions that a symmetry satisfies, as expressions that vanish identically.

    Parameters
    ----------
    equations : Equations
    quantity : ConservedQuantity
    """

    def __init__(self, equations: Equations, quantity: ConservedQuantity):
        self.equations, self.quantity = equations, quantity

    def products(self) -> Iterator[tuple[Basic, Basic]]:
        """Yield the factors of the products in (∂L/∂q + Q)·ξ + p·ξ̇ + τ (∂L/∂t − Q·v)."""
        eq, quantity = self.equations, self.quantity
        for i, x in quantity.field.items():
            yield eq.gradient[i] + eq.applied_forces[i], x
            yield eq.momenta[i], self.rate(x)
        if quantity.time != ZERO:
            yield quantity.time, -eq.time_power
            for force, v in zip(eq.applied_forces, eq.v, strict=True):
                yield -quantity.time * force, v

    def constraint_products(self, beta: int) -> Iterator[tuple[Basic, Basic]]:
        """Yield the factors of the products in b_β·ξ + τ b_0."""
        row, drift = conditions_of(self.equations.constraints[beta])
        for i, b in row.items():
            if i in self.quantity.field:
                yield b, self.quantity.field[i]
        yield self.quantity.time, drift

    def multiple(self, beta: int) -> Basic:
        """Return Σ_γ μ_βγ φ_γ."""
        positions = [c.position for c in self.equations.constraints if c.position is not None]
        multiples = self.quantity.multiples.items()
        return se.Add(*[x * positions[j] for (i, j), x in multiples if i == beta])

    def rate(self, expression: Basic) -> Basic:
        """Return the time derivative of a function of q."""
        pairs = zip(self.equations.q, self.equations.v, strict=True)
        return se.Add(*[expression.diff(q) * v for q, v in pairs])

    def holds_generally(self) -> bool:
        """Whether the conditions hold for all values of the parameters."""
        conditions = [se.Add(*[x * y for x, y in self.products()], -self.rate(self.quantity.gauge))]
        for beta in range(len(self.equations.constraints)):
            products = [x * y for x, y in self.constraint_products(beta)]
            conditions.append(se.Add(*products, -self.multiple(beta)))
        return all(map(_vanishes, conditions))


def _vanishes(expression: Basic) -> bool:
    write = Monomials({})
    exponential = write.exponential(expression)
    return term_count(exponential) <= THOROUGH and not any(True for _ in write.terms(exponential))


#: Number of candidate expressions of a symmetry's numbers in terms of parameters.
_MOST_NAMINGS = 32
#: Numbers tried as factors of parameters.
_PLAIN = (Fraction(1), Fraction(1, 2), Fraction(2))


def generalized(equations: Equations, quantity: ConservedQuantity) -> ConservedQuantity:
    """Return a quantity with its numbers expressed by parameters, if it then holds for all values.

    Parameters
    ----------
    equations : Equations
    quantity : ConservedQuantity
        Quantity from `conserved_quantities`.
    """
    if Proof(equations, quantity).holds_generally():
        return quantity._replace(general=True)
    for numbers in _namings(equations, quantity):
        other = quantity_of(
            equations,
            {i: _renamed(x, numbers) for i, x in quantity.field.items()},
            quantity.time,
            _renamed(quantity.gauge, numbers),
            {place: _renamed(x, numbers) for place, x in quantity.multiples.items()},
        )
        if Proof(equations, other).holds_generally():
            return other._replace(name=quantity.name, general=True)
    return quantity


def _namings(equations: Equations, quantity: ConservedQuantity) -> Iterator[dict[Fraction, Basic]]:
    """Yield parameters and simple combinations of them for the numbers of a symmetry."""
    given = {n: rational(x) for n, x in equations.model.parameter_values.items()}
    powers = {se.Symbol(n) ** e: x**e for n, x in given.items() if x for e in (1, -1)}
    pairs = {a * b: x * y for (a, x), (b, y) in combinations(powers.items(), 2)}
    parts = [*quantity.field.values(), quantity.gauge, *quantity.multiples.values()]
    used = sorted({abs(x) for part in parts for x in _numbers(part)})
    choices: list[list[Basic]] = []
    for number in used:
        names = _equal(number, powers if number in _PLAIN else {**powers, **pairs})
        choices.append([symbolic(number), *names][:_MOST_NAMINGS])
    for tried, chosen in enumerate(product(*choices)):
        if tried >= _MOST_NAMINGS:
            return
        yield dict(zip(used, chosen, strict=True))


def _equal(number: Fraction, known: Mapping[Basic, Fraction]) -> list[Basic]:
    """Return the products of parameters and a plain number that have a given value, factor 1
    first."""
    factors = {symbol: number / x for symbol, x in known.items() if abs(number / x) in _PLAIN}
    exact = sorted(factors, key=lambda symbol: abs(factors[symbol]) != 1)
    return [symbolic(factors[symbol]) * symbol for symbol in exact]


def _numbers(expression: Basic) -> Iterator[Fraction]:
    """Yield the coefficients of an expression that is a sum of terms."""
    for coefficient in coefficients(expression).values():
        numerator, denominator = coefficient.get_num_den()
        yield Fraction(int(numerator), int(denominator))


def _renamed(expression: Basic, numbers: Mapping[Fraction, Basic]) -> Basic:
    terms = []
    for term, coefficient in coefficients(expression).items():
        numerator, denominator = coefficient.get_num_den()
        value = Fraction(int(numerator), int(denominator))
        named = numbers[abs(value)]
        terms.append(term * (named if value > 0 else -named))
    return se.Add(*terms)
