"""Conditions of events: comparisons joined by and, or, not; or changes of a contact."""

from __future__ import annotations

import re
from typing import NamedTuple, get_args

from symengine import Basic

from lagcli.columns import SLIP
from lagcli.model.draft import Draft, Formula, Indices, Parsed
from lagcli.model.expression.functions import FUNCTIONS
from lagcli.model.expression.grammar import parse_equation
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import Comparison, LogicalExpr, Tree
from lagcli.model.model import ContactChange
from lagcli.model.names.expansion import expand
from lagcli.model.names.members import Indices as IndexValues
from lagcli.model.names.members import with_indices
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.symbols import Context
from lagcli.model.yaml.source import Scalar, YamlNode

_CHANGES: tuple[ContactChange, ...] = get_args(ContactChange)
_WORDS = re.compile(r"\s*(?P<row>[^\W\d]\w*(?:\[[^\]]*\])?(?:\.\w+)?)\s+(?P<change>[^\W\d]\w*)\s*")
_HELP = "write a condition, as in `t >= 2` or `floor closes`"


class ReadCondition(NamedTuple):
    """A condition for one value of the index; see `ModelEvent`."""

    function: Basic | None
    either: bool = False
    change: tuple[str, ContactChange] | None = None


class ConditionReader:
    """Reads the field ``when`` of an event, and builds it for each member.

    Parameters
    ----------
    draft : Draft
    node : Node
    what : str
        Description of the event, for messages.
    indices : tuple of str
        Names of the event's indices.
    """

    def __init__(self, draft: Draft, node: YamlNode, what: str, indices: tuple[str, ...]):
        self.draft, self.what, self.indices = draft, what, indices
        self.good = False
        self.change: tuple[str, ContactChange] | None = None
        self.tree: Tree | None = None
        self.sides: tuple[Tree, Tree] | None = None
        self.formulas: dict[int, Formula] = {}
        if not isinstance(node, Scalar) or node.missing:
            said = "empty" if isinstance(node, Scalar) else f"a condition, not {node.what}"
            said = (
                f"`when` of {what} is empty" if said == "empty" else f"`when` of {what} is {said}"
            )
            draft.report.add("wrong-type", said, node.location, _HELP)
            return
        self.node = node
        with draft.report.expression(node):
            self._read(node)
            self.good = all(f.good for f in self.formulas.values())

    @property
    def text(self) -> str:
        """The condition as written, on one line."""
        return " ".join(self.node.value.split())

    @property
    def written(self) -> tuple[Tree, ...]:
        """The condition, or the two sides of an equation."""
        if self.sides is not None:
            return self.sides
        return () if self.tree is None else (self.tree,)

    def _read(self, node: Scalar) -> None:
        words = _WORDS.fullmatch(node.value)
        if words and words["row"] not in ("not",) and words["change"] not in ("and", "or"):
            self._contact(words)
            return
        names = self.draft.names
        left, right = parse_equation(node.value)
        left = expand(left, names)
        if right is not None:
            self.sides = left, expand(right, names)
            for side in self.sides:
                self._operand(side)
            return
        self.tree = left
        self._condition(left)

    def _contact(self, words: re.Match[str]) -> None:
        """Parse a change of a contact."""
        change = words["change"]
        if change not in _CHANGES:
            raise ExpressionError(
                "unknown-word",
                f"`when` of {self.what} says `{shorten(change)}`, which happens to no contact",
                *words.span("change"),
                did_you_mean(nearest(change, _CHANGES, 1))
                or "a contact " + ", ".join(f"`{x}`" for x in _CHANGES),
            )
        row = words["row"]
        constraints = self.draft.names.constraints
        family = re.sub(r"\[.*\]", "[]", row)
        if row not in constraints and not (
            self.indices and family in self.draft.names.constraint_families
        ):
            raise ExpressionError(
                "unknown-name",
                f"`when` of {self.what} names `{shorten(row)}`, which is not a constraint",
                *words.span("row"),
                did_you_mean(nearest(row, list(constraints)))
                or "the constraints are " + ", ".join(f"`{c}`" for c in list(constraints)[:12])
                if constraints
                else "the model has no constraints",
            )
        self.change = row, change

    def _condition(self, tree: Tree) -> None:
        """Check a condition, and prepare its operands."""
        if isinstance(tree, LogicalExpr):
            for part in tree.operands:
                self._condition(part)
        elif isinstance(tree, Comparison):
            for sign in tree.operators:
                if sign in ("==", "!="):
                    raise error_at(
                        "not-a-condition",
                        f"`{sign}` in `when` of {self.what} holds at single instants",
                        tree,
                        "write `=`, alone, for an event in both directions, or `>=` or `<=`",
                    )
            for part in tree.operands:
                self._operand(part)
        else:
            raise error_at(
                "not-a-condition",
                f"`when` of {self.what} is not a condition",
                tree,
                _HELP,
            )

    def _operand(self, tree: Tree) -> None:
        context = Context(f"`when` of {self.what}", accelerations=True, multipliers=True)
        parsed = Parsed(self.node, tree)
        self.formulas[id(tree)] = Formula(self.draft, parsed, context, indices=self.indices)

    # of one member

    def built(self, indices: Indices) -> ReadCondition | None:
        """Return the condition for an index; None if it has an error."""
        if not self.good:
            return None
        if self.change is not None:
            return self._changed(indices)
        try:
            if self.sides is not None:
                left, right = map(self._value, self.sides, [indices] * 2)
                found = ReadCondition(left - right, either=True)
            else:
                assert self.tree is not None
                found = ReadCondition(self._function(self.tree, indices, 1))
        except _Wrong:
            self.good = False
            return None
        if found.function is not None and not self._varies(found.function):
            self.good = False
            self.draft.report.add(
                "not-a-condition",
                f"`when` of {self.what} does not depend on time or on the motion",
                self.node.location,
                _HELP,
            )
            return None
        return found

    def _varies(self, function: Basic) -> bool:
        parameters = self.draft.names.parameters
        return any(s.name not in parameters for s in function.free_symbols)

    def _function(self, tree: Tree, indices: Indices, sign: int) -> Basic:
        """Return a function that is positive if a condition holds, or if it does not (sign −1)."""
        if isinstance(tree, LogicalExpr):
            if tree.operator == "not":
                return self._function(tree.operands[0], indices, -sign)
            parts = [self._function(part, indices, sign) for part in tree.operands]
            least = (tree.operator == "and") == (sign > 0)
            return FUNCTIONS["min" if least else "max"].apply(*parts)
        assert isinstance(tree, Comparison)
        values = [self._value(part, indices) for part in tree.operands]
        parts = [
            sign * (b - a if operator in ("<", "<=") else a - b)
            for a, b, operator in zip(values, values[1:], tree.operators, strict=False)
        ]
        return FUNCTIONS["min" if sign > 0 else "max"].apply(*parts)

    def _value(self, tree: Tree, indices: Indices) -> Basic:
        value = self.formulas[id(tree)].scalar(indices)
        if value is None:
            raise _Wrong
        return value

    def _changed(self, indices: Indices) -> ReadCondition | None:
        """Return the change of a contact, for an index."""
        assert self.change is not None
        row, change = self.change
        if row not in self.draft.names.constraints:
            row = self._member(row, indices)
            if row not in self.draft.names.constraints:
                self.good = False
                self.draft.report.add(
                    "no-member",
                    f"`when` of {self.what} names `{row}`, which is not a constraint",
                    self.node.location,
                    "use the same ranges",
                )
                return None
        return ReadCondition(None, change=(row, change))

    def _member(self, row: str, indices: Indices) -> str:
        """Return the name of a member, ``hit[2]`` of ``hit[i]``."""
        name, _, index = row.partition("[")
        left, _ = parse_equation(index.removesuffix("]"))
        return with_indices(f"{name}[]", [IndexValues(dict(indices), lambda _: 0).at(left)])


class _Wrong(Exception):
    """A part of a condition has an error, which has been reported."""


def watched_row(constraint: str, change: ContactChange, names: dict[str, None]) -> str:
    """Return the row that a contact's change refers to: that of its friction for slip."""
    friction = constraint + SLIP
    return friction if change in ("slips", "sticks") and friction in names else constraint
