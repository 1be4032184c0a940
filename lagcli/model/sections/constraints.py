"""The constraints, and their kinds; equations of vectors and rotations, component by component."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

import symengine as se
from symengine import Basic

from lagcli.columns import SLIP
from lagcli.model import model as symbols
from lagcli.model.expression.algebra import (
    count_terms,
    expand_terms,
    is_zero,
    kinked_in,
    nonlinear_in,
)
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.expression.tensors import (
    ShapeError,
    Tensor,
    Value,
    kind_of,
    rotation_remedy,
)
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import (
    CallExpr,
    Comparison,
    ComponentExpr,
    NumberExpr,
    ProductExpr,
    Range,
    Tree,
    VectorExpr,
)
from lagcli.model.keys import CONSTRAINT, keys_of
from lagcli.model.model import Constraint, Relation
from lagcli.model.names.draft import NO_INDICES, Draft, Formula, Indices, Parsed
from lagcli.model.names.expansion import expand
from lagcli.model.names.families import Declaration, Member, by_name, expanded
from lagcli.model.names.members import family_of
from lagcli.model.names.scope import uses
from lagcli.model.sections.contacts import ContactFields, has_friction, slip_equation
from lagcli.model.sections.coordinates import unit_length
from lagcli.model.yaml.source import Scalar, Sequence, YamlNode

_EXPANDED = 1000  # largest number of terms of a constraint that is expanded to find cancellations
_EXAMPLE = "x^2 + y^2 = l^2"


def declare_constraints(draft: Draft, declared: list[Declaration]) -> dict[str, Member]:
    """Return the constraints declared by the entries, by name; add the names to the draft."""
    names = draft.names
    families = [d for d in declared if d.spans]
    names.constraint_families = {d.family for d in families}
    names.constraint_families |= {d.family + SLIP for d in families if has_friction(d)}
    members = by_name(draft, expanded(draft, declared))
    for name, member in members.items():
        names.constraints[name] = None
        if has_friction(member.declaration):
            names.constraints[name + SLIP] = None
    return members


def read_constraints(
    draft: Draft, declared: list[Declaration], members: Mapping[str, Member]
) -> tuple[Constraint, ...]:
    """Return the constraints that can be built, each followed by its friction."""
    readers = {id(d): _ConstraintReader(draft, d) for d in declared}
    plain_by_name = {}
    for name, member in members.items():
        plain = plain_by_name[name] = readers[id(member.declaration)].plain(name, member.indices)
        if not plain:
            draft.names.broken_constraints.add(name)
        for c in plain:
            if c.name not in draft.names.constraints:  # a component
                draft.names.constraints.pop(name, None)
                draft.names.constraint_families.add(family_of(c.name))
            draft.names.constraints[c.name] = None
    for reader in readers.values():
        reader.read_fields()  # limits may name components of all constraints
    built_by_entry: dict[tuple[int, str], list[Constraint]] = {}
    for name, member in members.items():
        d = member.declaration
        built = list(readers[id(d)].completed(name, plain_by_name[name], member.indices))
        if not built:
            draft.names.broken_constraints.add(name)
        for c in built:
            part = family_of(c.name) if name not in draft.names.constraints else ""
            built_by_entry.setdefault((id(d), part), []).append(c)
    return tuple(c for rows in built_by_entry.values() for c in rows)


class _ConstraintReader:
    """Reads one entry: its equation, impacts, friction and limits."""

    def __init__(self, draft: Draft, d: Declaration):
        what = f"constraint `{d.title}`"
        self.draft, self.what, self.declaration = draft, what, d
        self.builder: _ConstraintBuilder | None = None
        self.slip: _ConstraintBuilder | None = None
        self.given: Mapping[str, YamlNode] = {}
        if d.kind:
            equation = _Equation(d.key, *unit_length(d))
            self.builder = _ConstraintBuilder(draft, d, what, equation, None)
            return
        node, fields = draft.expression_node(
            d.key, d.node, what, keys_of(CONSTRAINT), example=_EXAMPLE
        )
        description = draft.text(fields.get("description"), f"`description` of {what}")
        read = None if node is None else _equation(draft, node, what)
        if read is None:
            return
        equation = read
        self.builder = _ConstraintBuilder(draft, d, what, equation, description)
        self.given = fields
        if parsed := slip_equation(draft, fields, what):
            slipping = _Equation(parsed.node, parsed.tree, None)
            self.slip = _ConstraintBuilder(draft, d, f"`slip` of {what}", slipping, None)

    def plain(self, name: str, indices: Indices) -> list[Constraint]:
        """Return the constraints of a member, one, or one for each component, without friction."""
        return self.builder.constraints(name, indices) if self.builder else []

    def read_fields(self) -> None:
        """Read impacts, friction and limits, when all constraints are known by name."""
        if self.builder:
            self.fields = ContactFields(
                self.draft, self.declaration, self.given, self.builder.relation
            )

    def completed(
        self, name: str, plain_ones: list[Constraint], indices: Indices
    ) -> Iterator[Constraint]:
        """Yield the constraints of a member with all fields, each followed by its friction."""
        if self.slip and len(plain_ones) > 1:
            self.draft.report.add(
                "shape",
                f"{self.what} is an equation of vectors, and has friction",
                self.declaration.key.location,
                "give the component along the normal a name of its own, with its friction",
            )
            return
        for plain in plain_ones:
            constraint = self.fields.complete(plain, indices)
            if constraint is None:
                return
            yield constraint
            slipping = self.slip.constraints(name, indices) if self.slip else []
            if self.slip and any(s.name != name for s in slipping):
                self.slip.fault(
                    "shape",
                    f"{self.slip.what} must be a scalar, not a vector",
                    "friction acts along one direction, as in `slip: x'`; docs/contact.md shows"
                    " friction in a plane",
                )
                return
            friction = self.fields.slip(constraint, slipping[0]) if slipping else None
            if friction is not None:
                yield friction


class _Equation(NamedTuple):
    """A parsed equation or inequality; without a right side, ``= 0``."""

    node: Scalar
    left: Tree
    right: Tree | None
    relation: Relation = "="


def _equation(draft: Draft, node: YamlNode, what: str) -> _Equation | None:
    if isinstance(node, Sequence):
        node = draft.vector_text(node)
    if not isinstance(node, Scalar) or node.missing:
        draft.report.add(
            "wrong-type",
            f"{what} must be an equation, not {node.what}",
            node.location,
            f"write lhs = rhs, as in `{_EXAMPLE}`",
        )
        return None
    with draft.report.expression(node):
        left, right = parse_equation(node.value)
        left = expand(left, draft.names)
        right = None if right is None else expand(right, draft.names)
        if isinstance(left, Comparison) and right is None:
            return _inequality(node, left, what)
        return _Equation(node, left, right)
    return None


def _inequality(node: Scalar, compared: Comparison, what: str) -> _Equation:
    """Return the unilateral constraint of a comparison."""
    (left, right, *more), sign = compared.operands, compared.operators[0]
    text, at = node.value, compared.operands[0].end
    if more:
        first, second = (text[a.start : a.end] for a in (left, more[0]))
        middle = text[right.start : right.end]
        raise ExpressionError(
            "not-an-equation",
            f"{what} has two inequalities",
            compared.start,
            compared.end,
            f"give each its own name: `{first} {sign} {middle}` and"
            f" `{middle} {compared.operators[1]} {second}`",
        )
    match sign:
        case ">=" | "<=":
            return _Equation(node, left, right, sign)
        case "==":
            help_ = "write a single `=`"
        case "!=":
            help_ = "write `=`, or `>=` or `<=` for a unilateral constraint"
        case _:
            help_ = f"write `{sign}=`: a contact is closed where both sides are equal"
    start = text.index(next(c for c in text[at:] if c in "<>=≤≥≠!"), at)
    raise ExpressionError(
        "not-an-equation",
        f"{what} has `=`, `>=` or `<=`, not `{sign}`",
        start,
        start + len(sign),
        help_,
    )


class _ConstraintBuilder:
    """Builds the constraints of one entry; reports each error once."""

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        what: str,
        equation: _Equation,
        description: str | None,
    ):
        self.draft, self.key, self.description = draft, declaration.key, description
        self.what = what
        self.node, self.left, self.right, self.relation = equation
        trees = [self.left] if self.right is None else [self.left, self.right]
        self.sides = [
            Formula(draft, Parsed(self.node, tree), self.what, indices=declaration.indices)
            for tree in trees
        ]
        self.good = True
        repeated = [index for index, span in declaration.spans if isinstance(span, Range)]
        if not all(map(self.uses, repeated)):
            self.fault(
                "unused-index",
                f"{self.what} is the same for every index",
                "use the index, or give the constraint once"
                if all(repeated)
                else f"name the index and use it, as in `{declaration.name}[i = 1..N]: x[i] = 0`",
            )

    def uses(self, index: str | None) -> bool:
        """Whether the index occurs on one of the sides."""
        return index is not None and any(uses(f.parsed.tree, index) for f in self.sides)

    def fault(self, kind: str, message: str, help_: str, indices: Indices = NO_INDICES) -> None:
        """Report an error that occurs for some values of the index."""
        self.good = False
        at = ", ".join(f"{name} = {value}" for name, value in indices.items())
        at = f", for {at}" if at else ""
        self.draft.report.add(kind, message + at, self.node.location, help_)

    def constraints(self, name: str, indices: Indices) -> list[Constraint]:
        """Return one constraint, or those of the components of a vector; omit those with errors."""
        built = [side.value(indices) for side in self.sides]
        values = [side.value for side in built if side is not None]
        if not self.good or len(values) < len(built):
            return []
        if any(isinstance(value, Tensor) for value in values):
            return list(self.components(name, values, indices))
        constraint = self.constraint(name, self.left, self.right, values, indices)
        return [] if constraint is None else [constraint]

    def components(self, name: str, values: list[Value], indices: Indices) -> Iterator[Constraint]:
        """Yield the constraints of the components, except those that hold identically."""

        def build(tree: Tree) -> Value | None:
            formula = Formula(
                self.draft,
                Parsed(self.node, tree),
                self.what,
                indices=tuple(indices),
            )
            sized = formula.value(indices)
            return None if sized is None else sized.value

        try:
            rows = component_equations(self.left, self.right, values, build)
        except ShapeError as error:
            help_ = "both sides are scalars, vectors of one length, or rotations; 0 fits any vector"
            self.fault("shape", f"{self.what}: {error}", error.help or help_, indices)
            return
        always = [row for row in rows if is_zero(row.sides[0] - row.sides[1])]
        if len(always) < len(rows):
            rows = [row for row in rows if row not in always]
            self.draft.left_out += [name + row.part for row in always]
        for row in rows:
            constraint = self.constraint(
                name + row.part, row.left, row.right, [*row.sides], indices
            )
            if constraint is not None:
                yield constraint

    def constraint(
        self, name: str, left: Tree, right: Tree | None, sides: list[Basic], indices: Indices
    ) -> Constraint | None:
        """Return a constraint; None if it has an error."""
        expression = sides[0] if right is None else sides[0] - sides[1]
        small = count_terms(expression) <= _EXPANDED
        shown = expand_terms(expression) if small else expression  # x = x + 1 leaves no x
        rates, positions = self.motion_in(shown)
        if not rates and not positions:
            self.without_unknowns(sides, shown, indices)
            return None
        if not rates and self.motion_in(expression)[0]:
            expression = shown  # the velocities cancel
        if is_zero(expression):
            message = f"{self.what} holds for all values of the coordinates"
            help_ = "it constrains nothing: fix or remove it"
            self.fault("no-unknowns", message, help_, indices)
            return None
        kinked = kinked_in(expression, rates) if rates else None
        if kinked is not None:
            self.fault(
                "not-smooth",
                f"{self.what} is not affine in the velocity `{kinked.name}`, and has a kink there",
                "a constraint is a smooth function of the velocities; friction is written with"
                " `friction` and `slip`, or with `limit`",
                indices,
            )
            return None
        kind: symbols.Kind = "holonomic"
        if rates:
            kind = "nonholonomic" if nonlinear_in(expression, rates) is None else "nonlinear"
        return Constraint(
            name,
            kind,
            expression,
            left,
            right,
            self.description,
            self.key.location,
            indices,
            self.relation,
        )

    def motion_in(self, expression: Basic) -> tuple[list[Basic], list[Basic]]:
        """Return the velocities and the coordinates that occur, in the order of their names."""
        coordinates = self.draft.names.coordinates
        free = sorted(expression.free_symbols, key=str)
        positions = [s for s in free if s.name in coordinates]
        rates = [s for s in free if s.name.endswith("'") and s.name.rstrip("'") in coordinates]
        return rates, positions

    def without_unknowns(self, sides: list[Basic], value: Basic, indices: Indices) -> None:
        """Report a constraint without coordinates and velocities."""
        if any(any(self.motion_in(side)) for side in sides):
            message = f"{self.what} says {value} = 0, whatever the coordinates"
            harmless = value == 0
        else:
            message = f"{self.what} contains neither a coordinate nor a velocity"
            harmless = True
        self.fault(
            "no-unknowns",
            message,
            "it constrains nothing: fix or remove it"
            if harmless
            else "it cannot be satisfied: fix or remove it",
            indices,
        )


_LETTERS = ("x", "y", "z")


class ComponentEquation(NamedTuple):
    """One component of an equation.

    Parameters
    ----------
    part : str
        ``.x``, or ``.4`` of a longer vector.
    left, right : Tree
    sides : tuple of expressions
        Their values.
    """

    part: str
    left: Tree
    right: Tree
    sides: tuple[Basic, Basic]


def component_equations(
    left: Tree, right: Tree | None, values: list[Value], build: Callable[[Tree], Value | None]
) -> list[ComponentEquation]:
    """Return the component equations of an equation of vectors or rotations.

    An equation of rotations R₁ = R₂ becomes the three components of axial(R₂ᵀR₁), whose rate at R₁
    = R₂ is the relative angular velocity in the common frame.

    Parameters
    ----------
    left, right : Tree
        Sides of the equation; ``right`` is None for 0.
    values : list of expressions, vectors or matrices
        Values of the given sides.
    build : callable
        Returns the value of a tree; None if it has an error, which has been reported.

    Raises
    ------
    ShapeError
        The sides do not fit, or are matrices that are not rotations.
    """
    place = (left.start, left.end)
    zero: Tree = NumberExpr(*place, Fraction(0))
    if right is None:
        right, values = zero, [*values, se.Integer(0)]
    one, two = values
    for value, other in ((one, two), (two, one)):
        if not isinstance(value, Tensor) and value != 0:
            raise ShapeError(f"{kind_of(other)} cannot be equal to a scalar")
    if isinstance(one, Tensor) and isinstance(two, Tensor):
        if one.shape != two.shape:
            raise ShapeError(f"{one.kind} cannot be equal to {two.kind}")
        if one.is_rotation and two.is_rotation:
            inverse = CallExpr(*place, "transpose", (right,))
            relative = ProductExpr(*place, ((1, inverse), (1, left)))
            left, right = CallExpr(*place, "axial", (relative,)), zero
            built = build(left)
            if built is None:
                return []
            one, two = built, se.Integer(0)
    vector = one if isinstance(one, Tensor) else two
    assert isinstance(vector, Tensor)
    if not vector.is_vector:
        raise ShapeError(
            "an equation of matrices is possible between rotations only",
            next(filter(None, map(rotation_remedy, (one, two))), None),
        )
    count = len(vector.entries)
    parts = _LETTERS[:count] if count <= len(_LETTERS) else map(str, range(1, count + 1))
    return [
        ComponentEquation(
            f".{part}",
            _component(left, one, i, part),
            _component(right, two, i, part),
            (_entry(one, i), _entry(two, i)),
        )
        for i, part in enumerate(parts)
    ]


def _entry(value: Value, i: int) -> Basic:
    return value.entries[i] if isinstance(value, Tensor) else value


def _component(tree: Tree, value: Value, i: int, part: str) -> Tree:
    """Return the tree of a component; the zero of a vector equation is used for each."""
    if not isinstance(value, Tensor):
        return tree
    if isinstance(tree, VectorExpr):
        return tree.items[i]
    if part in _LETTERS:
        return ComponentExpr(tree.start, tree.end, tree, part)
    index = NumberExpr(tree.start, tree.end, Fraction(i + 1))
    return ComponentExpr(tree.start, tree.end, tree, "", (index,))
