"""Scope of an expression: the names allowed at its place, and their values."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

import symengine as se
from symengine import Basic

from lagcli.model import model as symbols
from lagcli.model.diagnostics import MAX_DIAGNOSTICS, Broken
from lagcli.model.expression.tensors import Sized, Tensor
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import (
    ComponentExpr,
    IndexedSumExpr,
    Name,
    Tree,
    as_written,
    walk,
)
from lagcli.model.model import input_function
from lagcli.model.names.members import (
    IndexEvaluator,
    descending,
    family_of,
    form_errors,
    members_clause,
    names_in,
    with_indices,
)
from lagcli.model.names.namespace import Allowed, Namespace, motion


class Scope:
    """The names of a model at the place of one expression.

    Parameters
    ----------
    names : Namespace
    where : str
        Description of the expression, for messages.
    allowed : Allowed
    indices : collection of str
        Names of the indices that have a value in the expression.
    """

    def __init__(
        self,
        names: Namespace,
        where: str,
        allowed: Allowed = Allowed.MOTION,
        indices: Collection[str] = (),
    ):
        self.names, self.where, self.allowed = names, where, allowed
        self.parameters = names.constants if allowed == Allowed.NUMBERS else names.parameters
        self.bound = frozenset(indices)
        self.values: dict[str, int] = {}
        self.indices = IndexEvaluator(self.values, self._whole)
        self.missing: dict[int, ExpressionError] = {}
        # names without indices, with their order of derivative
        self._good: set[tuple[str, int]] = set()
        self._known: dict[tuple[str, int], Sized] = {}

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative."""
        return self.names.derivative(expression)

    def mark_nonsmooth(self) -> None:
        """Record that a function with kinks or jumps is used."""
        if self.allowed != Allowed.NUMBERS:  # a value is no function
            self.names.smooth = False

    def declared(self, text: str) -> bool:
        """Whether a name is declared."""
        return self.names.declared(text)

    @property
    def functions(self) -> Collection[str]:
        """The names of the model's functions."""
        return self.names.functions.keys()

    # checks, before indices have values

    def check(self, name: Name) -> None:
        """Raise ExpressionError for a name that is unknown or not allowed here.

        Raises
        ------
        ExpressionError
        Broken
            The name's own declaration is in error.
        """
        if name.indices:
            self._check(name)
        elif (name.text, name.primes) not in self._good:
            self._check(name)
            self._good.add((name.text, name.primes))

    def _check(self, name: Name) -> None:
        names = self.names
        if name.text in self.bound:
            if name.primes:
                raise self._error(
                    "constant", name, f"`{name.text}` is an index and has no time derivative"
                )
            return
        for tree in name.indices:
            self.check_index(tree)
        text, primes = names.resolve(name)
        if text in names.broken:
            raise Broken
        kinds = names.families.get(text, ())
        if text in names.coordinates or "coordinate" in kinds:
            self._check_coordinate(name, primes)
        elif text in names.definitions or "definition" in kinds:
            if self.allowed < Allowed.MOTION:
                help_ = f"{_OF_PARAMETERS}, which may be expressions of other parameters"
                raise self._not_here(name, "definitions", help_)
        elif text in names.parameters or "parameter" in kinds:
            _check_derivative(names.inputs, name, text, primes)
        elif "." in text:
            self._dotted(name, text)
        elif text in ("t", "pi") or text in names.inputs:
            if text != "pi" and self.allowed < Allowed.MOTION:
                raise self._not_here(name, "time", _OF_PARAMETERS)
            _check_derivative(names.inputs, name, text, primes)
        else:
            from lagcli.model.names.unknown import unknown

            raise unknown(self, name)

    def check_index(self, tree: Tree) -> None:
        """Raise ExpressionError for a name that is not allowed in an index or a range.

        Raises
        ------
        ExpressionError, Broken
            As `check`.
        """
        for error in form_errors(tree):
            raise error
        names = self.names
        for name in names_in(tree):
            text = name.text
            if text in names.broken:
                raise Broken
            if (text in self.bound or text == "pi") and not name.primes:
                continue
            whole = text in names.constants or "parameter" in names.families.get(text, ())
            if whole and not name.primes:
                continue
            if text in ("t", "pi") or text in self.bound or names.declared(text):
                what = "rate" if name.primes else names.lines.get(text, ("value that varies", 0))[0]
                message = "an index may use whole numbers and parameters; "
                shown = text + "'" * name.primes
                raise self._error("bad-index", name, f"{message}`{shown}` is a {what}")
            from lagcli.model.names.unknown import unknown_index

            raise unknown_index(self, name)

    def check_series(self, tree: IndexedSumExpr) -> Scope:
        """Return the scope of a sum's term.

        Raises
        ------
        ExpressionError
            The name of the index is already in use, or the index is not used.
        """
        self.check_index_name(tree.index, tree)
        if not uses(tree.term, tree.index):
            raise error_at(
                "unused-index",
                f"the term of this sum does not use the index `{tree.index}`",
                tree,
                "write a product with the number of terms",
            )
        return Scope(self.names, self.where, self.allowed, self.bound | {tree.index})

    def check_index_name(self, index: str, tree: Tree) -> None:
        """Raise ExpressionError for an index that would shadow another name."""
        names = self.names
        what = None
        if index in self.bound:
            what = "an index of the enclosing expression"
        elif index in ("t", "pi"):
            what = {"t": "the time", "pi": "the number π"}[index]
        elif names.declared(index) or f"{index}[]" in names.families:
            what = "a " + names.lines.get(index, names.lines.get(f"{index}[]", ("name", 0)))[0]
        if what is not None:
            raise error_at(
                "index-hides-name",
                f"the name of the index `{index}` is already in use: `{index}` is {what}",
                tree,
                "choose another name for the index",
                f"index {index}",
            )

    # evaluation, with index values

    def each(self, tree: IndexedSumExpr) -> Iterator[int]:
        """Iterate over the index of a sum.

        Raises
        ------
        ExpressionError
            The range is too long or descending.
        """
        span = self.indices.range(tree.range)
        fixed = all(name.text not in self.values for name in names_in(tree.range))
        if fixed and span.stop < span.start:
            raise descending(tree.range, span)
        for value in span:
            self.values[tree.index] = value
            yield value
        self.values.pop(tree.index, None)

    def index(self, tree: Tree) -> int:
        """Return the value of an index.

        Raises
        ------
        ExpressionError
            It is not a whole number.
        """
        return self.indices.at(tree)

    def check_order(self, tree: Tree, order: int) -> None:
        """Raise ExpressionError for a derivative of an expression that is too high.

        Parameters
        ----------
        tree : Tree
        order : int
            The highest derivative of a coordinate in it.
        """
        if order > 2:
            raise error_at("too-many-primes", _HIGHEST, tree)
        if order == 2 and self.allowed < Allowed.ACCELERATIONS:
            raise error_at(
                "not-allowed-here",
                f"{self.where} cannot depend on accelerations, but uses the derivative of"
                " a velocity",
                tree,
                _ACCELERATIONS,
            )

    def has_value(self, index: str) -> bool:
        """Whether a name is an index with a value."""
        return index in self.values

    def symbols(self, name: Name, order: int) -> list[Basic] | None:
        """Return the symbol of a member; None if it has none.

        For a coordinate, these are the coordinate and its derivatives up to an order.
        """
        names = self.names
        text, primes = self.named(name)
        if text in names.coordinates:
            return [motion(text, n) for n in range(order + 1)]
        if text in names.definitions or primes:
            return None
        if "." in text and text not in self.parameters:
            return [self._dotted(name, text)]
        value = self.parameters[text]() if text in self.parameters else None
        return [value] if isinstance(value, se.Symbol) else None

    def at(self) -> str:
        """Return the index values for messages: `` for i = 1``; empty without indices."""
        values = ", ".join(f"{name} = {value}" for name, value in self.values.items())
        return f" for {values}" if values else ""

    def lookup(self, name: Name) -> Sized:
        """Return the value of a name; collect members that do not exist in ``missing``.

        Raises
        ------
        ExpressionError, Broken
            As `check`.
        """
        if name.indices:
            return self._member(name, *self.named(name))
        if name.text in self.values:
            return Sized(se.Integer(self.values[name.text]), constant=True)
        known = self._known.get((name.text, name.primes))
        if known is None:
            self.check(name)
            known = self._single(name, *self.names.resolve(name))
            self._known[name.text, name.primes] = known
        return known

    def _single(self, name: Name, text: str, primes: int) -> Sized:
        if text in self.names.coordinates:
            return Sized(motion(text, primes), order=primes)
        if text in self.names.definitions:
            return self._definition(name, text, primes)
        if text in self.parameters:
            value = self.parameters[text]()
            return Sized(value, constant=not value.free_symbols)
        if "." in text:
            return Sized(self._dotted(name, text))
        if text in self.names.inputs:
            return Sized(input_function(text, primes))
        return Sized(symbols.TIME) if text == "t" else Sized(se.pi, constant=True)

    def named(self, name: Name) -> tuple[str, int]:
        """Return a name with evaluated indices, and its order of derivative."""
        text, primes = self.names.resolve(name)
        if name.indices:
            text = with_indices(text, [self.indices.at(tree) for tree in name.indices])
        return text, primes

    def _member(self, name: Name, text: str, primes: int) -> Sized:
        names = self.names
        if text.startswith(("lambda.", "Qc.")):
            return Sized(self._dotted(name, text))
        if text in names.coordinates:
            return Sized(motion(text, primes), order=primes)
        if text in names.definitions:
            return self._definition(name, text, primes)
        if text in self.parameters:
            value = self.parameters[text]() if not primes else se.Integer(0)
            return Sized(value, constant=not value.free_symbols)
        if family_of(text) in names.broken or names.incomplete:
            raise Broken
        if name.start not in self.missing and len(self.missing) <= MAX_DIAGNOSTICS:
            base = text.partition("[")[0]
            others = members_clause(base, names.members(base))
            self.missing[name.start] = self._error(
                "no-member",
                name,
                f"{self.where} uses `{text}`{self.at()}, but {others}",
                f"shorten the range, or define the missing member under `definitions`: `{text}: 0`",
            )
        return Sized(se.Symbol(text))

    def _whole(self, name: Name) -> int:
        """Return the value of a parameter in an index."""
        names = self.names
        text = with_indices(name.text, [self.indices.at(tree) for tree in name.indices])
        if text not in names.constants:
            raise self._error("no-member", name, f"there is no parameter `{text}`{self.at()}")
        value = names.constants[text]()
        names.structural.add(text)
        if not isinstance(value, se.Integer):
            raise error_at(
                "not-whole",
                f"`{text}` is used in an index and must be a whole number, but is {value}",
                name,
                f"give a whole number, as in `{text}: 10` or --set {text}=10",
                text,
            )
        return int(value)

    # errors

    def _error(
        self, kind: str, name: Name, message: str, help_: str | None = None
    ) -> ExpressionError:
        return ExpressionError(kind, message, name.start, name.end, help_)

    def _not_here(self, name: Name, what: str, help_: str | None = None) -> ExpressionError:
        shown = as_written(name) + "'" * name.primes
        return self._error(
            "not-allowed-here",
            name,
            f"{self.where} cannot depend on {what}, but uses `{shown}`",
            help_,
        )

    def _check_coordinate(self, name: Name, primes: int) -> None:
        if self.allowed < Allowed.MOTION:
            raise self._not_here(name, "coordinates", _OF_PARAMETERS)
        self._check_order(name, primes)

    def _check_order(self, name: Name, order: int) -> None:
        """Raise for derivatives of a coordinate that are too high, here or anywhere."""
        if order > 2:
            raise self._error("too-many-primes", name, _HIGHEST)
        if order == 2 and self.allowed < Allowed.ACCELERATIONS:
            raise self._not_here(name, "accelerations", _ACCELERATIONS)

    def _definition(self, name: Name, text: str, primes: int) -> Sized:
        sized = self.names.definitions[text]()
        value, size = sized.value, sized.size
        order = sized.order + primes if sized.order >= 0 else sized.order
        self._check_order(name, order)
        for _ in range(primes):
            value = (
                value.map(self.names.derivative)
                if isinstance(value, Tensor)
                else self.names.derivative(value)
            )
            size *= 3  # estimate for the product rule
        return Sized(value, size, sized.depth + 2 * primes, sized.constant, order)

    def _dotted(self, name: Name, text: str) -> Basic:
        """Return the symbol of a multiplier or constraint force, before indices have values."""
        head, *rest = text.split(".")
        if head in ("lambda", "Qc") and self.allowed < Allowed.MULTIPLIERS:
            used = (
                "multipliers may be used in `Q`, `limit`, `outputs`, conditions of events and the"
                " vectors of a `view`"
            )
            raise self._not_here(name, "multipliers", used)
        if head == "lambda" and rest and not name.primes:
            constraint = ".".join(rest)
            self._known_part(name, text, constraint, "constraint")
            return symbols.multiplier(constraint)
        if head == "Qc" and rest and not name.primes:
            of_one, coordinate = self._force_of(rest)
            self._known_part(name, text, coordinate, "coordinate")
            if of_one:
                self._known_part(name, text, of_one, "constraint")
            return symbols.constraint_force(coordinate, of_one)
        raise self._error(
            "unknown-name",
            name,
            f"{self.where} uses `{text}`, which is not declared",
            "names with dots are `lambda.CONSTRAINT`, `Qc.COORDINATE` and"
            " `Qc.CONSTRAINT.COORDINATE`;\na decimal number needs no letters around its point",
        )

    def _force_of(self, parts: list[str]) -> tuple[str | None, str]:
        """Return the constraint and the coordinate of a force, either of which may have dots."""
        whole = ".".join(parts)
        if len(parts) == 1 or self._knows("coordinate", whole):
            return None, whole
        splits = [(".".join(parts[:i]), ".".join(parts[i:])) for i in range(1, len(parts))]
        for constraint, coordinate in splits:
            if self._knows("constraint", constraint) and self._knows("coordinate", coordinate):
                return constraint, coordinate
        return splits[0]

    def _knows(self, what: str, part: str) -> bool:
        names = self.names
        if what == "constraint":
            return part in names.constraints or part in names.constraint_families
        return part in names.coordinates or "coordinate" in names.families.get(part, ())

    def _known_part(self, name: Name, text: str, part: str, what: str) -> None:
        if not self._knows(what, part):
            from lagcli.model.names.unknown import unknown_part

            raise unknown_part(self, name, (text, part), what)


