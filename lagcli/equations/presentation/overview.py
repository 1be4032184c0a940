"""Overview of a model: coordinates, constraints, equations of motion, sign convention."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

from lagcli.equations.derivation.integrability import integrable
from lagcli.equations.derivation.lagrange import ConstraintEquation, Equations
from lagcli.equations.presentation import formulas as general
from lagcli.equations.presentation.extent import ROOM, Extent, abridged, is_large
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.presentation.index_form import IndexForm
from lagcli.equations.presentation.matrices import Matrices
from lagcli.equations.presentation.switching import (
    as_inequality,
    contacts_step,
    events_step,
    is_friction,
)
from lagcli.equations.typesetting.nodes import Call, Line, Node, Sign, Step, Symbol, sum_of, whole
from lagcli.equations.typesetting.notation import SUPERSCRIPTS, unit_text
from lagcli.model.expression.units import plain_notation, si_notation
from lagcli.model.model import WEIGHT
from lagcli.model.result_units import given_units
from lagcli.prose import counted


def overview(f: Formulas, full: bool = False) -> tuple[Step, ...]:
    """Return the overview of a system.

    Parameters
    ----------
    f : Formulas
        Formulas of the system.
    full : bool
        Whether to write everything out, regardless of length; see
        `lagcli.equations.presentation.extent`.

    Returns
    -------
    tuple of Step
        Coordinates, constraints, degrees of freedom, equations of motion, sign convention.
    """
    if in_matrices(f, full):
        return in_short(f)
    steps = _written_out(f)
    shown = steps if full else Extent(f).shortened(IndexForm(f.model).steps(steps))
    return many_parameters_last(shown)


def in_matrices(f: Formulas, full: bool = False) -> bool:
    """Whether the equations are shown as matrices with abbreviations instead of written out."""
    if full:
        return False
    if is_large(f.equations):
        return True
    extent = Extent(f)
    written = IndexForm(f.model).steps(_written_out(f))
    whole, longest = extent.size(written), extent.longest(written)
    if whole <= ROOM or longest <= _READABLE:
        return False
    return extent.size(_before(f)) + Matrices(f).size < _SHORTER * whole


def in_short(f: Formulas, remark: str = "") -> tuple[Step, ...]:
    """Return the overview with M, f, B and γ as lists of abbreviated entries."""
    extent, last = Extent(f), convention(f)
    before = extent.shortened(_before(f), _BEFORE)
    room = ROOM - extent.size([*before, last])
    matrices = Matrices(f)
    if len(matrices.entries) > room or matrices.size > room:  # each takes at least a line
        matrices = Matrices(f, ("M", "f", "B"))
    law, *others = matrices.steps(room)
    said = remark or "The equations are long; --full writes them out."
    return (*before, replace(law, remark=f"{law.remark} {said}"), *others, last)


#: Fraction of lines that matrices must save to be used.
_SHORTER = 0.5
#: Number of lines of a formula that is short enough without abbreviations.
_READABLE = 8
_BEFORE = 150  # maximum number of lines before the matrices


def _before(f: Formulas) -> list[Step]:
    steps = [
        _coordinates(f),
        inputs_step(f),
        _all_definitions(f),
        _energies(f),
        constraints_step(f, False),
        contacts_step(f),
        events_step(f),
        freedom_step(f),
    ]
    return IndexForm(f.model).steps([step for step in steps if step is not None])


def before_equations(f: Formulas) -> list[Step]:
    """Return coordinates, energies and constraints, without the degrees of freedom."""
    first, *others = [step for step in _before(f) if step.title != _FREEDOM]
    parameters = parameters_step(f)
    return [first, *([parameters] if parameters is not None else []), *others]


_FREEDOM = "Degrees of freedom"
_PARAMETERS = "Parameters"
_CONVENTION = "Sign convention"
_FEW = 12  # largest number of parameters that are listed before the equations
_SHOWN = 12  # largest number of listed components that hold identically


@lru_cache(maxsize=1)  # used twice: measured, then printed
def _written_out(f: Formulas) -> list[Step]:
    constraints, equations = constraints_step(f), _equations(f)
    contacts, events = contacts_step(f), events_step(f)
    shown = [step for step in (equations, constraints, contacts, events) if step is not None]
    steps = [_coordinates(f), parameters_step(f), inputs_step(f), _definitions(f, shown)]
    steps += [constraints, contacts, events, freedom_step(f), equations]
    return [*(step for step in steps if step is not None), convention(f)]


def quantities(f: Formulas) -> list[Step]:
    """Return the coordinates, and the parameters with their values."""
    steps = (_coordinates(f), parameters_step(f))
    return [step for step in steps if step is not None]


def _all_definitions(f: Formulas) -> Step | None:
    lines = f.all_definition_lines()
    return Step("Definitions", lines) if lines else None


def _energies(f: Formulas) -> Step:
    signs, trees = general.Signs(f.model), f.model.trees
    stated = {"T": signs.kinetic, "V": signs.potential, "L": signs.lagrangian}
    index_form = IndexForm(f.model)
    lines = [
        Line((sign, abridged(index_form.sums(f.written(trees[key])))))
        for key, sign in stated.items()
        if key in trees
    ]
    return Step("Energies", tuple(lines))


def kind_of(c: ConstraintEquation, equations: Equations) -> str:
    """Return the kind of a constraint: holonomic or nonholonomic, scleronomic or rheonomic."""
    time = "rheonomic" if c.rheonomic else "scleronomic"
    if c.constraint.sign:
        return f"unilateral, {time}"
    if c.constraint.from_sign:
        return f"{c.constraint.description}: it sticks or slips"
    if c.constraint.of_coordinate:
        without = " without constraint forces" if c.constraint.projected else ""
        return f"the equation of a first-order coordinate{without}; its multiplier is 0"
    if c.position is not None:
        return f"holonomic, {time}"
    if c.constraint.kind == "nonlinear":
        return f"nonlinear in the velocities, {time}"
    integrability = integrable(c, equations)
    if integrability:
        return f"nonholonomic in form, but integrable by itself; {time}"
    return f"nonholonomic, {time}" + (
        " (integrability not tested)" if integrability is None else ""
    )


def convention(f: Formulas) -> Step:
    """Return the general equations, which define the sign of λ (8.85)."""
    lines = [Line(general.law(f.model))]
    coefficients = general.coefficients(f.equations)
    for kind, definitions in coefficients.items():
        note = f"for {kind} constraints" if len(coefficients) > 1 else None
        first, *others = definitions
        lines += [Line(first, note=note), *map(Line, others)]
    remark = None
    if f.equations.constraints:
        signs = general.Signs(f.model)
        remark = (
            "λ has the sign of the general equations (8.85); lhs and rhs are the sides of"
            f" constraint {signs.row} as written."
        )
        if any(
            c.constraint.kind == "nonlinear" and not c.constraint.of_coordinate
            for c in f.equations.constraints
        ):
            remark += (
                " Chetaev's rule, a postulate, puts the force of a constraint that is nonlinear in"
                f" the velocities along ∂{signs.velocity_residual}/∂q̇; such a force may do work."
            )
    return Step(_CONVENTION, tuple(lines), remark)


def _coordinates(f: Formulas) -> Step:
    lines = []
    for symbol, c in zip(f.coordinates, f.model.coordinates, strict=True):
        unit = f"[{c.unit}]" if c.unit else None
        note = " ".join(part for part in (c.description, unit) if part)
        lines.append(Line((symbol,), note=note or None))
    # a list of names without descriptions is printed side by side
    packed = len(lines) > 6 and not any(line.note for line in lines)
    count = general.Signs(f.model).coordinate_count
    return Step(f"Coordinates: {count} = {len(lines)}", tuple(lines), packed=packed)


def parameters_step(f: Formulas) -> Step | None:
    """Return the parameters with their values, as given and in SI."""
    lines = []
    given = {} if f.values else given_units(f.model)
    for p in f.model.parameters.values():
        if p.name.endswith(WEIGHT):
            continue
        unit = p.unit or f.model.units.of(p.name)  # the second follows, of expressions
        si = quantity(p.value, si_notation(unit) if unit else None)
        sides = [Symbol(p.name), si]
        if p.name in given:
            unit, factor = given[p.name]
            sides.insert(1, quantity(p.value / factor, unit))
        lines.append(Line(tuple(sides), note=p.description))
    # values without a meaning fit side by side; so do the others where there are many
    families = any("[" in name for name in f.model.parameters)
    packed = not families and (len(lines) > _FEW or not any(line.note for line in lines))
    return Step(_PARAMETERS, tuple(lines), packed=packed) if lines else None


def many_parameters_last(steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return steps in which a long list of parameters follows the equations of motion.

    The sign convention stays the last step.
    """
    values = [s for s in steps if s.title == _PARAMETERS and s.packed and len(s.lines) > _FEW]
    others = [s for s in steps if s not in values]
    last = len(others) - (bool(others) and others[-1].title == _CONVENTION)
    return (*others[:last], *values, *others[last:])


