"""Parser of ``--vary``: NAME=VALUES, or @FILE.csv, as factors of a plan."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import symengine as se

from lagcli.errors import Diagnostic, FileError, ModelError, SourceLocation, UsageError
from lagcli.files import check_readable, read_failure
from lagcli.model.csv_table import split_title
from lagcli.model.expression.constants import number as constant_value
from lagcli.model.expression.dimension import Factor
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tensors import Tensor
from lagcli.model.expression.tokens import ExpressionError, decimal
from lagcli.model.expression.units import UNIT_HELP, UnknownUnit, commensurable, remedy, to_si
from lagcli.model.model import Model
from lagcli.model.names.building import build, name_errors
from lagcli.model.names.namespace import Allowed, Namespace
from lagcli.model.names.scope import Scope
from lagcli.model.sections.initial import stated_unit
from lagcli.model.spelling import did_you_mean, nearest
from lagcli.prose import counted
from lagcli.sweeps.plan import factors
from lagcli.sweeps.plan.factors import Distribution, TableFactor

#: Largest number of values of a grid; larger ones are typing errors.
MOST_VALUES = 10**9

_UNIT = re.compile(
    r"(?<=[0-9.)])(?:\s*+(?![eE][+-]?[0-9])(?=[^\W\d_]|[°˚℃℉])|\s++(?=1\s*/))([^,:]+)$"
)
_CALL = re.compile(r"\s*([a-z]+)\s*(?=\()")
_GRIDS = {"linspace": "linspace(first, last, count)", "logspace": "logspace(first, last, count)"}
_DISTRIBUTIONS = {
    "uniform": "uniform(lowest, highest)",
    "loguniform": "loguniform(lowest, highest)",
    "normal": "normal(mean, deviation)",
}
FORMS = (
    "values are 1:2:0.1, 0.2,0.3, linspace(1, 2, 11), logspace(0.01, 1, 3) or @file.csv;\nranges"
    " for --sample are 1..2, uniform(1, 2), loguniform(0.01, 1), normal(1, 0.1)"
)

Value = Fraction | float


class Drawn(NamedTuple):
    """A quantity whose values are drawn from a distribution."""

    name: str
    distribution: Distribution
    text: str


def read_vary(text: str, model: Model) -> factors.Factor | Drawn:
    """Parse one ``--vary``.

    Parameters
    ----------
    text : str
        ``NAME=VALUES`` or ``@FILE.csv``.
    model : Model

    Returns
    -------
    Factor or Drawn

    Raises
    ------
    UsageError
        The text does not have this form, or the model has no such quantity.
    ModelError
        The values have an error; the location is stated.
    FileError
        The file cannot be read.
    """
    if text.lstrip().startswith("@"):
        return read_table(text.strip()[1:], model)
    name, equals, values = text.partition("=")
    if not (equals and name.strip() and values.strip()):
        raise UsageError(
            f"--vary {text!r} is not of the form NAME=VALUES, as in --vary m=1:2:0.1"
            " (or @file.csv); " + FORMS.replace("\n", " ")
        )
    if values.lstrip().startswith("@"):
        raise UsageError(
            f"--vary {text!r}: the file names its columns; give --vary {values.strip()}"
        )
    try:
        known = varied_name(model, name)
    except UsageError as error:
        raise UsageError(f"--vary: {error}") from None
    return _VaryReader(OptionText(f"--vary {known}", values), known, model).read()


@dataclass(frozen=True)
class _VaryReader:
    """Reads the values of one quantity."""

    option: OptionText
    name: str
    model: Model

    def read(self) -> factors.Factor | Drawn:
        text = self.option.text
        whole = 0, len(text)
        call = _CALL.match(text)
        if call and call[1] in (*_GRIDS, *_DISTRIBUTIONS):
            end = self.closing(call.end())
            if end is not None:
                rest = text[end + 1 :].strip()
                inside = self.pieces((call.end() + 1, end), ",")
                after = (end + 1 + text[end + 1 :].index(rest), len(text)) if rest else None
                if call[1] in _GRIDS:
                    return self.spaced(call[1], inside, after)
                return self.drawn(call[1], self.in_units(inside, after))
        if ".." in text:
            return self.drawn("uniform", self.in_units(self.pieces(whole, "..")))
        if ":" in text:
            return self.steps(self.pieces(whole, ":"))
        return self.listed(whole)

    def closing(self, start: int) -> int | None:
        """Return the position of the parenthesis that closes the one at ``start``."""
        depth = 0
        for at, sign in enumerate(self.option.text[start:], start):
            depth += (sign == "(") - (sign == ")")
            if depth == 0:
                return at
        return None

    def in_units(
        self, pieces: list[tuple[int, int]], after: tuple[int, int] | None = None
    ) -> list[Value]:
        """Return numbers in SI; see `read_units`."""
        values, si = self.read_units(pieces, after)
        return [x * si for x in values]

    def read_units(
        self, pieces: list[tuple[int, int]], after: tuple[int, int] | None = None
    ) -> tuple[list[Value], Factor]:
        """Return numbers, and the factor by which they are converted to SI, each rounded once.

        Each of them has a unit; or the last has one, or a unit follows at ``after``, for all.
        """
        text = self.option.text
        own = [bool(_UNIT.search(text[:end], start)) for start, end in pieces]
        if after is not None and any(own):
            raise self.error(
                "there is a unit within the parentheses, and another behind them",
                "keep one of them",
                after,
            )
        if not all(own) and any(own[:-1]):
            raise self.error(
                "some of these values have a unit, and some have none",
                "write the unit after each of them, or after the last for all",
                pieces[own.index(False)],
            )
        common = self.factor(after) if after is not None else self.without_unit(*pieces[-1])[2]
        values, sizes = [], []
        for (start, end), has_own in zip(pieces, own, strict=True):
            start, end, si = self.without_unit(start, end) if has_own else (start, end, common)
            values.append(self.number((start, end)))
            sizes.append(si)
        if len(set(sizes)) == 1:
            return values, common
        return [x * si for x, si in zip(values, sizes, strict=True)], Fraction(1)

    def factor(self, span: tuple[int, int] | None) -> Factor:
        """Return the factor to SI of the unit in a span; without a unit, of SI."""
        unit = self.option.text[slice(*span)] if span else None
        form = f'after the values, as in --vary "{self.name}=1:2:0.1 UNIT"'
        try:
            return si_factor(self.model, self.name, unit, form)
        except UsageError as error:
            raise UsageError(f"{self.option.option}: {error}") from None
        except UnknownUnit as error:
            assert span is not None
            raise self.option.error("unknown-unit", str(error), *span, UNIT_HELP) from None

    def error(self, message: str, help_: str, span: tuple[int, int] | None = None) -> Exception:
        start, end = span or (0, len(self.option.text))
        return self.option.error("bad-values", message, start, end, help_)

    def without_unit(self, start: int, end: int) -> tuple[int, int, Factor]:
        """Return the span before the unit at its end, and the factor to SI."""
        match = _UNIT.search(self.option.text[:end], start)
        if match is None:
            return start, end, self.factor(None)
        unit_end = match.start(1) + len(match[1].rstrip())
        return start, match.start(), self.factor((match.start(1), unit_end))

    def pieces(self, span: tuple[int, int], mark: str) -> list[tuple[int, int]]:
        """Return the spans between separators outside of parentheses."""
        text, (start, end) = self.option.text, span
        pieces, depth, at = [], 0, start
        while at < end:
            depth += (text[at] == "(") - (text[at] == ")")
            if depth == 0 and text.startswith(mark, at) and at + len(mark) <= end:
                pieces.append((start, at))
                start = at = at + len(mark)
            else:
                at += 1
        return [*pieces, (start, end)]

    def number(self, span: tuple[int, int]) -> Value:
        """Return a number, or the value of an expression of numbers."""
        value = self.expression(self.option.text[slice(*span)], span[0])
        try:
            finite = math.isfinite(float(value))
        except OverflowError:
            finite = False
        if not finite:
            raise self.error("this is not a finite number", "numbers go up to 1.8e308", span)
        return value

    def expression(self, text: str, start: int) -> Value:
        scope = Scope(Namespace(), "a value", Allowed.NUMBERS)
        try:
            tree = parse(text)
            errors, _ = name_errors(tree, scope)
            for error in errors:
                error.help = FORMS
                raise error
            value = build(tree, scope).value
            if isinstance(value, Tensor):
                raise ExpressionError("shape", "a value is a number", 0, len(text))
            if isinstance(value, se.Rational):
                return Fraction(*map(int, value.get_num_den()))
            return constant_value(value)
        except ExpressionError as error:
            raise self.option.expression_error(error, start) from None
        except ValueError:
            span = start, start + len(text)
            raise self.error("this has no real, finite value", FORMS, span) from None

    # grids

    def steps(self, pieces: list[tuple[int, int]]) -> factors.Factor:
        if len(pieces) != 3:
            raise self.error(
                "a grid has a first value, a last value and a step", "write it as 1:2:0.1"
            )
        (first, last, step), si = self.read_units(pieces)
        if step == 0 or (last - first) * step < 0:
            raise self.error(
                f"steps of {float(step):g} do not lead from {float(first):g} to {float(last):g}",
                "write first:last:step, as in 1:2:0.1 or 2:1:-0.1",
                pieces[2],
            )
        # the last multiple of the step within rounding of the end counts as the end
        count = math.floor((last - first) / step * (1 + Fraction(1, 10**12)) + Fraction(1, 10**9))
        if count >= MOST_VALUES:
            raise self.error("these are more than 10^9 values", "take a larger step", pieces[2])
        return factors.Steps((self.name,), first, step, count + 1, si)

    def spaced(
        self, function: str, pieces: list[tuple[int, int]], after: tuple[int, int] | None
    ) -> factors.Factor:
        if len(pieces) != 3:
            span = pieces[0][0], pieces[-1][1]
            raise self.error(f"`{function}` takes three numbers", f"write {_GRIDS[function]}", span)
        (first, last), si = self.read_units(pieces[:2], after)
        count = self.number(pieces[2])
        if count != int(count) or not 1 <= count <= MOST_VALUES:
            raise self.error(
                "the number of values is a whole number from 1 to 10^9",
                f"write {_GRIDS[function]}",
                pieces[2],
            )
        n = int(count)
        if function == "linspace":
            step = (last - first) / (n - 1) if n > 1 else Fraction(0)
            return factors.Steps((self.name,), first, step, n, si)
        if first <= 0 or last <= 0:
            raise self.error(
                "both ends of `logspace` are values greater than 0",
                "its ends are values, not exponents: logspace(0.01, 1, 3) is 0.01, 0.1, 1",
                pieces[0 if first <= 0 else 1],
            )
        return factors.Ratios((self.name,), float(first * si), float(last * si), n)

    def listed(self, span: tuple[int, int]) -> factors.Factor:
        values = [float(x) for x in self.in_units(self.pieces(span, ","))]
        return factors.TableFactor((self.name,), np.array(values)[:, None])

    # ranges

    def drawn(self, kind: str, given: Sequence[Value]) -> Drawn:
        form = _DISTRIBUTIONS[kind]
        if len(given) != 2:
            raise self.error("a range has two ends", f"write 1..2, or {form}")
        a, b = map(float, given)
        if kind == "normal":
            if b <= 0:
                raise self.error("the deviation must be greater than 0", f"write {form}")
        elif b <= a:
            raise self.error(f"the range {a:g} to {b:g} is empty", f"write {form}")
        if kind == "loguniform" and a <= 0:
            raise self.error("a logarithmic range is greater than 0", f"write {form}")
        return Drawn(self.name, Distribution(kind, a, b), self.option.text)


def varied_name(model: Model, name: str) -> str:
    """Return the parameter, coordinate or velocity (``phi'``) that a name denotes.

    Raises
    ------
    UsageError
        The model has no such quantity.
    """
    plain = model.names.unaliased("".join(name.split()))
    if plain in model.parameters or plain in model.initial_positions:
        return plain
    base, bracket, index = plain.partition("_dot[")
    for rate in (plain.removesuffix("'"), plain.removesuffix("_dot"), f"{base}[{index}"):
        if rate != plain and rate in model.initial_velocities and (bracket or "[" not in index):
            return f"{rate}'"
    known = [*model.parameters, *model.initial_positions]
    known += [f"{q}'" for q in model.initial_velocities]
    help_ = did_you_mean(nearest(plain, known)) or "it has " + ", ".join(known[:30])
    raise UsageError(f"the model has no parameter or initial value `{plain}`; {help_}")


def si_factor(model: Model, name: str, unit: str | None, form: str = "after the number") -> Factor:
    """Return the factor that converts values of a quantity to SI.

    Parameters
    ----------
    model : Model
    name : str
    unit : str or None
        As given here.
    form : str, optional
        Where a missing unit is to be written, with ``UNIT`` in its place.

    Raises
    ------
    UsageError
        The file gives the parameter in a unit other than SI, and no unit is given here, or it gives
        the quantity in a unit of another dimension.
    UnknownUnit
    """
    parameter = model.parameters.get(name)
    stated = parameter.unit if parameter else None
    if parameter is None:
        stated = stated_unit(name, model.initial[name], model.coordinates)
    if unit is not None:
        factor = to_si(unit)
        if stated is not None and not commensurable(unit, stated):
            raise UsageError(
                f"`{name}` is in {stated} in the file, and in {unit} here; {remedy(stated, unit)}"
            )
        return factor
    if stated is not None and to_si(stated) != 1:
        raise UsageError(
            f"`{name}` is given in {stated} in the file, and without a unit here;"
            f" write the unit {form.replace('UNIT', stated)}"
        )
    return Fraction(1)


@dataclass(frozen=True)
class OptionText:
    """The value of an option, with positions for messages.

    Parameters
    ----------
    option : str
        Name of the option, such as ``--vary``.
    text : str
        The complete value.
    """

    option: str
    text: str

    def error(
        self, kind: str, message: str, start: int, end: int, help_: str | None = None
    ) -> ModelError:
        """Return an error about the characters from ``start`` to ``end``."""
        place = SourceLocation(self.option, 0, start + 1, max(1, end - start), self.text)
        return ModelError([Diagnostic(kind, message, place, help_)])

    def expression_error(self, error: ExpressionError, offset: int) -> ModelError:
        """Return an error of an expression that begins at ``offset``."""
        return self.error(
            error.kind, error.message, offset + error.start, offset + error.end, error.help
        )


def read_table(path: str, model: Model) -> TableFactor:
    """Read a table of values.

    Parameters
    ----------
    path : str
        A CSV file. Its first line names parameters, coordinates and velocities (``phi'`` or
        ``phi_dot``), each with its unit in brackets if that is not SI: ``l [cm]``.
    model : Model

    Raises
    ------
    FileError
        The file cannot be read, or an entry is not a number.
    UsageError
        A column is not a parameter or initial value of the model.
    """
    check_readable(path)
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = csv.reader(file)
            titles = next(lines, [])
            rows = [(lines.line_num, row) for row in lines if any(x.strip() for x in row)]
    except OSError as error:
        raise read_failure(path, error) from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"cannot read {path}: it is not a CSV file ({error})") from None
    columns, si = _columns(path, titles, model)
    if not rows:
        raise FileError(f"{path} contains no values; write one line for each run below the names")
    values = np.empty((len(rows), len(columns)))
    for i, (line, row) in enumerate(rows):
        if len(row) != len(columns):
            raise FileError(
                f"{path}:{line}: {counted(len(row), 'value')} under"
                f" {counted(len(columns), 'name')}; give one for each"
            )
        for j, text in enumerate(row):
            values[i, j] = _number(f"{path}:{line}: `{columns[j]}`", text) * si[j]
    return TableFactor(columns, values)


def _columns(path: str, titles: list[str], model: Model) -> tuple[tuple[str, ...], list[float]]:
    columns: list[str] = []
    si: list[float] = []
    for title in titles:
        whole = title.strip()
        name, unit = split_title(title)
        try:
            known = varied_name(model, name)
            factor = float(si_factor(model, known, unit, f"in the title, `{name} [UNIT]`"))
        except UnknownUnit as error:
            raise UsageError(
                f"{path}:1: `{whole}`: {error}; write the column as `l [cm]`"
            ) from None
        except UsageError as error:
            raise UsageError(f"{path}:1: {error}") from None
        if known in columns:
            raise UsageError(f"{path}:1: `{known}` has two columns; keep one of them")
        columns.append(known)
        si.append(factor)
    return tuple(columns), si


def _number(where: str, text: str) -> float:
    value = decimal(text)
    if value is None or math.isinf(value):
        raise FileError(f"{where}: {text.strip()!r} is not a finite number; write it as 0.25")
    return value
