"""Steps of Lagrange's equations of the second kind, of Maggi's equations, and of closed forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import symengine as se
from symengine import Basic

from lagcli.equations.presentation import formulas as general
from lagcli.equations.presentation.extent import abridged
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.index_form import IndexForm
from lagcli.equations.presentation.matrices import abbreviate, without_single_uses
from lagcli.equations.presentation.overview import quantity
from lagcli.equations.presentation.steps import energy_sides
from lagcli.equations.reduction.closed_forms import Solution
from lagcli.equations.reduction.elimination import SolvedUnknown
from lagcli.equations.reduction.partition import CoordinatePartition, DependentRate, number
from lagcli.equations.reduction.second_kind import Maggi, SecondKind
from lagcli.equations.reduction.small_systems import cancelled, operations
from lagcli.equations.reduction.velocity_ratios import VelocityRatios, velocity_ratios
from lagcli.equations.typesetting.nodes import (
    ZERO,
    Call,
    Entry,
    Line,
    Node,
    Number,
    Partial,
    Power,
    Product,
    Quotient,
    Rate,
    Root,
    Sign,
    Step,
    Sum,
    Symbol,
    VirtualDisplacement,
    children,
    forward,
    product_of,
    quotient_of,
    rebuilt,
    sum_of,
    symbols_in,
    weight,
    whole,
)
from lagcli.equations.typesetting.notation import LATEX_GREEK, letter
from lagcli.equations.typesetting.rewriting import substituted
from lagcli.prose import counted


def split_step(f: Formulas, p: CoordinatePartition) -> Step:
    """Return the section on coordinates and degrees of freedom (8.79 to 8.84)."""
    k, r, rank = len(f.coordinates), len(f.equations.constraints), len(p.constraints)
    count = counted(r, "relation")
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
    product = product_of(parts)
    return product if sign > 0 else sum_of([(-1, product)])


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
    fractions = [_fraction(f, shorter, common), _fraction(f, above, below)]
    best = min(fractions, key=weight)
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


SECOND = "Equations of motion of the second kind"
MAGGI = "Maggi's equations"
ABBREVIATIONS = "Abbreviations of these entries"
ENTRIES = "Entries of the mass matrix and of the forces"
ENTRIES_OF_ONE = "Inertia of the mechanism and its derivative"
_RATES_OF_RATIOS = "Derivatives of the velocity ratios"
_NONE = "There are none: the constraints determine the motion."

#: Operations of the equations of motion above which they are printed as M a = f, abbreviated.
LONGEST = 1200
_ROUNDING = 1e-12  # below it, and below this part of the largest coordinate, a root is printed as 0
_KEPT = 1.3  # largest ratio of lengths at which the written structure is kept


def second_kind_steps(f: Formulas, second: SecondKind, derivation: bool) -> list[Step]:
    """Return the steps of the second kind, from the dependent coordinates on.

    Parameters
    ----------
    f : Formulas
    second : SecondKind
    derivation : bool
        Whether the derivatives of L are shown.
    """
    if _in_matrices(second) and not second.written_out:
        ratios = velocity_ratios(second.partition)
        if ratios is not None and _longest(ratios) <= LONGEST:
            dependent = _dependent(f, second)
            return [*([dependent] if dependent else []), *_ratio_steps(f, ratios)]
    return [
        step
        for step in (
            _dependent(f, second),
            _velocities(f, second),
            _lagrangian(f, second),
            *(_second_derivatives(f, second) if derivation else ()),
            *_second_equations(f, second, second.written_out),
        )
        if step is not None
    ]


def _dependent(f: Formulas, second: SecondKind) -> Step | None:
    lines: list[Line] = []
    implicit = False
    e = f.equations
    for solved in second.blocks:
        for solution in solved.solutions:
            lines += _solution_lines(f, second, solution)
        if solved.solutions:
            continue
        implicit = True
        names = ", ".join(e.constraints[i].constraint.name for i in solved.block.rows)
        rounding = _ROUNDING * max(1, *(abs(second.partition.values[x]) for x in e.q))
        for i in solved.block.columns:
            value = second.partition.values[e.q[i]]
            near = quantity(value if abs(value) > rounding else 0, None).text
            note = f"implicit: the root of {names} near {near}"
            lines.append(Line((f.coordinates[i], _root(f, second, i)), note=note))
    if not lines:
        return None
    remark = ""
    if any(s.sign for solved in second.blocks for s in solved.solutions):
        remark = "The signs of the roots are those of the branch that contains the initial values."
    if implicit:
        remark += " Implicit coordinates have no closed form here; their derivatives follow from"
        remark += " the constraints."
    lead = "Solving the constraints for the dependent coordinates gives"
    return Step("Dependent coordinates", tuple(lines), remark.strip() or None, lead=lead)


def _root(f: Formulas, second: SecondKind, i: int) -> Node:
    free = [f.coordinates[j] for j in second.partition.independent]
    if any(c.rheonomic for c in f.equations.constraints):
        free.append(Symbol("t"))
    letter, _ = f.notation.before_names(("R", "R"), ("F", "F"), ("G", "G"), ("W", "W"))
    name = f"{letter}_{f.model.coordinate_names[i]}"
    return Call(name, tuple(free)) if free else Symbol(name)


def _solution_lines(f: Formulas, second: SecondKind, s: Solution) -> list[Line]:
    place = {x: x.name for x in f.equations.q}
    symbol = Symbol(place[s.unknown])
    if s.angle is None or s.sine is None or s.cosine is None:
        return [Line((symbol, f.arrange(s.value)))]
    angle = f.arrange(s.angle)
    lines = []
    for function, value in (("sin", s.sine), ("cos", s.cosine)):
        note = None
        if s.sign and _has_root(value):
            at_start = number(value, second.partition.values)
            note = f"{'positive' if at_start > 0 else 'negative'} at the start"
        lines.append(Line((Call(function, (angle,)), f.arrange(value)), note=note))
    if second.lagrangian_uses(s.unknown):
        lines.append(Line((symbol, f.arrange(s.value))))
    return lines


def _has_root(value: Basic) -> bool:
    return any(
        isinstance(x.args[1], se.Rational) and not isinstance(x.args[1], se.Integer)
        for x in value.atoms(se.Pow)
    )


def _velocities(f: Formulas, second: SecondKind) -> Step | None:
    lines = []
    e = f.equations
    moving = {e.v[i] for i in second.partition.dependent} | {s.unknown for s in second.inserted}
    for rate in second.partition.rates:
        sides = [velocity(f.coordinates[rate.coordinate]), rate_node(f, rate)]
        above, below = rate.over(e.v)
        changes = moving & (above.free_symbols | below.free_symbols)
        if changes and not second.is_long:
            explicit = f.arrange(second.rates[rate.coordinate])
            if weight(explicit) < _LONG_RATE and explicit not in sides:
                sides.append(explicit)
        lines.append(Line(tuple(sides)))
    if not lines:
        return None
    lead = "Solving the differentiated constraints for the dependent velocities gives"
    return Step("Dependent velocities", tuple(lines), lead=lead)


_LONG_RATE = 160


def _lagrangian(f: Formulas, second: SecondKind) -> Step:
    signs = general.Signs(f.model)
    first = energy_sides(f)
    sides: list[Node] = [signs.lagrangian]
    if f.model.kinetic is not None:
        sides.append(sum_of([(1, signs.kinetic), (-1, signs.potential)]))
    sides.append(first)
    remark = None
    if second.partition.dependent:
        if second.is_long:
            sides[-1] = abridged(IndexForm(f.model).sums(first))
            remark = "The dependent coordinates and velocities are the functions given above."
        else:
            inserted = _inserted(f, second, first)
            sides += [inserted] if inserted != first else []
            remark = "This is L in the independent coordinates and velocities (8.89)."
            if second.named:
                remark += " Its dependent coordinates are the functions given above."
    lead = "Substituting these into L gives" if second.partition.dependent else None
    return Step("Lagrangian of the second kind", (Line(tuple(sides)),), remark, lead=lead)


def _inserted(f: Formulas, second: SecondKind, first: Node) -> Node:
    """Return L with the dependent coordinates replaced, in the original structure if that is
    short."""
    values: dict[Node, Node] = {}
    for i, rate in second.rates.items():
        values[velocity(f.coordinates[i])] = f.arrange(rate)
    for solution in second.inserted:
        symbol = Symbol(solution.unknown.name)
        if solution.sine is not None and solution.cosine is not None:
            angle = f.arrange(solution.angle)
            values[Call("sin", (angle,))] = f.arrange(second.reduced(solution.sine))
            values[Call("cos", (angle,))] = f.arrange(second.reduced(solution.cosine))
        else:
            values[symbol] = f.arrange(second.reduced(solution.value))
    kept = substituted(first, values)
    arranged = f.arrange(second.lagrangian)
    if kept is None:
        return arranged
    gone = {f.model.coordinate_names[i] for i in second.partition.dependent}
    gone -= {f.model.coordinate_names[i] for i in second.named}
    left = set(symbols_in([kept])) & (gone | set(f.model.definitions))
    moving = {n.name for n in _dotted(kept)}
    if left or moving & {f.model.coordinate_names[i] for i in second.partition.dependent}:
        return arranged
    return kept if weight(kept) <= _KEPT * weight(arranged) else arranged


def _dotted(node: Node) -> list[Symbol]:
    dotted, stack = [], [node]
    while stack:
        item = stack.pop()
        if isinstance(item, Symbol) and item.dots:
            dotted.append(item)
        stack.extend(children(item))
    return dotted


def _second_derivatives(f: Formulas, second: SecondKind) -> list[Step]:
    """Return ∂L/∂q_k, ∂L/∂q̇_k and d/dt ∂L/∂q̇_k; none if they are long."""
    p = second.partition
    if second.is_long or operations(second.forcing) > LONGEST or not p.independent:
        return []
    lagrangian = general.Signs(f.model).lagrangian
    free = [f.coordinates[i] for i in p.independent]
    by_velocity = [Partial(lagrangian, velocity(x)) for x in free]
    return [
        Step(
            f"{title} of the second kind",
            tuple(Line((x, f.arrange(y))) for x, y in zip(left, right, strict=True)),
        )
        for title, left, right in (
            ("Partial derivatives", [Partial(lagrangian, x) for x in free], second.gradient),
            ("Momenta", by_velocity, second.momenta),
            ("Total time derivatives", [Rate(x) for x in by_velocity], second.momentum_rates),
        )
    ]


def _second_equations(f: Formulas, second: SecondKind, full: bool) -> list[Step]:
    p = second.partition
    if not p.independent:
        return [Step(SECOND, (), _NONE)]
    free = [f.coordinates[i] for i in p.independent]
    if second.is_long and not full and second.entries > _ENTRIES:
        return [_unlisted(f, SECOND)]
    if _in_matrices(second):
        return in_matrices(f, second.mass_matrix, second.forcing, free, SECOND, full)
    lines = []
    for k, x in enumerate(free):
        left = f.arrange(second.momentum_rates[k] - second.gradient[k])
        lines.append(Line((left, f.arrange(second.applied_forces[k])), x))
    return [Step(SECOND, tuple(lines), _law_remark(second))]


def _in_matrices(second: SecondKind) -> bool:
    """Whether the equations of motion are too long to be written out."""
    return second.is_long or operations(second.forcing) > LONGEST


def _longest(r: VelocityRatios) -> int:
    """Return the largest number of operations of a formula, also of what is shown in parts."""
    parts = [*r.ratios.values(), *r.derivatives.values()]
    return max(map(operations, [*parts, [r.inertia_rate], [r.force]]))


def _ratio_steps(f: Formulas, r: VelocityRatios) -> list[Step]:
    """Return the equation of motion of one degree of freedom with velocity ratios."""
    k, inertia = _ratio_signs(f)
    rate_of_k, rate_of_inertia = (Sign(f"{x.text}′", f"{x.latex}'") for x in (k, inertia))
    named: dict[str, Node] = {}
    for sign, names in ((k, r.names), (rate_of_k, r.derivative_names)):
        for i, symbol in sorted(names.items()):
            f.arrange(symbol)  # names are written in the order in which they first occur
            named[symbol.name] = Entry(sign, (f.coordinates[i],))

    def shown(node: Node) -> Node:
        if isinstance(node, Symbol) and node.name in named:
            return named[node.name]
        return rebuilt(node, shown)

    def lines(names: Mapping[int, Basic], values: Mapping[int, tuple[Basic, Basic]]) -> list[Line]:
        return [
            Line((named[names[i].name], shown(fraction(f, *value)))) for i, value in values.items()
        ]

    free = f.coordinates[r.independent]
    free_velocity, acceleration = velocity(free), Symbol(free.name, 2)
    square = Power(free_velocity, whole(2))
    half = Number(Fraction(1, 2))
    terms = [
        (1, product_of([inertia, acceleration])),
        (1, product_of([half, rate_of_inertia, square])),
    ]
    force = shown(f.arrange(r.force))
    lead = (
        f"A dependent coordinate has the velocity ratio {k.text}, its derivative with respect to"
        " the independent one. The differentiated constraints give"
    )
    rates = "The constraints differentiated twice give"
    moments = [Line((inertia, shown(f.arrange(r.inertia))))]
    if r.inertia_rate != 0:
        moments.append(Line((rate_of_inertia, shown(f.arrange(r.inertia_rate)))))
    equation = Line((sum_of(terms if r.inertia_rate != 0 else terms[:1]), force), free)
    remark = (
        f"{inertia.text} is the mass that has the kinetic energy of all bodies at the velocity of"
        " the independent coordinate; the right side is the sum of all generalized and potential"
        " forces, each times the velocity ratio of its coordinate."
    )
    return [
        Step("Velocity ratios", tuple(lines(r.names, r.ratios)), lead=lead),
        Step(_RATES_OF_RATIOS, tuple(lines(r.derivative_names, r.derivatives)), lead=rates),
        Step(ENTRIES_OF_ONE, tuple(moments)),
        Step(SECOND, (equation,), remark),
    ]


def _ratio_signs(f: Formulas) -> tuple[Sign, Sign]:
    """Return letters of velocity ratios and of the inertia that the model does not use."""
    letters = {letter(name) for name in f.notation.declared}
    ratios = ("k", "κ", "ρ", "n", "w")
    ratio = next((x for x in ratios if x not in letters), ratios[0])
    inertias = "JIAKHU"
    inertia = next((x for x in inertias if x not in letters), inertias[0])
    return Sign(ratio, LATEX_GREEK.get(ratio, ratio)), Sign(inertia, inertia)


def _law_remark(second: SecondKind) -> str | None:
    if all(x == 0 for x in second.applied_forces):
        return None
    return "The right sides are the generalized forces projected onto the independent coordinates."


#: Largest number of abbreviations of M and f that are listed, and of entries that are derived.
_MANY, _ENTRIES = 120, 240


def projected(f: Formulas) -> tuple[Line, ...]:
    """Return Jᵀ M J q̈ = Jᵀ (f − M c) for equations of motion that are too long to list."""
    signs = general.Signs(f.model)
    j, m, force, c = signs.null_space, signs.mass_matrix, signs.forcing, signs.drift
    left = Sign(
        f"{j.text}ᵀ {m.text} {j.text} q̈",
        rf"{j.latex}^{{\mathrm{{T}}}} {m.latex} {j.latex} \, \ddot{{q}}",
    )
    right = Sign(
        f"{j.text}ᵀ ({force.text} − {m.text} {c.text})",
        rf"{j.latex}^{{\mathrm{{T}}}} ({force.latex} - {m.latex} {c.latex})",
    )
    return (Line((left, right)),)


def _unlisted(f: Formulas, title: str) -> Step:
    """Return the equations of motion whose entries are too many or too long to list."""
    signs = general.Signs(f.model)
    said = (
        f"{signs.mass_matrix.text} and {signs.forcing.text} are those of all coordinates; all"
        f" accelerations are {signs.null_space.text} times the independent ones plus"
        f" {signs.drift.text}. The entries are long; --full and --format json give them."
    )
    return Step(title, projected(f), said)


def in_matrices(
    f: Formulas,
    mass_matrix: Sequence[Sequence[Basic]],
    forcing: Sequence[Basic],
    free: Sequence[Symbol],
    title: str,
    full: bool,
) -> list[Step]:
    """Return M a = f entry by entry, with abbreviations."""
    signs = general.Signs(f.model)
    mass, force = signs.mass_matrix, signs.forcing
    entries: list[tuple[Node, Basic]] = []
    for i, row in enumerate(mass_matrix):
        entries += [
            (Entry(mass, (free[i], free[j])), x) for j, x in enumerate(row) if j >= i and x != 0
        ]
    entries += [(Entry(force, (free[i],)), x) for i, x in enumerate(forcing) if x != 0]
    names = (*f.model.coordinate_names, *f.model.parameters, *f.model.definitions)
    listed = full or len(entries) <= _ENTRIES
    short = abbreviate([x for _, x in entries], names) if listed else None
    law = Line((Sign(f"{mass.text} q̈", rf"{mass.latex} \, \ddot{{q}}"), force))
    remark = (
        f"The equations are long: entries of {mass.text} and {force.text} are named by the"
        f" independent coordinates and given with abbreviations. {mass.text} is symmetric."
    )
    if short is None or (len(short.named) > _MANY and not full):
        return [_unlisted(f, title)]
    f.in_order(short.named)
    short = without_single_uses(short, f.arrange)
    named = tuple(Line((Symbol(name), f.arrange(x))) for name, x in short.named.items())
    steps = [Step(title, (law,), remark)]
    if named:
        steps.append(Step(ABBREVIATIONS, named, packed=True))
    pairs = zip(entries, short.expressions, strict=True)
    lines = tuple(Line((entry, f.arrange(x))) for (entry, _), x in pairs)
    return [*steps, Step(ENTRIES, lines)]


def maggi_steps(f: Formulas, maggi: Maggi, full: bool) -> list[Step]:
    """Return the steps of Maggi's equations, from the dependent velocities on."""
    p, e = maggi.partition, f.equations
    steps: list[Step] = []
    if p.rates:
        lines = tuple(
            Line((velocity(f.coordinates[rate.coordinate]), rate_node(f, rate))) for rate in p.rates
        )
        lead = "Solving the velocity constraints gives"
        steps.append(Step("Dependent velocities", lines, lead=lead))
        lines = tuple(displacement_line(f, rate) for rate in p.rates)
        signs = general.Signs(f.model)
        remark = (
            f"The coefficients are the rows of {signs.null_space.text}, whose columns span the null"
            f" space of {signs.constraint_matrix.text}."
        )
        steps.append(Step("Dependent virtual displacements", lines, remark))
    if not p.independent:
        return [*steps, Step(MAGGI, (), _NONE)]
    residuals = [
        rate - slope - force
        for rate, slope, force in zip(e.momentum_rates, e.gradient, e.applied_forces, strict=True)
    ]
    if operations(maggi.equations_of_motion) > 3 * LONGEST:
        free = [f.coordinates[i] for i in p.independent]
        return [*steps, *in_matrices(f, maggi.mass_matrix, maggi.forcing, free, MAGGI, full)]
    equations = []
    for k, i in enumerate(p.independent):
        terms = [(1, f.arrange(residuals[i]))]
        for j in p.dependent:
            if k in p.null_space[j] and residuals[j] != 0:
                residual = f.arrange(residuals[j])
                if isinstance(residual, Sum) and len(residual.terms) > 1:
                    factor = _entry_of_null_space(f, maggi, j, k)
                    terms.append((1, product_of([factor, residual])))
                else:
                    terms.append((1, f.arrange(p.null_space[j][k] * residuals[j])))
        equations.append(Line((sum_of(terms), whole(0)), f.coordinates[i]))
    law = Line((_maggi_law(f), whole(0)))
    count, r = len(equations), len(p.constraints)
    remark = (
        f"Together with the {f'{r} constraints' if r > 1 else 'constraint'}, these are {count + r}"
        f" equations for {len(e.q)} unknowns, without multipliers."
        if r
        else "There are no constraints."
    )
    return [*steps, Step(MAGGI, (law, *equations), remark)]