def quantity(value: float, unit: str | None) -> Sign:
    """Return a number with its unit: 9.81 m/s²."""
    mantissa, _, power = f"{value:.6g}".replace("-", "−").partition("e")
    text, latex = mantissa, mantissa.replace("−", "-")
    if power:
        exponent = int(power.replace("−", "-"))
        text = f"{text}×10{str(exponent).translate(SUPERSCRIPTS)}".removeprefix("1×")
        latex = rf"{latex} \times 10^{{{exponent}}}".removeprefix(r"1 \times ")
    if unit in (None, "", "1"):
        return Sign(text, latex)
    unit = plain_notation(unit)
    text += f" {unit_text(unit)}"
    shown = re.sub(r"[^\W\d]+", lambda m: rf"\mathrm{{{m[0]}}}", unit)
    shown = re.sub(r"\^(-?\d+)", r"^{\1}", shown).replace("*", r" \cdot ")
    return Sign(text, latex + r" \, " + shown)


def inputs_step(f: Formulas) -> Step | None:
    """Return the known functions of time; None if there are none."""
    lines = []
    for x in f.model.inputs.values():
        times, origin = x.data.times, f" of {x.data.file}" if x.data.file else ""
        unit = f"[{si_notation(x.data.unit)}]" if x.data.unit else ""
        table = (
            f"{_CURVES[x.interpolation]} {counted(len(times), 'row')}{origin},"
            f" {times[0]:g} to {times[-1]:g} s"
        )
        outside = {"hold": ", constant outside", "periodic": ", periodic"}.get(x.extend or "", "")
        note = " ".join(part for part in (x.description, unit) if part)
        note += ("; " if note else "") + table + outside
        lines.append(Line((Call(x.name, (Symbol("t"),)),), note=note))
    return Step("Known functions of time", tuple(lines)) if lines else None


