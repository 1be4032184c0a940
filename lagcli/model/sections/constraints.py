"""The constraints, and what kind each is."""

from __future__ import annotations

from collections.abc import Mapping

from symengine import Basic

from lagcli.model import model as symbols
from lagcli.model.draft import NO_INDICES, Draft, Formula, Indices, Parsed
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.expression.linearity import count_terms, expand_terms, is_zero, nonlinear_in
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.expression.trees import Comparison, Tree
from lagcli.model.keys import CONSTRAINT, keys_of
from lagcli.model.model import Constraint
from lagcli.model.names.expansion import expand
from lagcli.model.names.families import Declaration, Member, by_name
from lagcli.model.names.scope import uses
from lagcli.model.sections.coordinates import expanded
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Scalar, YamlNode

_EXPANDED = 1000  # terms of a constraint that is written out to see what cancels
_EXAMPLE = "x^2 + y^2 = l^2"


def declare_constraints(
    draft: Draft, declared: list[Declaration], constants: Symbols
) -> dict[str, Member]:
    """Return what the entries declare, by name, and enter the names into the draft's."""
    names = draft.names
    names.constraint_families = {d.family for d in declared if d.span is not None}
    members = by_name(draft, expanded(draft, declared, constants))
    names.constraints = dict.fromkeys(members)
    return members


def read_constraints(
    draft: Draft, declared: list[Declaration], members: Mapping[str, Member]
) -> tuple[Constraint, ...]:
    """Return the constraints that can be built."""
    builders = {id(d): _builder(draft, d) for d in declared}
    found = []
    for name, member in members.items():
        builder = builders[id(member.declaration)]
        constraint = builder.constraint(name, member.indices) if builder else None
        if constraint is not None:
            found.append(constraint)
    return tuple(found)


def _builder(draft: Draft, d: Declaration) -> _ConstraintBuilder | None:
    what = f"constraint `{d.title}`"
    node, fields = draft.expression_node(
        d.key,
        d.node,
        what,
        keys_of(CONSTRAINT),
        later=("unilateral", "restitution"),
        example=_EXAMPLE,
    )
    description = draft.text(fields.get("description"), f"`description` of {what}")
    equation = None if node is None else _equation(draft, node, what)
    return None if equation is None else _ConstraintBuilder(draft, d, equation, description)


def _equation(draft: Draft, node: YamlNode, what: str) -> tuple[Scalar, Tree, Tree | None] | None:
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
            sign = left.operators[0]
            raise ExpressionError(
                "not-an-equation",
                f"{what} is an equation and has `=`, not `{sign}`",
                start := node.value.index(sign, left.operands[0].end),
                start + len(sign),
                "write a single `=`"
                if sign == "=="
                else "inequalities are not part of this version",
            )
        return node, left, right
    return None


class _ConstraintBuilder:
    """Builds the constraints of one entry; what is wrong with it is reported once."""

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        equation: tuple[Scalar, Tree, Tree | None],
        description: str | None,
    ):
        self.draft, self.key, self.description = draft, declaration.key, description
        self.what = f"constraint `{declaration.title}`"
        self.node, self.left, self.right = equation
        trees = [self.left] if self.right is None else [self.left, self.right]
        context, index = Context(self.what), declaration.index
        self.sides = [
            Formula(draft, Parsed(self.node, tree), context, index=index) for tree in trees
        ]
        draft.trees[f"constraints.{declaration.title}.left"] = self.left
        self.good = True
        if declaration.several and not self.uses(index):
            self.fault(
                "unused-index",
                f"{self.what} is the same for every index",
                "use the index, or give the constraint once"
                if index
                else f"name the index and use it, as in `{declaration.name}[i = 1..N]: x[i] = 0`",
            )

    def uses(self, index: str | None) -> bool:
        """Whether the index occurs on one of the sides."""
        return index is not None and any(uses(f.parsed.tree, index) for f in self.sides)

    def fault(self, kind: str, message: str, help_: str, indices: Indices = NO_INDICES) -> None:
        """Report what is wrong, for some values of the index."""
        self.good = False
        at = ", ".join(f"{name} = {value}" for name, value in indices.items())
        at = f", for {at}" if at else ""
        self.draft.report.add(kind, message + at, self.node.location, help_)

    def constraint(self, name: str, indices: Indices) -> Constraint | None:
        """Return one constraint; None if there is something wrong with it."""
        built = [side.scalar(indices) for side in self.sides]
        sides = [side for side in built if side is not None]
        if not self.good or len(sides) < len(built):
            return None
        expression = sides[0] if self.right is None else sides[0] - sides[1]
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
        bad = nonlinear_in(expression, rates)
        if bad is not None:
            self.fault(
                "not-yet",
                f"{self.what} is not affine in the velocity `{bad.name}`",
                "velocities may stand in sums and be multiplied by functions of coordinates and"
                " time, no more, in this version",
                indices,
            )
            return None
        kind: symbols.Kind = "nonholonomic" if rates else "holonomic"
        return Constraint(
            name,
            kind,
            expression,
            self.left,
            self.right,
            self.description,
            self.key.location,
            indices,
        )

    def motion_in(self, expression: Basic) -> tuple[list[Basic], list[Basic]]:
        """Return the velocities and the coordinates that occur, in the order of their names."""
        coordinates = self.draft.names.coordinates
        free = sorted(expression.free_symbols, key=str)
        positions = [s for s in free if s.name in coordinates]
        rates = [s for s in free if s.name.endswith("'") and s.name.rstrip("'") in coordinates]
        return rates, positions

    def without_unknowns(self, sides: list[Basic], value: Basic, indices: Indices) -> None:
        """Report a constraint in which no coordinate and no velocity is left."""
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
