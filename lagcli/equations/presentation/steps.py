"""Step-by-step derivation, in the order of the textbook."""

from __future__ import annotations

from collections.abc import Sequence

from lagcli.equations.presentation import formulas as general
from lagcli.equations.presentation.extent import accelerations_are_large
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.overview import inputs_step, kind_of
from lagcli.equations.presentation.switching import (
    as_inequality,
    contacts_step,
    events_step,
    is_friction,
)
from lagcli.equations.presentation.written import differentiated_in
from lagcli.equations.typesetting.nodes import (
    Line,
    Node,
    Partial,
    Rate,
    Step,
    Symbol,
    equal_except_for_order,
    sum_of,
    weight,
)
from lagcli.equations.typesetting.rewriting import substituted
from lagcli.prose import counted


def steps(f: Formulas, coordinates: Sequence[Step] = (), full: bool = False) -> tuple[Step, ...]:
    """Return the derivation of the equations step by step, as in the textbook.

    Parameters
    ----------
    f : Formulas
        Formulas of the system.
    coordinates : sequence of Step
        The sections on independent and dependent coordinates, which follow the constraints.
    full : bool
        Whether long constraints at acceleration level are written out.

    Returns
    -------
    tuple of Step
    """
    signs = general.Signs(f.model)
    shown = [inputs_step(f), _definitions(f), _energies(f, signs)]
    shown += _derivatives(f, signs)
    shown += [_forces(f), _constraints(f), contacts_step(f), events_step(f)]
    shown += [_accelerations(f, full), _variations(f), *coordinates]
    shown += [_unassembled(f, signs), _assembled(f), _closing(f)]
    return tuple(step for step in shown if step is not None)


def before_equations(f: Formulas, full: bool = False) -> list[Step]:
    """Return definitions, energies, forces, constraints and virtual displacements."""
    shown = [inputs_step(f), _definitions(f), _energies(f, general.Signs(f.model)), _forces(f)]
    shown += [_constraints(f), contacts_step(f), events_step(f)]
    shown += [_accelerations(f, full), _variations(f)]
    return [step for step in shown if step is not None]


def _definitions(f: Formulas) -> Step | None:
    """Return the definitions, and the rates of those whose rates the model uses."""
    lines: list[Line] = []
    rates = {name: Line((Symbol(name, 1), x)) for name, x in _rates(f).items()}
    for name, line in zip(f.model.definitions, f.all_definition_lines(), strict=True):
        lines.append(line)
        if name in rates and "[" not in name:
            lines.append(rates[name])
    lines += [line for name, line in rates.items() if "[" in name]  # families by themselves
    return Step("Definitions", tuple(lines)) if lines else None


def _rates(f: Formulas) -> dict[str, Node]:
    """Return the time derivatives of the definitions that T, V or L differentiates."""
    used = {
        x
        for key in ("T", "V", "L")
        if key in f.model.trees
        for x in differentiated_in(f.model.trees[key], f.model)
    }
    return {
        name: f.arrange(general.total_rate(d.value, f.equations))
        for name, d in f.model.definitions.items()
        if name in used
    }


def _energies(f: Formulas, signs: general.Signs) -> Step:
    if f.model.kinetic is None:
        lead = _DEFINED if f.uses_definitions(f.model.trees["L"]) else None
        return Step("Lagrangian", (Line((signs.lagrangian, *_written(f, "L"))),), lead=lead)
    lines = [
        Line((sign, *_written(f, key)))
        for sign, key in ((signs.kinetic, "T"), (signs.potential, "V"))
    ]
    difference = sum_of([(1, signs.kinetic), (-1, signs.potential)])
    lines.append(Line((signs.lagrangian, difference, energy_sides(f))))
    stated = [f.model.trees[x] for x in "TV" if x in f.model.trees]
    lead = _DEFINED if any(map(f.uses_definitions, stated)) else None
    return Step("Kinetic energy, potential energy, Lagrangian", tuple(lines), lead=lead)


_DEFINED = "Substituting the definitions gives the energies in the coordinates."


def _written(f: Formulas, key: str) -> list[Node]:
    """Return T, V or L as written, and with its definitions expanded."""
    e, trees = f.equations, f.model.trees
    expression = {"T": e.kinetic, "V": e.potential, "L": e.lagrangian}[key]
    sides = [f.written(trees[key])] if key in trees else []
    if sides:
        rates: dict[Node, Node] = {Symbol(name, 1): x for name, x in _rates(f).items()}
        inserted = substituted(sides[0], rates)
        if inserted is not None and inserted != sides[0] and weight(inserted) < _LONG:
            sides.append(inserted)
    if key not in trees or f.uses_definitions(trees[key]):
        arranged = f.arrange(expression)
        if not any(equal_except_for_order(arranged, x) for x in sides):
            sides.append(arranged)
    return sides


#: Number of characters of a formula above which it is shown in only one form.
_LONG = 240


def energy_sides(f: Formulas) -> Node:
    """Return L in the coordinates; as written if it contains no definitions."""
    if f.model.kinetic is None:
        return _written(f, "L")[-1]
    return sum_of([(1, _written(f, "T")[-1]), (-1, _written(f, "V")[-1])])