def _entry_of_null_space(f: Formulas, maggi: Maggi, i: int, k: int) -> Node:
    p = maggi.partition
    rate = next(r for r in p.rates if r.coordinate == i)
    j = p.independent[k]
    if not set(rate.numerators) & set(p.dependent):
        return fraction(f, rate.numerators[j], rate.denominator)
    return f.arrange(p.null_space[i][k])


def _maggi_law(f: Formulas) -> Node:
    signs = general.Signs(f.model)
    lagrangian, rows = signs.lagrangian, signs.null_space
    inner = sum_of(
        [
            (1, Rate(Partial(lagrangian, Sign("q̇ᵢ", r"\dot{q}_i")))),
            (-1, Partial(lagrangian, Sign("qᵢ", "q_i"))),
            (-1, signs.force),
        ]
    )
    factor = Sign(f"Σᵢ {rows.text}_ik", rf"\textstyle\sum_i {rows.latex}_{{ik}}")
    return product_of([factor, inner])


def solved_step(f: Formulas, unknowns: list[SolvedUnknown], kind: str, redundant: bool) -> Step:
    """Return λ and the accelerations in closed form, or a remark why they are omitted."""
    title = f"Solved for the unknowns ({kind})"
    parts = [f.arrange(x) for s in unknowns for x in (s.numerator, s.denominator)]
    if not unknowns or max(map(weight, parts)) > _LONGEST_SOLUTION:
        reason = "λ is not unique, because constraints are redundant"
        remark = (
            f"The closed form is omitted: {reason if redundant else 'it is long'}."
            " simulate eliminates λ and solves for the accelerations numerically at every step."
        )
        return Step(title, (), remark)
    nodes = {x.name: Symbol(c.name, 2) for x, c in zip(f.equations.a, f.coordinates, strict=True)}
    for symbol, c in zip(f.equations.multipliers, f.equations.constraints, strict=True):
        nodes[symbol.name] = Symbol(c.constraint.name, kind="multiplier")
    whole_fractions = [fraction(f, s.numerator, s.denominator) for s in unknowns]
    if max(map(weight, whole_fractions)) <= _LONG_FRACTION:
        pairs = zip(unknowns, whole_fractions, strict=True)
        return Step(title, tuple(Line((nodes[s.unknown.name], x)) for s, x in pairs))
    return Step(title, tuple(_over_determinants(f, unknowns, nodes)))


