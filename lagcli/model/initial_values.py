"""Reader of initial values: fixed or guessed, with units."""

from __future__ import annotations

import re
from dataclasses import replace

from lagcli.model.draft import Draft, Indices
from lagcli.model.expression.quantities import Quantity, evaluate, formula_of, read_quantity
from lagcli.model.keys import INITIAL, keys_of
from lagcli.model.model import InitialValue, Written
from lagcli.model.names.families import Declaration
from lagcli.model.names.scope import uses
from lagcli.model.symbols import Context, Symbols
from lagcli.model.yaml.source import Mapping, Scalar, YamlNode

#: A guess on the command line, written as in a file.
GUESS = r"\s*+\{\s*+(guess)\s*+:\s++([^{}]*+)\}\s*+"


class InitialReader:
    """Reads the value of an entry, for each member that the entry covers.

    Parameters
    ----------
    draft : Draft
    declaration : Declaration
        The entry, with its value as node.
    constants : Symbols
        Parameters with their values.
    fixed : bool
        Whether the value is fixed unless it is written as a guess.
    quantity : Quantity, optional
        The value, if it has already been read.
    """

    def __init__(
        self,
        draft: Draft,
        declaration: Declaration,
        constants: Symbols,
        fixed: bool = True,
        quantity: Quantity | None = None,
    ):
        self.draft, self.location = draft, declaration.node.location
        self.what = what = f"the initial value of `{declaration.title}`"
        node, own = unwrapped(draft, declaration.node, what)
        self.fixed, self.quantity = fixed and own, quantity
        names = initial_names(draft, constants)
        if node is not None and quantity is None:
            self.quantity = read_quantity(draft, node, what, names)
        if self.quantity is not None:
            context = Context(what, coordinates=False, definitions=False, time=False)
            indices, tree = declaration.indices, self.quantity.parsed.tree
            self.formula = formula_of(draft, self.quantity, context, names, indices)
            self.varies = any(uses(tree, index) for index in indices)
        self.same: float | None = None

    def read(self, name: str, indices: Indices, values: dict[str, InitialValue]) -> None:
        """Evaluate the entry for a coordinate or velocity."""
        if self.quantity is None:
            return
        value = self.same
        if value is None:
            value = evaluate(self.draft, self.quantity, self.formula, self.what, indices)
            self.same = None if self.varies else value
        if value is not None:
            quantity = self.quantity
            written = Written(quantity.parsed.tree, quantity.factor, indices)
            values[name] = InitialValue(value, self.fixed, self.location, written, quantity.unit)


def initial_names(draft: Draft, constants: Symbols) -> Symbols:
    """Return the names allowed in initial values: parameters with their values."""
    names = draft.names
    return replace(constants, coordinates=names.coordinates, definitions=names.definitions)


def unwrapped(draft: Draft, node: YamlNode, what: str) -> tuple[YamlNode | None, bool]:
    """Return the value of an entry without ``{guess: …}``, and whether it is fixed."""
    if not isinstance(node, Mapping):
        return node, True
    fields = draft.fields(node, what, keys_of(INITIAL))
    if "guess" not in fields and not node.entries:
        draft.report.add(
            "missing-value", f"{what} is empty", node.location, "write a number, or {guess: 0}"
        )
    return fields.get("guess"), False


def guessed(entry: YamlNode, value: YamlNode) -> YamlNode:
    """Return a value as ``{guess: value}`` if the entry is a guess."""
    assert isinstance(entry, Mapping)
    key = entry.entries["guess"][0]
    return Mapping(value.source, value.start, value.end, {"guess": (key, value)})


def guess_or(node: Scalar) -> YamlNode:
    """Return a value from the command line; a guess as the mapping used in files."""
    match = re.fullmatch(GUESS, node.value)
    if match is None:
        return node
    key, guess = (
        Scalar(node.source, (0, match.start(i)), (0, match.end(i)), match[i]) for i in (1, 2)
    )
    return Mapping(node.source, node.start, node.end, {"guess": (key, guess)})