def _derivatives(f: Formulas, signs: general.Signs) -> list[Step]:
    e, lag = f.equations, signs.lagrangian
    q = f.coordinates
    v = [Symbol(x.name, 1) for x in q]
    by_position = [Partial(lag, x) for x in q]
    by_velocity = [Partial(lag, x) for x in v]
    rates = [Rate(p) for p in by_velocity]
    return [
        Step(
            title,
            tuple(
                Line((x, f.arrange(y, own))) for x, y, own in zip(left, right, first, strict=True)
            ),
            lead=lead,
        )
        for title, left, right, first, lead in (
            (
                "Partial derivatives with respect to the coordinates",
                by_position,
                e.gradient,
                e.q,
                f"Differentiating {lag.text} gives",
            ),
            (
                "Partial derivatives with respect to the velocities",
                by_velocity,
                e.momenta,
                e.v,
                None,
            ),
            (
                "Total time derivatives",
                rates,
                e.momentum_rates,
                e.a,
                "Differentiating these along the motion gives",
            ),
        )
    ]


def _forces(f: Formulas) -> Step | None:
    applied = zip(f.coordinates, f.equations.applied_forces, strict=True)
    lines = tuple(Line((general.force(x), f.arrange(q))) for x, q in applied if q != 0)
    if not lines:
        return None
    remark = "From the virtual work of the nonconservative forces (8.78)."
    if f.model.dissipation is not None:
        remark += " The dissipation function contributes minus its partial derivatives"
        remark += " with respect to the velocities."
    return Step("Generalized forces", lines, remark)


def _constraints(f: Formulas) -> Step | None:
    lines: list[Line] = []
    for c in f.equations.constraints:
        name = c.constraint.name
        if is_friction(c):
            continue
        line = Line(f.constraint_line(c).sides, name, kind_of(c, f.equations))
        lines.append(as_inequality(line, c))
        if c.position is not None:
            lines.append(f.rate_line(c))
    if not lines:
        return None
    differentiated = [c.constraint for c in f.equations.constraints if c.position is not None]
    remark = "Each holonomic constraint is followed by its time derivative."
    if any(c.sign for c in differentiated):
        remark = (
            "Each constraint is followed by its time derivative; that of a unilateral constraint is"
            " zero while the contact is closed."
        )
    return Step("Constraints", tuple(lines), remark if differentiated else None)


def _variations(f: Formulas) -> Step | None:
    lines = tuple(
        as_inequality(Line(f.variation_line(c).sides, c.constraint.name), c)
        for c in f.equations.constraints
    )
    if not lines:
        return None
    remark = "Virtual displacements are taken at fixed time (8.79)."
    lead = "Applying δ to the constraints gives"
    return Step("Virtual displacements", lines, remark, lead=lead)


def _accelerations(f: Formulas, full: bool) -> Step | None:
    constraints, title = f.equations.constraints, "Constraints at acceleration level"
    if not constraints:
        return None
    if not full and accelerations_are_large(f.equations):
        return Step(title, (), "They are long; --full writes them out.")
    lines = tuple(Line(f.acceleration_line(c).sides, c.constraint.name) for c in constraints)
    lead = "Differentiating the velocity constraints once more gives"
    lasting = all(c.constraint.lasting for c in constraints)
    remark = None if lasting else "They hold while a contact is closed and while friction sticks."
    return Step(title, lines, remark, lead=lead)


def _unassembled(f: Formulas, signs: general.Signs) -> Step:
    lag = signs.lagrangian
    lines = []
    for i, x in enumerate(f.coordinates):
        left = sum_of([(1, Rate(Partial(lag, Symbol(x.name, 1)))), (-1, Partial(lag, x))])
        lines.append(Line((left, f.right_side(i, forces_named=True))))
    forced = any(q != 0 for q in f.equations.applied_forces)
    law = "(8.85), written with the Lagrangian" if forced else "(8.86)"
    title = "Lagrange's equations of the first kind"
    if not f.equations.constraints:
        title, law = "Lagrange's equations", "without constraints"
    lead = "Multiplying each relation by its λ and adding it to the virtual work gives"
    if not f.equations.constraints:
        lead = "The virtual displacements are independent, which gives"
    return Step(title, tuple(lines), f"Equations {law}.", lead=lead)


def _assembled(f: Formulas) -> Step:
    lines = tuple(Line(f.equation_line(i).sides, x) for i, x in enumerate(f.coordinates))
    return Step("Equations of motion", lines, lead="Substituting the derivatives gives")


def _closing(f: Formulas) -> Step | None:
    constraints = f.equations.constraints
    if not constraints:
        return None
    title = "Together with the constraint equations"
    lines = tuple(
        as_inequality(Line(f.constraint_line(c).sides, c.constraint.name), c)
        for c in constraints
        if not is_friction(c)
    )
    if not all(c.constraint.lasting for c in constraints):
        remark = (
            "Between two events, those that hold determine the accelerations and λ; the conditions"
            " of contact and friction decide which hold."
        )
        return Step(title, lines, remark)
    k, r = len(f.coordinates), len(constraints)
    unknowns = f"{counted(k, 'coordinate')} and {counted(r, 'multiplier')}"
    remark = f"{k + r} equations in {k + r} unknowns: {unknowns}."
    return Step(title, lines, remark)
