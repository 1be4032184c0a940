"""Parser of measures: expressions over a run, such as ``max(abs(lambda.guide))``.

A measure is an expression of reductions. A reduction computes one number from a signal, an
expression that varies along the run; expressions outside of reductions are constant along it.
``max`` and ``min`` of one argument are reductions, of several arguments the functions of the
grammar. ``count(floor impacts)``, ``time_of(kick)`` and ``impulse.floor`` are numbers from the log
of events.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Literal, NamedTuple, get_args

import symengine as se
from symengine import Basic

from lagcli.columns import RESIDUALS, SCALARS, SLIP, ColumnName
from lagcli.model.diagnostics import Broken, Diagnostics
from lagcli.model.expression.constants import number
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Sized, Tensor
from lagcli.model.expression.tokens import ExpressionError, error_at
from lagcli.model.expression.trees import CallExpr, IndexedSumExpr, Name, NumberExpr, Tree, walk
from lagcli.model.model import ContactChange, Model
from lagcli.model.names.building import build, name_errors
from lagcli.model.names.expansion import expand, rebuilt
from lagcli.model.names.namespace import Allowed
from lagcli.model.names.scope import Scope
from lagcli.model.yaml.source import Scalar, Source

_NAME = r"[^\W\d][\w.]*(?:\[[^\]]*\])?"
_CHANGES = "|".join(get_args(ContactChange))
_MEASURE = re.compile(
    rf"\b(?P<kind>count|time_of)\(\s*(?P<name>{_NAME})(?:\s+(?P<change>{_CHANGES}))?\s*\)"
    rf"|\bimpulse\.(?P<row>{_NAME})"
)


class EventMeasure(NamedTuple):
    """One number from the event log of a run.

    Parameters
    ----------
    kind : "count", "time_of" or "impulse"
        Number of occurrences, time of the first one, or sum of the impulses of a constraint.
    name : str
        Name of the constraint or event.
    occurrence : str
        Change as in the log; None for "impulse".
    """

    kind: Literal["count", "time_of", "impulse"]
    name: str
    occurrence: str = ""


def event_measures(model: Model, text: str) -> tuple[str, Mapping[str, EventMeasure]]:
    """Return a measure with names instead of its calls on contacts and events.

    Parameters
    ----------
    model : Model
    text : str

    Returns
    -------
    text : str
        Has the same length as before, so that offsets remain valid.
    measures : mapping of str to EventMeasure
        By the names that represent them.

    Raises
    ------
    ExpressionError
        The model has no such constraint or event, or the change is impossible for it.
    """
    measures: dict[str, EventMeasure] = {}

    def replaced(match: re.Match[str]) -> str:
        measure = _measure(model, match)
        if measure is None:
            return match[0]
        name = f"event{len(measures)}".ljust(len(match[0]), "_")
        measures[name] = measure
        return name

    return _MEASURE.sub(replaced, text), measures


def _measure(model: Model, match: re.Match[str]) -> EventMeasure | None:
    """Return the requested number; None for an ordinary measure, such as a condition by name."""
    constraints = model.constraint_names
    if match["row"] is not None:
        _check(match, "row", constraints, "constraint")
        return EventMeasure("impulse", match["row"])
    kind: Literal["count", "time_of"] = "count" if match["kind"] == "count" else "time_of"
    name, change = match["name"], match["change"]
    events = tuple(event.name for event in model.events)
    if change is None:
        if kind == "time_of" and name not in events:
            return None
        _check(match, "name", events, "event")
        return EventMeasure(kind, name, "event")
    _check(match, "name", constraints, "constraint")
    if change in ("slips", "sticks") and name + SLIP in constraints:
        name += SLIP
    row = model.constraints[constraints.index(name)]
    limited = change in ("slips", "sticks")
    if row.limit is None if limited else not row.sign:
        missing = "friction and no limit" if limited else "contact: it holds in both directions"
        raise ExpressionError(
            "not-a-measure",
            f"`{match[0]}`: the constraint `{name}` has no {missing}",
            match.start("name"),
            match.end("change"),
            _listed("constraint", constraints),
        )
    return EventMeasure(kind, name, "impact" if change == "impacts" else change)


def _check(match: re.Match[str], part: str, names: tuple[str, ...], what: str) -> None:
    if match[part] not in names:
        raise ExpressionError(
            "unknown-name",
            f"`{match[0]}`: the model has no {what} `{match[part]}`",
            match.start(part),
            match.end(part),
            _listed(what, names),
        )


def _listed(what: str, names: tuple[str, ...]) -> str:
    listed = ", ".join(names[:12]) + (", …" if len(names) > 12 else "")
    return f"its {what}s are {listed or 'none'}"


#: The reductions, and the numbers of arguments of a call.
REDUCTIONS = {
    **dict.fromkeys(["max", "min", "argmax", "argmin", "mean", "rms", "final", "time_of"], 1),
    "at": 2,
}
#: Signals of every run, by their names in result files.
COLUMNS = tuple(quantity.name for quantity in (*SCALARS, *RESIDUALS))
_RESIDUALS = tuple(quantity.name for quantity in RESIDUALS)
_MARK = "#"  # no name of the grammar begins with it


class Reduction(NamedTuple):
    """A reduction of a signal to one number.

    Parameters
    ----------
    kind : str
        Kind of ``REDUCTIONS``.
    signal : expression
        Expression in t, q, v, a, multipliers, constraint forces, parameters and ``COLUMNS``; for
        ``time_of``, 1 where the condition holds, and 0 elsewhere.
    time : float, optional
        Time of ``at``, s.
    event : EventMeasure, optional
        Event of a number from the log, which has no signal; the expression is then 0.
    """

    kind: str
    signal: Basic
    time: float | None = None
    event: EventMeasure | None = None


class Measure(NamedTuple):
    """A parsed measure.

    Parameters
    ----------
    name, text : str
    value : expression
        Expression in parameters and the symbols of `reduced`.
    reductions : tuple of Reduction
    """

    name: str
    text: str
    value: Basic
    reductions: tuple[Reduction, ...]


def reduced(place: int) -> Basic:
    """Return the symbol that represents a measure's reduction of this index in its value."""
    return se.Symbol(f"{_MARK}{place}")