def _check_derivative(inputs: Mapping[str, int], name: Name, text: str, primes: int) -> None:
    """Raise ExpressionError for an undefined derivative of an input, a parameter, t or pi."""
    if primes <= min(inputs.get(text, 0), _HIGHEST_OF_INPUTS):
        return
    shown = text + "'" * primes
    if text in ("t", "pi"):
        raise error_at("constant", f"`{text}` has no time derivative", name)
    if text not in inputs:
        message = f"`{text}` is a parameter: its time derivative is zero"
        raise error_at("constant", message, name)
    if primes > _HIGHEST_OF_INPUTS:
        message = f"the highest derivative of an input is `{text}''`"
        raise error_at("too-many-primes", message, name)
    kind = "linear between its rows" if primes == _HIGHEST_OF_INPUTS else "a step function"
    raise error_at(
        "not-smooth",
        f"`{text}` is {kind}: it has no derivative `{shown}`",
        name,
        f"give `{text}` the interpolation `cubic`",
    )


#: The highest derivative of an input in an expression.
_HIGHEST_OF_INPUTS = 2
_HIGHEST = "the highest derivative of a coordinate is the acceleration, q''"
_OF_PARAMETERS = "it may depend on parameters only"
_ACCELERATIONS = "accelerations may be used in `outputs` and in the vectors of a `view`"


def uses(term: Tree, index: str) -> bool:
    """Whether a term uses an index, as a number or in the index of a member."""
    for part in walk(term):
        if isinstance(part, Name):
            inner = [name for i in part.indices for name in names_in(i)]
            if part.text == index or any(name.text == index for name in inner):
                return True
        inside: tuple[Tree, ...] = ()
        if isinstance(part, IndexedSumExpr):
            inside = (part.range,)
        elif isinstance(part, ComponentExpr):
            inside = part.indices
        if any(name.text == index for tree in inside for name in names_in(tree)):
            return True
    return False
