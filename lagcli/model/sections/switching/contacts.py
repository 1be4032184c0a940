"""Fields of a constraint on impacts, friction and limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.columns import SLIP
from lagcli.model import model as symbols
from lagcli.model.draft import Draft, Formula, Indices, Parsed
from lagcli.model.expression.constants import number
from lagcli.model.expression.functions import FUNCTIONS
from lagcli.model.keys import LIMIT, keys_of
from lagcli.model.model import Constraint, MultiplierLimit
from lagcli.model.names.families import Declaration
from lagcli.model.spelling import shorten
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Mapping as MappingNode
from lagcli.model.yaml.source import Scalar, YamlNode


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
    return FUNCTIONS["abs"].apply(symbols.multiplier(constraint))


class ContactFields:
    """The fields of one entry besides its equation; reports each error once.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
    fields : mapping of str to Node
    relation : Relation
        The relation of the equation.
    constants : Symbols
        The parameters with their values.
    """

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        fields: Mapping[str, YamlNode],
        relation: symbols.Relation,
        constants: Symbols,
    ):
        self.draft, self.declaration, self.fields = draft, declaration, fields
        self.constants = constants
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
        context = Context(what, multipliers=multipliers)
        return Formula(self.draft, parsed, context, indices=self.declaration.indices)

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
        if isinstance(node, Scalar) and node.value.strip() in ("true", "false"):
            return node.value.strip() == "true"
        self.fault(
            "active",
            "wrong-type",
            f"`active` of {self.what} must be true or false, not {node.what}",
            "write `active: false` for a constraint that an event engages",
        )
        return True

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
        alike = of.kinetic is of.static
        return static, static if alike else self._value(of.kinetic, field, indices)

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
        known = self.constants.parameters
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
