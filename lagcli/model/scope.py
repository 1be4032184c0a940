"""What the names in a model's expressions stand for, and where they may stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import symengine as se
from symengine import Basic

from lagcli.model import model as symbols
from lagcli.model.expressions import Sized, Value
from lagcli.model.grammar import ExpressionError, Name
from lagcli.model.source import nearest
from lagcli.model.tensors import Tensor

DOTS = (("_ddot", 2), ("_dot", 1))


@dataclass(frozen=True)
class Context:
    """Where an expression stands, and what may be named there."""

    where: str
    coordinates: bool = True
    velocities: bool = True
    accelerations: bool = False
    multipliers: bool = False
    definitions: bool = True
    time: bool = True


@dataclass
class Names:
    """All names that a model declares, with the line that declares each."""

    coordinates: tuple[str, ...] = ()
    constraints: tuple[str, ...] = ()
    parameters: Mapping[str, Callable[[], Basic]] = field(default_factory=dict)
    definitions: Mapping[str, Callable[[], Sized]] = field(default_factory=dict)
    lines: dict[str, tuple[str, int]] = field(default_factory=dict)  # name → what it is, its line

    def derivative(self, expression: Basic) -> Basic:
        """Return the total time derivative of an expression in q, q' and t."""
        free = expression.free_symbols
        terms = [expression.diff(symbols.TIME)] if symbols.TIME in free else []
        for name in self.coordinates:
            q, v, a = (f(name) for f in _MOTION)
            if q in free:
                terms.append(expression.diff(q) * v)
            if v in free:
                terms.append(expression.diff(v) * a)
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

    def lookup(self, name: Name) -> Sized:
        """Return what a name stands for, or raise ExpressionError."""
        text, primes = name.text, name.primes
        if not self.declared(text):
            for suffix, order in DOTS:
                base = text.removesuffix(suffix)
                if base != text and self.declared(base):
                    text, primes = base, primes + order
                    break
        if text in self.names.coordinates:
            return self._coordinate(name, text, primes)
        if text in self.names.definitions:
            return self._definition(name, text, primes)
        if "." in text:
            return Sized(self._dotted(name), 1)
        if text in self.names.parameters:
            if primes:
                raise self._error(
                    "constant", name, f"`{text}` is a parameter: its time derivative is zero"
                )
            return Sized(self.names.parameters[text](), 1)
        if text in ("t", "pi") and not primes:
            if text == "t" and not self.context.time:
                raise self._not_here(name, "time")
            return Sized(symbols.TIME if text == "t" else se.pi, 1)
        raise self._unknown(name)

    def declared(self, text: str) -> bool:
        """Whether a name is declared."""
        names = self.names
        return text in names.coordinates or text in names.parameters or text in names.definitions

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

    def _coordinate(self, name: Name, text: str, primes: int) -> Sized:
        if not self.context.coordinates:
            raise self._not_here(name, "coordinates")
        if primes > 2:
            raise self._error("too-many-primes", name, "derivatives of coordinates end at q''")
        if primes == 1 and not self.context.velocities:
            raise self._not_here(name, "velocities")
        if primes == 2 and not self.context.accelerations:
            raise self._not_here(
                name, "accelerations", "accelerations may stand in `outputs` only"
            )
        return Sized(_MOTION[primes](text), 1)

    def _definition(self, name: Name, text: str, primes: int) -> Sized:
        if not self.context.definitions:
            raise self._not_here(name, "definitions")
        sized = self.names.definitions[text]()
        value, size = sized.value, sized.size
        for _ in range(primes):
            value = (
                value.map(self.names.derivative)
                if isinstance(value, Tensor)
                else self.names.derivative(value)
            )
            size *= 3  # a product rule's worth
        self._check_content(name, value)
        return Sized(value, size)

    def _check_content(self, name: Name, value: Value) -> None:
        """Refuse a definition that carries in what may not stand here."""
        context = self.context
        if context.accelerations and context.velocities:
            return
        free = set()
        for entry in value.entries if isinstance(value, Tensor) else (value,):
            free |= entry.free_symbols
        for q in self.names.coordinates:
            if not context.accelerations and symbols.acceleration(q) in free:
                raise self._not_here(
                    name, "accelerations", "accelerations may stand in `outputs` only"
                )
            if not context.velocities and symbols.velocity(q) in free:
                raise self._not_here(name, "velocities")

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
            self._known(name, rest[0], names.constraints, "constraint")
            return symbols.multiplier(rest[0])
        if head == "Qc" and len(rest) in (1, 2) and not name.primes:
            self._known(name, rest[-1], names.coordinates, "coordinate")
            if len(rest) == 1:
                return symbols.constraint_force(rest[0])
            self._known(name, rest[0], names.constraints, "constraint")
            return symbols.constraint_force(rest[1], rest[0])
        raise self._error(
            "unknown-name",
            name,
            f"{self.context.where} uses `{name.text}`, which is not declared",
            "dotted names are `lambda.CONSTRAINT`, `Qc.COORDINATE` and `Qc.CONSTRAINT.COORDINATE`",
        )

    def _known(self, name: Name, part: str, known: tuple[str, ...], what: str) -> None:
        if part in known:
            return
        close = nearest(part, list(known)) or list(known[:3])
        raise self._error(
            "unknown-name",
            name,
            f"{self.context.where} uses `{name.text}`, but there is no {what} `{part}`",
            ("did you mean " if close else f"the model has no {what}s")
            + " or ".join(f"`{c}`" for c in close)
            + ("?" if close else ""),
        )

    def _unknown(self, name: Name) -> ExpressionError:
        names, context = self.names, self.context
        known = list(names.parameters)
        if context.coordinates:
            known += names.coordinates
        if context.definitions:
            known += names.definitions
        close = nearest(name.text, known)
        help_ = None
        if name.text == "lambda":
            help_ = "name the constraint: `lambda.NAME`"
        elif close:
            shown = []
            for c in close:
                what, line = names.lines.get(c, ("", 0))
                place = f", line {line}" if line else ""
                shown.append(f"`{c}` ({what}{place})" if what else f"`{c}`")
            help_ = "did you mean " + " or ".join(shown) + "?"
        elif name.text in ("e", "E") or name.text == "Pi":
            help_ = "the constants are `pi` and what you declare; e^x is exp(x)"
        else:
            help_ = f"declare it, for instance under `parameters`: `{name.text}: 1`"
        return self._error(
            "unknown-name",
            name,
            f"{context.where} uses `{name.text}`, which is not declared",
            help_,
        )