def read_measures(model: Model, texts: Sequence[tuple[str, str]]) -> tuple[Measure, ...]:
    """Parse measures.

    Parameters
    ----------
    model : Model
    texts : sequence of (name, expression)

    Raises
    ------
    ModelError
        Measures have errors; all are reported, each with its location.
    """
    report = Diagnostics([])
    measures = []
    for name, text in texts:
        option = "--measure" if name == text else f"--measure {name}"
        node = Scalar(Source(text, option, numbered=False), (0, 0), (0, len(text)), text)
        with report.expression(node):
            measures.append(_MeasureReader(model, name, text).read())
    report.finish()
    return tuple(measures)


class _SignalScope(Scope):
    """The names of a model, its outputs and the columns of result files."""

    def __init__(self, model: Model, where: str):
        super().__init__(model.names, where, Allowed.ACCELERATIONS)
        self.model = model

    def column(self, name: Name) -> Basic | None:
        """Return the value of a name that exists only in measures."""
        if name.primes or name.text in self.bound:
            return None
        text = name.text
        if not name.indices:
            if text in self.model.outputs:
                return self.model.outputs[text]
            if text in COLUMNS and not self.names.declared(text):
                return se.Symbol(text)
        head, _, constraint = text.partition(".")
        if head in _RESIDUALS and constraint:
            whole = self.named(name)[0].partition(".")[2]
            if whole in self.names.constraints:
                return se.Symbol(str(ColumnName(head, whole)))
            known = ", ".join(self.names.constraints) or "none"
            raise ExpressionError(
                "unknown-name",
                f"{self.where} uses `{text}`, but the model has no constraint `{whole}`",
                name.start,
                name.end,
                f"its constraints are {known}",
            )
        if name.indices and not self.names.declared(text):
            return self.model.outputs.get(self.named(name)[0])
        return None

    def check(self, name: Name) -> None:
        """Raise ExpressionError for a name that is not allowed here."""
        if self.column(name) is None:
            super().check(name)

    def lookup(self, name: Name) -> Sized:
        """Return the value of a name."""
        value = self.column(name)
        return super().lookup(name) if value is None else Sized(value)

    def check_series(self, tree: IndexedSumExpr) -> Scope:
        """Return the scope of a sum's term."""
        inside = super().check_series(tree)
        scope = _SignalScope(self.model, self.where)
        scope.bound = inside.bound
        return scope


