"""Impacts, friction and limits of constraints; dry friction in forces and in D."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.columns import SLIP
from lagcli.model import model as symbols
from lagcli.model.expression.algebra import is_zero, nonlinear_in
from lagcli.model.expression.constants import cases, number, relation
from lagcli.model.expression.functions import KINKS, apply, derivative
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.keys import LIMIT, keys_of
from lagcli.model.model import SIGN, Constraint, MultiplierLimit, multiplier, velocity
from lagcli.model.names.draft import Draft, Formula, Indices, Parsed
from lagcli.model.names.families import Declaration
from lagcli.model.names.namespace import Allowed
from lagcli.model.spelling import shorten
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import SourceLocation, YamlNode


class _Pair(NamedTuple):
    """The formulas of a static and a kinetic value, which may be the same."""

    static: Formula
    kinetic: Formula


def has_friction(declaration: Declaration) -> bool:
    """Whether the entry of a constraint has the field ``friction``."""
    node = declaration.node
    return isinstance(node, MappingNode) and "friction" in node.entries


def abs_multiplier(constraint: str) -> Basic:
    """Return |λ| of a constraint as an expression of the model."""
    return apply("abs", symbols.multiplier(constraint))


class ContactFields:
    """The fields of one entry besides its equation; reports each error once.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
    fields : mapping of str to Node
    relation : Relation
        The relation of the equation.
    """

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        fields: Mapping[str, YamlNode],
        relation: symbols.Relation,
    ):
        self.draft, self.declaration, self.fields = draft, declaration, fields
        self.what = f"constraint `{declaration.title}`"
        self.unilateral = relation != "="
        self.good = True
        self._check()
        self.restitution = self._formula("restitution")
        self.friction = self._pair("friction")
        self.limit = self._pair("limit", multipliers=True)
        self.active = self._active()

    def fault(self, field: str, kind: str, message: str, help_: str) -> None:
        """Report an error in a field."""
        self.good = False
        self.draft.report.add(kind, message, self.fields[field].location, help_)

    def _check(self) -> None:
        """Report incompatible fields."""
        given, name = self.fields, shorten(self.declaration.title)
        if "restitution" in given and not self.unilateral:
            self.fault(
                "restitution",
                "contradiction",
                f"{self.what} has a restitution, but holds in both directions: it has no impacts",
                "write `>=` or `<=` instead of `=`, or remove `restitution`",
            )
        if "friction" in given and "slip" not in given:
            self.fault(
                "friction",
                "missing-value",
                f"{self.what} has friction, but no `slip`",
                "give the sliding velocity at the contact, as in"
                f" `{name}: {{expr: …, friction: mu, slip: x'}}`",
            )
        if "slip" in given and "friction" not in given:
            self.fault(
                "slip",
                "missing-value",
                f"{self.what} has `slip`, but no friction",
                "give the coefficient of friction, `friction: 0.3`, or remove `slip`",
            )
        if "limit" in given and self.unilateral:
            self.fault(
                "limit",
                "contradiction",
                f"{self.what} is unilateral and has a limit",
                "a limit belongs to a velocity constraint with `=`; friction in a contact is"
                " written `friction: mu, slip: x'`",
            )
        elif "limit" in given and "friction" in given:
            self.fault(
                "limit",
                "contradiction",
                f"{self.what} has both a limit and friction",
                "keep one of them: a limit is that of the constraint itself, friction acts along"
                " its `slip`",
            )

    def _formula(self, field: str, multipliers: bool = False) -> Formula | None:
        node = self.fields.get(field)
        return None if node is None else self._parsed(node, field, f"`{field}`", multipliers)

    def _parsed(self, node: YamlNode, key: str, said: str, multipliers: bool) -> Formula | None:
        what = f"{said} of {self.what}"
        parsed = self.draft.parse(node, what)
        if parsed is None:
            self.good = False
            return None
        self.draft.trees[f"constraints.{self.declaration.title}.{key}"] = parsed.tree
        allowed = Allowed.MULTIPLIERS if multipliers else Allowed.MOTION
        return Formula(self.draft, parsed, what, allowed, self.declaration.indices)

    def _pair(self, field: str, multipliers: bool = False) -> _Pair | None:
        """Return the formulas of a value, or of {static, kinetic}."""
        node = self.fields.get(field)
        if not isinstance(node, MappingNode):
            one = self._formula(field, multipliers)
            return None if one is None else _Pair(one, one)
        both = self.draft.fields(node, f"`{field}` of {self.what}", keys_of(LIMIT))
        missing = [name for name in keys_of(LIMIT) if name not in both]
        if missing:
            self.fault(
                field,
                "missing-value",
                f"`{field}` of {self.what} has no `{missing[0]}`",
                f"write `{field}: {{static: …, kinetic: …}}`, or one value for both",
            )
            return None
        static, kinetic = (
            self._parsed(both[name], f"{field}.{name}", f"the {name} {field}", multipliers)
            for name in keys_of(LIMIT)
        )
        return None if static is None or kinetic is None else _Pair(static, kinetic)

    def _active(self) -> bool:
        node = self.fields.get("active")
        if node is None:
            return True
        help_ = "write `active: false` for a constraint that an event engages"
        stated = self.draft.flag(node, f"`active` of {self.what}", help_)
        self.good = self.good and stated is not None
        return stated is not False

    # of one member

    def complete(self, constraint: Constraint, indices: Indices) -> Constraint | None:
        """Return a constraint with its restitution and its limit; None if they have errors."""
        if not self.good:
            return None
        if self.unilateral and constraint.kind != "holonomic":
            self.good = False
            self.draft.report.add(
                "not-a-position",
                f"{self.what} is an inequality of velocities",
                self.declaration.key.location,
                "`>=` and `<=` apply to positions; write a velocity constraint with `=`, and bound"
                " its"
                " multiplier with `limit`",
            )
            return None
        restitution: Basic | None = None
        if self.unilateral:
            restitution = self._value(self.restitution, "restitution", indices, most=1.0)
            if restitution is None:
                return None
        limit = self._limit(constraint, indices) if self.limit else None
        if not self.good:
            return None
        return constraint._replace(restitution=restitution, limit=limit, active=self.active)

    def _limit(self, constraint: Constraint, indices: Indices) -> MultiplierLimit | None:
        assert self.limit is not None
        if constraint.kind != "nonholonomic":
            nature = (
                "holonomic" if constraint.kind == "holonomic" else "nonlinear in the velocities"
            )
            self.fault(
                "limit",
                "not-a-velocity",
                f"{self.what} has a limit, but is {nature}",
                "only a constraint that is affine in the velocities can slip: differentiate it, as"
                " in `x_A' = x_B'`",
            )
            return None
        static, kinetic = self._both(self.limit, "limit", indices)
        if static is None or kinetic is None:
            return None
        own = symbols.multiplier(constraint.name)
        if own in static.free_symbols | kinetic.free_symbols:
            self.fault(
                "limit",
                "circular",
                f"the limit of {self.what} depends on its own multiplier",
                "use the multiplier of another constraint, such as that of the normal force:"
                " `limit: mu*abs(lambda.floor)`",
            )
            return None
        return MultiplierLimit(static, kinetic, normal_of(self.draft, static, kinetic))

    def slip(self, constraint: Constraint, slipping: Constraint) -> Constraint | None:
        """Return the friction of a constraint, given the constraint of its slip."""
        if self.friction is None or not self.good:
            return None
        if slipping.kind != "nonholonomic":
            kind = "a position" if slipping.kind == "holonomic" else "not affine in the velocities"
            self.fault(
                "slip",
                "not-a-velocity",
                f"`slip` of {self.what} is {kind}",
                "it is the sliding velocity at the contact, such as `x'` or `x' - r*phi'`",
            )
            return None
        static, kinetic = self._both(self.friction, "friction", constraint.indices)
        if static is None or kinetic is None:
            return None
        size = abs_multiplier(constraint.name)
        return slipping._replace(
            name=constraint.name + SLIP,
            limit=MultiplierLimit(static * size, kinetic * size, constraint.name),
            active=self.active,
            description=f"friction of {constraint.name}",
        )

    def _both(self, of: _Pair, field: str, indices: Indices) -> tuple[Basic | None, Basic | None]:
        """Return the static and the kinetic value."""
        static = self._value(of.static, field, indices)
        same = of.kinetic is of.static
        return static, static if same else self._value(of.kinetic, field, indices)

    def _value(
        self, formula: Formula | None, field: str, indices: Indices, most: float | None = None
    ) -> Basic | None:
        """Return a value that must not be negative, as far as the parameters determine it."""
        if formula is None:
            return se.Integer(0) if self.good else None
        value = formula.scalar(indices)
        if value is None:
            self.good = False
            return None
        known = self.draft.names.constants
        symbols_in = value.free_symbols
        if any(s.name not in known for s in symbols_in):
            return value
        x = number(value.xreplace({s: known[s.name]() for s in symbols_in}))
        if x < 0 or (most is not None and x > most):
            bounds = "not be negative" if most is None else f"be between 0 and {most:g}"
            self.fault(
                field,
                "bad-value",
                f"`{field}` of {self.what} is {x:.6g}, and must {bounds}",
                {
                    "restitution": "it is the ratio of the velocities after and before the impact",
                    "friction": "the direction of friction follows from the slip",
                    "limit": "the direction of the force follows from the slip",
                }[field],
            )
            return None
        return value


def normal_of(draft: Draft, static: Basic, kinetic: Basic) -> str | None:
    """Return the constraint to whose |λ| both limits are proportional; None if there is none."""
    symbol = se.Symbol("|lambda|")
    for name in draft.names.constraints:
        if symbols.multiplier(name) not in kinetic.free_symbols:
            continue
        size = abs_multiplier(name)
        slopes = [x.xreplace({size: symbol}).diff(symbol) for x in (static, kinetic)]
        rest = [
            x.xreplace({size: symbol}) - slope * symbol
            for x, slope in zip((static, kinetic), slopes, strict=True)
        ]
        free = set().union(*(x.free_symbols for x in (*slopes, *rest)))
        if all(se.expand(x) == 0 for x in rest) and not any(
            s == symbol or s.name.startswith("lambda.") for s in free
        ):
            return name
    return None


def slip_equation(draft: Draft, fields: Mapping[str, YamlNode], what: str) -> Parsed | None:
    """Parse the field ``slip``; None if it is missing or has an error."""
    node = fields.get("slip")
    return None if node is None else draft.parse(node, f"`slip` of {what}")


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
                kink = apply("sign", sign * s)
                part = -sign * multiplier(row.name) / level
                parts[kink] = cases(relation(">", level, _ZERO), part, kink)
        return {name: x.xreplace(parts) for name, x in outputs.items()} if parts else dict(outputs)


def dry_friction(
    draft: Draft, forces: Mapping[str, Basic], dissipation: Basic | None
) -> SmoothForces:
    """Return the forces without dry friction, and the rows of dry friction.

    A `sign` is dry friction if its argument s is affine in the velocities and smooth, and if it
    occurs in Q as −F ∂s/∂q' sign(s) with the same F for all coordinates, where F is known not to be
    negative. The same holds for `abs` of such an argument that D contains as F |s|, if F does not
    depend on velocities.

    The force −F sign s is that of a constraint s = 0 with the limit F while it slips; as a row it
    also sticks, exactly and without chatter.

    Parameters
    ----------
    draft : Draft
    forces : mapping of str to expression
        Q by coordinate.
    dissipation : expression or None
        D.
    """
    left, rows = dict(forces), list[Constraint]()

    def add(name: str, s: Basic, force: Basic, key: str) -> None:
        rows.append(_row(draft, name, s, force, key, [c.name for c in rows]))
        draft.names.constraints[rows[-1].name] = None

    for name in forces:
        for kink in _kinks(left[name]):
            s = _signed(kink)
            if s is None or not _is_slip(s) or kink not in left[name].atoms(se.Piecewise):
                continue
            force = _force(draft, left, kink, s)
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
        if _nonnegative(force, draft.names.constants):
            dissipation = dissipation.xreplace({kink: _ZERO})
            moving = {x.name for x in _rates(s)}
            name = next(x for x in draft.names.coordinates if velocity(x).name in moving)
            add(name, s, force, "D")
    return SmoothForces(left, dissipation, tuple(rows))


def _kinks(expression: Basic) -> list[Basic]:
    return sorted(expression.atoms(se.Piecewise), key=str)


def _signed(kink: Basic) -> Basic | None:
    """Return s if an expression is sign(s)."""
    condition = kink.args[1]
    if not isinstance(condition, se.StrictLessThan):
        return None
    s = condition.args[1] - condition.args[0]
    return s if apply("sign", s) == kink else None


def _is_abs(kink: Basic) -> bool:
    return bool(apply("abs", kink.args[0]) == kink)


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


def _force(draft: Draft, forces: Mapping[str, Basic], kink: Basic, s: Basic) -> Basic | None:
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
        if _nonnegative(written, draft.names.constants):
            return written
    return None


def _distributed(expression: Basic) -> Basic:
    """Return c (x + y) as c x + c y for a number c, without expanding other products."""
    if isinstance(expression, se.Mul) and len(expression.args) == 2:
        factor, rest = expression.args
        if isinstance(factor, se.Number) and isinstance(rest, se.Add):
            return se.Add(*[factor * x for x in rest.args])
    return expression


def _nonnegative(expression: Basic, known: Mapping[str, Callable[[], Basic]]) -> bool:
    """Return whether an expression is known not to be negative, from its form and its
    parameters."""
    if all(x.name in known for x in expression.free_symbols):
        values = {x: known[x.name]() for x in expression.free_symbols}
        try:
            return number(expression.xreplace(values)) >= 0
        except ValueError:
            return False
    if isinstance(expression, se.Add):
        return all(_nonnegative(x, known) for x in expression.args)
    if isinstance(expression, se.Mul):  # two factors of parameters may both be negative
        fixed = [x for x in expression.args if all(s.name in known for s in x.free_symbols)]
        moving = [x for x in expression.args if x not in fixed]
        return all(_nonnegative(x, known) for x in (se.Mul(*fixed), *moving))
    if isinstance(expression, se.Pow):
        base, exponent = expression.args
        if isinstance(exponent, se.Number) and (
            not isinstance(exponent, se.Integer) or int(exponent) % 2 == 0
        ):
            return True  # a square; a root has no negative value
        return _nonnegative(base, known)
    if isinstance(expression, se.Piecewise):
        cases = expression.args[::2]
        enough = any if apply("max", *cases) == expression else all
        return _is_abs(expression) or enough(_nonnegative(x, known) for x in cases)
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