_LONGEST_SOLUTION = 160  # largest numerator or denominator that is shown, characters
_LONG_FRACTION = 70  # characters of a fraction above which its denominator is named
_SHORT_DIVISOR = 8  # largest denominator that remains in a fraction, characters


def _over_determinants(
    f: Formulas, unknowns: list[SolvedUnknown], nodes: dict[str, Symbol]
) -> list[Line]:
    """Return fractions as products with 1/Δ, which can be broken, and the definitions of Δ."""
    below: dict[Node, Sign] = {}
    letters = {letter(name) for name in f.notation.declared}
    name = next((x for x in "ΔDNUW" if x not in letters), "Δ")
    lines = []
    for s in unknowns:
        sign, divisor = forward(f.arrange(s.denominator))
        inverse = quotient_of(whole(1), divisor)
        if weight(divisor) > _SHORT_DIVISOR and divisor not in below:
            n = len(below) + 1
            below[divisor] = Sign(
                f"{name}{n}".translate(_SUBSCRIPTS), f"{LATEX_GREEK.get(name, name)}_{{{n}}}"
            )
        if divisor in below:
            inverse = quotient_of(whole(1), below[divisor])
        value = product_of([inverse, f.arrange(s.numerator)])
        lines.append(Line((nodes[s.unknown.name], sum_of([(sign, value)]))))
    return [*(Line((sign, divisor)) for divisor, sign in below.items()), *lines]


_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
