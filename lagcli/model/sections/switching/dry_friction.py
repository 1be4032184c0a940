"""Dry friction: forces with `sign` of a velocity, and D with `abs` of one, as limited rows.

The force −F sign s on the coordinates on which s depends is that of a constraint s = 0 with the
limit F while it slips; as a row it also sticks, exactly and without chatter. D = F |s| has the same
force.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.model.draft import Draft
from lagcli.model.expression.algebra import is_zero, nonlinear_in
from lagcli.model.expression.constants import cases, number, relation
from lagcli.model.expression.functions import FUNCTIONS, KINKS, derivative
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.model import SIGN, Constraint, MultiplierLimit, multiplier, velocity
from lagcli.model.sections.switching.contacts import normal_of
from lagcli.model.symbols import Symbols
from lagcli.model.yaml.source import SourceLocation

_ZERO = se.Integer(0)
_HELD = se.Symbol("\ufdd0sign")


class SmoothForces(NamedTuple):
    """Q by coordinate and D without dry friction, and the rows of dry friction."""

    forces: dict[str, Basic]
    dissipation: Basic | None
    rows: tuple[Constraint, ...]

    def of_forces(self, outputs: Mapping[str, Basic]) -> dict[str, Basic]:
        """Return outputs with the actual friction force instead of each `sign` of a row.

        While a row sticks, sign s is between −1 and 1, such that −F sign s is its force λ.
        """
        parts = {}
        for row in self.rows:
            assert row.limit is not None
            s, level = row.expression, row.limit.kinetic
            for sign in (1, -1):
                kink = FUNCTIONS["sign"].apply(sign * s)
                part = -sign * multiplier(row.name) / level
                parts[kink] = cases(relation(">", level, _ZERO), part, kink)
        return {name: x.xreplace(parts) for name, x in outputs.items()} if parts else dict(outputs)


def dry_friction(
    draft: Draft, forces: Mapping[str, Basic], dissipation: Basic | None, constants: Symbols
) -> SmoothForces:
    """Return the forces without dry friction, and the rows of dry friction.

    A `sign` is dry friction if its argument s is affine in the velocities and smooth, and if it
    occurs in Q as −F ∂s/∂q' sign(s) with the same F for all coordinates, where F is known not to be
    negative. The same holds for `abs` of such an argument that D contains as F |s|, if F does not
    depend on velocities.

    Parameters
    ----------
    draft : Draft
    forces : mapping of str to expression
        Q by coordinate.
    dissipation : expression or None
        D.
    constants : Symbols
        The parameters with their values.
    """
    left, found = dict(forces), list[Constraint]()

    def add(name: str, s: Basic, force: Basic, key: str) -> None:
        found.append(_row(draft, name, s, force, key, [c.name for c in found]))
        draft.names.constraints[found[-1].name] = None

    for name in forces:
        for kink in _kinks(left[name]):
            s = _signed(kink)
            if s is None or not _is_slip(s) or kink not in left[name].atoms(se.Piecewise):
                continue
            force = _force(draft, left, kink, s, constants)
            if force is None:
                continue
            for other in left:
                left[other] = left[other].xreplace({kink: _ZERO})
            add(name, s, force, "Q")
    for kink in () if dissipation is None else _kinks(dissipation):
        assert dissipation is not None
        s = kink.args[0]
        if not _is_abs(kink) or not _is_slip(s):
            continue
        force = derivative(dissipation.xreplace({kink: _HELD}), _HELD)
        if force == _ZERO or _HELD in force.free_symbols or _rates(force):
            continue
        if _nonnegative(force, constants):
            dissipation = dissipation.xreplace({kink: _ZERO})
            moving = {x.name for x in _rates(s)}
            name = next(x for x in draft.names.coordinates if velocity(x).name in moving)
            add(name, s, force, "D")
    return SmoothForces(left, dissipation, tuple(found))


def _kinks(expression: Basic) -> list[Basic]:
    return sorted(expression.atoms(se.Piecewise), key=str)


def _signed(kink: Basic) -> Basic | None:
    """Return s if an expression is sign(s)."""
    condition = kink.args[1]
    if not isinstance(condition, se.StrictLessThan):
        return None
    s = condition.args[1] - condition.args[0]
    return s if FUNCTIONS["sign"].apply(s) == kink else None


def _is_abs(kink: Basic) -> bool:
    return bool(FUNCTIONS["abs"].apply(kink.args[0]) == kink)


def _rates(expression: Basic) -> list[Basic]:
    """Return the velocities in an expression."""
    return sorted((x for x in expression.free_symbols if x.name.endswith("'")), key=str)


def _is_slip(s: Basic) -> bool:
    """Return whether s = 0 can be a row: affine in the velocities, smooth, without inputs."""
    rates = _rates(s)
    if not rates or s.atoms(*KINKS) or nonlinear_in(s, rates) is not None:
        return False
    return not s.atoms(se.FunctionSymbol) and not any(
        x.name.startswith("lambda.") for x in s.free_symbols
    )


def _force(
    draft: Draft, forces: Mapping[str, Basic], kink: Basic, s: Basic, constants: Symbols
) -> Basic | None:
    """Return F of dry friction in Q; None if it is another force."""
    rates = _rates(s)
    force: Basic | None = None
    pairs = []
    for name in draft.names.coordinates:
        slope = draft.names.slope(s, velocity(name)) if velocity(name) in rates else _ZERO
        written = forces.get(name, _ZERO)
        held = written.xreplace({kink: _HELD})
        coefficient = derivative(held, _HELD)
        if _HELD in coefficient.free_symbols:
            return None
        pairs.append((coefficient, slope))
        if force is None and slope != _ZERO:
            force = -coefficient / slope
    if force is None or force == _ZERO:
        return None
    if not all(is_zero(c + force * slope) for c, slope in pairs):
        return None
    for written in (force, _distributed(force), se.expand(force)):
        if _nonnegative(written, constants):
            return written
    return None


def _distributed(expression: Basic) -> Basic:
    """Return c (x + y) as c x + c y for a number c, without expanding other products."""
    if isinstance(expression, se.Mul) and len(expression.args) == 2:
        factor, rest = expression.args
        if isinstance(factor, se.Number) and isinstance(rest, se.Add):
            return se.Add(*[factor * x for x in rest.args])
    return expression


def _nonnegative(expression: Basic, constants: Symbols) -> bool:
    """Return whether an expression is known not to be negative, from its form and its
    parameters."""
    known = constants.parameters
    if all(x.name in known for x in expression.free_symbols):
        values = {x: known[x.name]() for x in expression.free_symbols}
        try:
            return number(expression.xreplace(values)) >= 0
        except ValueError:
            return False
    if isinstance(expression, se.Add):
        return all(_nonnegative(x, constants) for x in expression.args)
    if isinstance(expression, se.Mul):  # two factors of parameters may both be negative
        fixed = [x for x in expression.args if all(s.name in known for s in x.free_symbols)]
        moving = [x for x in expression.args if x not in fixed]
        return all(_nonnegative(x, constants) for x in (se.Mul(*fixed), *moving))
    if isinstance(expression, se.Pow):
        base, exponent = expression.args
        if isinstance(exponent, se.Number) and (
            not isinstance(exponent, se.Integer) or int(exponent) % 2 == 0
        ):
            return True  # a square; a root has no negative value
        return _nonnegative(base, constants)
    if isinstance(expression, se.Piecewise):
        cases = expression.args[::2]
        enough = any if FUNCTIONS["max"].apply(*cases) == expression else all
        return _is_abs(expression) or enough(_nonnegative(x, constants) for x in cases)
    return False


def _row(draft: Draft, name: str, s: Basic, force: Basic, key: str, taken: list[str]) -> Constraint:
    """Return the row of dry friction on a coordinate."""
    left, right = parse_equation(f"{str(s).replace('**', '^')} = 0")
    static = _at_rest(force, s)
    count = sum(x.startswith(name + SIGN) for x in taken)
    return Constraint(
        name + SIGN + (str(count + 1) if count else ""),
        "nonholonomic",
        s,
        left,
        right,
        "dry friction, written as " + ("`sign` in Q" if key == "Q" else "`abs` in D"),
        _location(draft, name, key),
        limit=MultiplierLimit(static, force, normal_of(draft, static, force)),
    )


def _at_rest(force: Basic, s: Basic) -> Basic:
    """Return F at s = 0 if s has one velocity; F as written otherwise."""
    rates = _rates(s)
    if len(rates) > 1 or rates[0] not in force.free_symbols:
        return force
    (v,) = rates
    at = {v: se.expand(v - s / derivative(s, v))}
    abs_of_s = [
        x for x in force.atoms(se.Piecewise) if _is_abs(x) and is_zero(x.args[0].xreplace(at))
    ]
    return se.expand(force.xreplace(dict.fromkeys(abs_of_s, _ZERO)).xreplace(at))


def _location(draft: Draft, name: str, key: str) -> SourceLocation:
    """Return the location of the force on a coordinate, or of D."""
    where = draft.root.entries[key][0].location
    if key == "Q":
        entries = draft.entries("Q") or []
        where = next((at.location for _, at, _ in entries if at.value == name), where)
    return where