class _ValueScope(_SignalScope):
    """Scope outside of reductions: reductions, parameters, and pi."""

    def column(self, name: Name) -> Basic | None:
        """Return the symbol of a reduction; reject quantities that vary along a run."""
        if name.text.startswith(_MARK):
            return se.Symbol(name.text)
        value = super().column(name)
        if value is not None and _varies(self.model, value):
            raise self.varying(name)
        return value

    def check(self, name: Name) -> None:
        """Raise ExpressionError for a name that varies along a run."""
        if self.column(name) is not None:
            return
        super().check(name)
        text, _ = self.names.resolve(name)
        if (
            text == "t"
            or "." in text
            or text in self.names.coordinates
            or "coordinate" in self.names.families.get(text, ())
        ):
            raise self.varying(name)

    def lookup(self, name: Name) -> Sized:
        """Return the value of a name."""
        sized = super().lookup(name)
        if not isinstance(sized.value, Tensor) and _varies(self.model, sized.value):
            raise self.varying(name)
        return sized

    def varying(self, name: Name) -> ExpressionError:
        return ExpressionError(
            "not-a-measure",
            f"`{name.text + chr(39) * name.primes}` varies along the run, and a measure is one"
            " number",
            name.start,
            name.end,
            f"reduce it to one number, for instance max({name.text}), final({name.text}),"
            f" at({name.text}, 1)",
        )


def _varies(model: Model, value: Basic) -> bool:
    """Whether an expression has symbols other than parameters and reductions."""
    return any(
        s.name not in model.parameters and not s.name.startswith(_MARK) for s in value.free_symbols
    )


class _MeasureReader:
    """Splits a measure into reductions and the expression of these."""

    def __init__(self, model: Model, name: str, text: str):
        self.model, self.name, self.text = model, name, text
        where = f"the measure `{name}`" if name != text else "the measure"
        self.signals = _SignalScope(model, where)
        self.values = _ValueScope(model, where)
        self.reductions: list[Reduction] = []
        self.events: Mapping[str, EventMeasure] = {}

    def read(self) -> Measure:
        text, self.events = event_measures(self.model, self.text)
        tree = _replaced(expand(parse(text), self.model.names), self.reduction)
        return Measure(self.name, self.text, self.built(tree, self.values), tuple(self.reductions))

    def reduction(self, tree: Tree) -> Tree | None:
        """Return the name that represents a reduction; None for any other tree."""
        if isinstance(tree, Name) and tree.text in self.events:
            event = self.events[tree.text]
            return self._named(tree, Reduction(event.kind, se.Integer(0), event=event))
        if not isinstance(tree, CallExpr) or tree.function not in REDUCTIONS:
            return None
        kind, count = tree.function, len(tree.arguments)
        if count != REDUCTIONS[kind]:
            if kind in ("max", "min") and count > 1:
                return None
            wanted = "at(EXPRESSION, TIME)" if kind == "at" else f"{kind}(EXPRESSION)"
            raise error_at("arguments", f"`{kind}` is written {wanted}", tree)
        for below in tree.arguments:
            for part in walk(below):
                if isinstance(part, CallExpr) and REDUCTIONS.get(part.function) == len(
                    part.arguments
                ):
                    raise error_at(
                        "nested-measure",
                        f"`{part.function}` is in the argument of `{kind}`: it is one number"
                        " along the run, not a signal",
                        part,
                        "combine them outside, as in max(x) - mean(x)",
                    )
        inner = tree.arguments[0]
        if kind == "time_of":  # 1 where the condition holds
            one, zero = (NumberExpr(inner.start, inner.end, Fraction(x)) for x in (1, 0))
            inner = CallExpr(inner.start, inner.end, "if", (inner, one, zero))
        signal = self.built(inner, self.signals)
        time = self.time(tree.arguments[1]) if kind == "at" else None
        return self._named(tree, Reduction(kind, signal, time))

    def _named(self, tree: Tree, reduction: Reduction) -> Name:
        """Return a new name for a reduction."""
        if reduction not in self.reductions:
            self.reductions.append(reduction)
        return Name(tree.start, tree.end, f"{_MARK}{self.reductions.index(reduction)}", 0)

    def time(self, tree: Tree) -> float:
        value = self.built(tree, self.values)
        if value.free_symbols:
            raise error_at(
                "bad-time", "the time of `at` is a number", tree, "write at(x, 0.5), in seconds"
            )
        try:
            return number(value)
        except ValueError:
            raise error_at("bad-time", "the time of `at` is not a finite number", tree) from None

    def built(self, tree: Tree, scope: _SignalScope) -> Basic:
        errors, _ = name_errors(tree, scope)
        for error in errors:
            raise error
        scope.missing.clear()
        try:
            value = build(tree, scope).value
        except Broken:
            raise error_at("unknown-name", "this has no value", tree) from None
        for error in scope.missing.values():
            raise error
        if isinstance(value, Tensor):
            raise error_at("shape", f"a measure is a number, not {value.kind}", tree)
        return value


def _replaced(tree: Tree, replacement: Callable[[Tree], Tree | None]) -> Tree:
    """Return a tree with some of its parts replaced."""
    other = replacement(tree)
    if other is not None:
        return other

    return rebuilt(tree, lambda part: _replaced(part, replacement))
