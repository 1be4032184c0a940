"""What the names in a model's expressions stand for, and where they may stand."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import symengine as se
from symengine import Basic

from lagcli.model import model as symbols
from lagcli.model.expressions import Sized, Value
from lagcli.model.functions import FUNCTIONS, derivative
from lagcli.model.report import Broken
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.model.tensors import Tensor
from lagcli.model.tokens import ExpressionError
from lagcli.model.trees import Name

DOTS = (("_ddot", 2), ("_dot", 1))


@dataclass(frozen=True)
class Context:
    """Where an expression stands, and what may be named there."""

    where: str
    coordinates: bool = True
    accelerations: bool = False
    multipliers: bool = False
    definitions: bool = True
    time: bool = True


@dataclass
class Names:
    """All names that a model declares.

    Parameters
    ----------
    coordinates, constraints : collections of str
    parameters, definitions : mappings of str to callables
        What each stands for; the callables raise Broken for one that has an error of its own.
    lines : mapping of str to (str, int)
        What each name is, and the line that declares it.
    broken : set of str
        Names whose declaration is in error: what uses them is not in error for it.
    suspects : set of str
        Words that may have been meant as names, likewise.
    incomplete : bool
        Whether a block of declarations cannot be read, so that any name may have been meant.
    """

    coordinates: Collection[str] = ()
    constraints: Collection[str] = ()
    parameters: Mapping[str, Callable[[], Basic]] = field(default_factory=dict)
    definitions: Mapping[str, Callable[[], Sized]] = field(default_factory=dict)
    lines: dict[str, tuple[str, int]] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    suspects: set[str] = field(default_factory=set)
    incomplete: bool = False

    def declared(self, text: str) -> bool:
        """Whether a name is declared."""
        return text in self.coordinates or text in self.parameters or text in self.definitions

    def resolve(self, name: Name) -> tuple[str, int]:
        """Return a name without its dots, and their number: ``x_dot`` is ``x'`` unless declared."""
        if not self.declared(name.text):
            for suffix, order in DOTS:
                base = name.text.removesuffix(suffix)
                if base != name.text and (self.declared(base) or base in self.suspects):
                    return base, name.primes + order
        return name.text, name.primes

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative of an expression in q, q' and t."""
        terms = []
        for symbol in expression.free_symbols:
            if symbol == symbols.TIME:
                terms.append(derivative(expression, symbol))
                continue
            name = symbol.name.rstrip("'")
            if name in self.coordinates:
                order = len(symbol.name) - len(name)
                terms.append(derivative(expression, symbol) * _MOTION[order + 1](name))
        return se.Add(*terms)


_MOTION = (symbols.coordinate, symbols.velocity, symbols.acceleration)