_CURVES = {"step": "steps at", "linear": "lines between", "cubic": "spline through"}


def _definitions(f: Formulas, shown: list[Step]) -> Step | None:
    nodes = [side for step in shown for line in step.lines for side in line.sides]
    lines = f.definition_lines(f.equations.constraints, nodes)
    return Step("Definitions used below", lines) if lines else None


def constraints_step(f: Formulas, variations: bool = True) -> Step | None:
    """Return the constraints with their kinds and virtual displacements; None if there are none."""
    constraints = f.equations.constraints
    if not constraints:
        return None
    lines = []
    for c in constraints:
        if is_friction(c):
            continue
        note = kind_of(c, f.equations)
        line = Line(f.constraint_line(c).sides, c.constraint.name, note)
        lines.append(as_inequality(line, c))
        if variations and c.constraint.limit is None:
            lines.append(as_inequality(f.variation_line(c), c))
    count = general.Signs(f.model).constraint_count
    left_out = f.model.left_out
    remark = None
    if left_out:
        those = ", ".join(left_out[:_SHOWN]) + (", …" if len(left_out) > _SHOWN else "")
        remark = f"Omitted, because they hold for all values of the coordinates: {those}."
    number = sum(not is_friction(c) for c in constraints)
    return Step(f"Constraints: {count} = {number}", tuple(lines), remark)


def short_constraints_step(f: Formulas) -> Step | None:
    """Return the constraints, without virtual displacements that are too long to be read."""
    step = constraints_step(f)
    if step is None or Extent(f).longest([step]) <= _READABLE:
        return step
    step = constraints_step(f, variations=False)
    assert step is not None
    said = "The virtual displacements are long; lagcli derive --full writes them out."
    return replace(step, remark=" ".join(x for x in (step.remark, said) if x))


def freedom_step(f: Formulas) -> Step:
    """Return the degrees of freedom with the redundant constraints."""
    freedom = f.freedom
    k, r = len(f.coordinates), freedom.constraints
    signs = general.Signs(f.model)
    all_of, held = (Sign(x, x) for x in (signs.coordinate_count, signs.constraint_count))
    if not r:
        alone = None if freedom.held is None else "no constraint is active at the start"
        return Step(_FREEDOM, (Line((all_of, whole(k)), note=alone),))
    less, subtracted = held, r
    note = "the constraints are independent at the start"
    if freedom.held is not None:
        note = f"active at the start: {', '.join(freedom.held)}"
    if freedom.rank is None:
        note = "for independent constraints"
    elif freedom.rank < r:
        less, subtracted = signs.rank, freedom.rank
        note = f"at the start; {held.text} = {r}"
    sides: tuple[Node, ...] = (
        sum_of([(1, all_of), (-1, less)]),
        sum_of([(1, whole(k)), (-1, whole(subtracted))]),
        whole(freedom.degrees),
    )
    if freedom.held is not None:  # fewer than the listed constraints
        sides = sides[1:]
    remark = " ".join(freedom.remarks) or None
    return Step(_FREEDOM, (Line(sides, note=note),), remark)


def _equations(f: Formulas) -> Step:
    lines = tuple(f.equation_line(i) for i in range(len(f.coordinates)))
    return Step("Equations of motion", lines)