class ModelScope:
    """The names of a model as seen from one place in it."""

    def __init__(self, names: Names, context: Context):
        self.names = names
        self.context = context

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative."""
        return self.names.derivative(expression)

    def declared(self, text: str) -> bool:
        """Whether a name is declared."""
        return self.names.declared(text)

    def check(self, name: Name) -> None:
        """Raise ExpressionError for a name that is unknown or may not stand here.

        Raises
        ------
        ExpressionError
        Broken
            The name's own declaration is in error.
        """
        names = self.names
        text, primes = names.resolve(name)
        if text in names.broken:
            raise Broken
        if text in names.coordinates:
            self._check_coordinate(name, primes)
        elif text in names.definitions:
            if not self.context.definitions:
                raise self._not_here(name, "definitions")
        elif "." in text:
            self._dotted(name)
        elif text in names.parameters:
            if primes:
                raise self._error(
                    "constant", name, f"`{text}` is a parameter: its time derivative is zero"
                )
        elif text in ("t", "pi"):
            if text == "t" and not self.context.time:
                raise self._not_here(name, "time")
            if primes:
                raise self._error("constant", name, f"`{text}` has no time derivative to speak of")
        else:
            raise self._unknown(name)

    def lookup(self, name: Name) -> Sized:
        """Return what a name stands for.

        Raises
        ------
        ExpressionError, Broken
            As `check`.
        """
        self.check(name)
        text, primes = self.names.resolve(name)
        if text in self.names.coordinates:
            return Sized(_MOTION[primes](text))
        if text in self.names.definitions:
            return self._definition(name, text, primes)
        if "." in text:
            return Sized(self._dotted(name))
        if text in self.names.parameters:
            value = self.names.parameters[text]()
            return Sized(value, constant=not value.free_symbols)
        return Sized(symbols.TIME) if text == "t" else Sized(se.pi, constant=True)

    def _error(
        self, kind: str, name: Name, message: str, help_: str | None = None
    ) -> ExpressionError:
        return ExpressionError(kind, message, name.start, name.end, help_)

    def _not_here(self, name: Name, what: str, help_: str | None = None) -> ExpressionError:
        shown = name.text + "'" * name.primes
        return self._error(
            "not-allowed-here",
            name,
            f"{self.context.where} cannot depend on {what}, but uses `{shown}`",
            help_,
        )

    def _check_coordinate(self, name: Name, primes: int) -> None:
        if not self.context.coordinates:
            raise self._not_here(name, "coordinates", "it may depend on parameters only")
        if primes > 2:
            raise self._error(
                "too-many-primes", name, "derivatives of coordinates end at accelerations, q''"
            )
        if primes == 2 and not self.context.accelerations:
            raise self._not_here(name, "accelerations", _ACCELERATIONS)

    def _definition(self, name: Name, text: str, primes: int) -> Sized:
        sized = self.names.definitions[text]()
        value, size = sized.value, sized.size
        for _ in range(primes):
            if any(self._has_accelerations(x) for x in _entries(value)):
                raise self._error(
                    "too-many-primes", name, "derivatives of coordinates end at accelerations, q''"
                )
            value = (
                value.map(self.names.derivative)
                if isinstance(value, Tensor)
                else self.names.derivative(value)
            )
            size *= 3  # a product rule's worth
        if not self.context.accelerations and any(
            self._has_accelerations(x) for x in _entries(value)
        ):
            raise self._not_here(name, "accelerations", _ACCELERATIONS)
        return Sized(value, size, sized.depth + 2 * primes, sized.constant)

    def _has_accelerations(self, value: Basic) -> bool:
        return any(s.name.endswith("''") for s in value.free_symbols)

    def _dotted(self, name: Name) -> Basic:
        head, *rest = name.text.split(".")
        names = self.names
        if head in ("lambda", "Qc") and not self.context.multipliers:
            raise self._error(
                "not-allowed-here",
                name,
                f"{self.context.where} cannot depend on multipliers, but uses `{name.text}`",
                "multipliers may stand in `outputs` only in this version",
            )
        if head == "lambda" and len(rest) == 1 and not name.primes:
            self._known(name, rest[0], list(names.constraints), "constraint")
            return symbols.multiplier(rest[0])
        if head == "Qc" and len(rest) in (1, 2) and not name.primes:
            self._known(name, rest[-1], list(names.coordinates), "coordinate")
            if len(rest) == 1:
                return symbols.constraint_force(rest[0])
            self._known(name, rest[0], list(names.constraints), "constraint")
            return symbols.constraint_force(rest[1], rest[0])
        raise self._error(
            "unknown-name",
            name,
            f"{self.context.where} uses `{name.text}`, which is not declared",
            "names with dots are `lambda.CONSTRAINT`, `Qc.COORDINATE` and"
            " `Qc.CONSTRAINT.COORDINATE`;\na decimal number needs no letters around its point",
        )

    def _known(self, name: Name, part: str, known: list[str], what: str) -> None:
        if part in known:
            return
        if part in self.names.suspects or self.names.incomplete:
            raise Broken
        close = nearest(part, known) or known[:3]
        raise self._error(
            "unknown-name",
            name,
            f"{self.context.where} uses `{name.text}`, but there is no {what} `{part}`",
            did_you_mean(close) or f"the model has no {what}s",
        )

    def _unknown(self, name: Name) -> ExpressionError:
        names, context = self.names, self.context
        text = name.text
        if names.incomplete or text in names.suspects:
            raise Broken
        known = list(names.parameters)
        if context.coordinates:
            known += names.coordinates
        if context.definitions:
            known += names.definitions
        shown = []
        for other in nearest(text, known):
            what, line = names.lines.get(other, ("", 0))
            place = f", line {line}" if line else ""
            shown.append(f"`{other}` ({what}{place})" if what else f"`{other}`")
        help_: str | None
        if text == "lambda":
            help_ = "name the constraint: `lambda.NAME`"
        elif text in FUNCTIONS:
            help_ = f"`{text}` is a function: write `{text}(x)`"
        elif text.lower() in ("inf", "nan", "infinity"):
            help_ = "numbers are finite"
        elif text in _CONSTANTS:
            help_ = _CONSTANTS[text]
        elif shown:
            help_ = did_you_mean(shown)
        elif name.primes or not context.coordinates:
            block = "coordinates" if name.primes else "parameters"
            help_ = f"declare it under `{block}`"
        else:
            help_ = f"declare it, for instance under `parameters`: `{text}: 1`"
        return ExpressionError(
            "unknown-name",
            f"{context.where} uses `{text}`, which is not declared",
            name.start,
            name.end,
            help_,
            text,
        )


_ACCELERATIONS = "accelerations may stand in `outputs` only"
_CONSTANTS = {
    "e": "e^x is written `exp(x)`, e itself `exp(1)`",
    "E": "e^x is written `exp(x)`, e itself `exp(1)`",
    "Pi": "the constant is `pi`",
    "PI": "the constant is `pi`",
    "π": "the constant is `pi`",
}


def _entries(value: Value) -> tuple[Basic, ...]:
    return value.entries if isinstance(value, Tensor) else (value,)
