"""The result of an analysis as sections of tables, for text, pages and notebooks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lagcli.analysis.output.text import width
from lagcli.columns import unit_quotient


class ModelName(str):
    """A name of the model: a coordinate, a parameter, a column such as ``lambda.rod``."""

    __slots__ = ()


class UnitText(str):
    """A unit in the notation of model files; ``1`` for numbers."""

    __slots__ = ()


class Phasor(complex):
    """A component of a shape, shown by its magnitude and phase; a real one by its value."""

    __slots__ = ()


class Phrase(NamedTuple):
    """Words with numbers in the places of ``{}``."""

    text: str
    values: tuple[float, ...] = ()
    digits: int = 6


#: A value of a table. Complex ones are eigenvalues, of which the conjugate is one too.
Cell = str | int | float | complex | Phrase | None


class TextColumn(NamedTuple):
    """How text shows a column.

    Parameters
    ----------
    head : str
    form : str
        Format of head and values, such as ``"  {:>9}"``.
    texts : sequence of str, optional
        The values as text, if not with the digits of the column.
    """

    head: str
    form: str
    texts: Sequence[str] | None = None


class ResultColumn(NamedTuple):
    """A column of a table.

    Parameters
    ----------
    name : str
    values : sequence of Cell
        Empty text where there is no value; numbers in SI.
    unit : str
        Unit of all values; empty if none is shown.
    digits : int
        Significant digits of numbers.
    text : TextColumn, optional
        Columns without it are shown on pages alone.
    """

    name: str
    values: Sequence[Cell]
    unit: str = ""
    digits: int = 6
    text: TextColumn | None = None


class ResultTable(NamedTuple):
    """A table, whose first column names the rows.

    Parameters
    ----------
    caption : Phrase
    columns : sequence of ResultColumn
        Pages omit those without values.
    facts : bool
        Whether it is a list of facts, with a label and a value in each row.
    """

    caption: Phrase
    columns: Sequence[ResultColumn]
    facts: bool = False

    def lines(self) -> list[str]:
        """Return the parts of the table, with an empty line between them."""
        first, *others = self.parts()
        return [*first, *(line for part in others for line in ("", *part))]

    def parts(self, identifying: int = 1) -> list[list[str]]:
        """Return the head and the rows of the columns that text shows.

        The columns that do not fit beside the others form further parts, each with those that
        identify the rows.

        Parameters
        ----------
        identifying : int
            Number of first columns that identify a row.
        """
        cells = self._cells()
        names, *others = cells[:identifying], *cells[identifying:]
        room = width() - sum(max(map(len, column)) for column in names)
        parts: list[list[list[str]]] = [[]]
        left = room
        for column in others:
            if parts[-1] and max(len(cell.rstrip()) for cell in column) > left:
                parts.append([])
                left = room
            parts[-1].append(column)
            left -= max(map(len, column))
        return [
            ["".join(row).rstrip() for row in zip(*names, *part, strict=True)] for part in parts
        ]

    def _cells(self) -> list[list[str]]:
        """Return the columns of text, each with its head and values, as they are written."""
        shown = [(column, column.text) for column in self.columns if column.text is not None]
        texts = [
            text.texts
            if text.texts is not None
            else [_text(x, column.digits) for x in column.values]
            for column, text in shown
        ]
        return [
            [text.form.format(x) for x in (text.head, *values)]
            for values, (_, text) in zip(texts, shown, strict=True)
        ]


class Remark(NamedTuple):
    """A paragraph: a sentence, or names with or without numbers between two texts.

    Parameters
    ----------
    text : str
        Code is in backticks.
    names : sequence of (str, float or None)
    end : str
    kind : "", "note" or "failure"
    """

    text: str
    names: Sequence[tuple[str, float | None]] = ()
    end: str = ""
    kind: str = ""


class PlotPlace(NamedTuple):
    """The place of the analysis' plot, and its caption."""

    caption: str


SectionBlock = ResultTable | Remark | PlotPlace


class ResultSection(NamedTuple):
    """A part of a page.

    Parameters
    ----------
    anchor, title : str
    blocks : sequence of SectionBlock
    of : sequence of str
        Names of the model that follow the title.
    """

    anchor: str
    title: str
    blocks: Sequence[SectionBlock]
    of: Sequence[str] = ()


def eigenvalue_text(s: complex, digits: int = 9) -> str:
    """Return an eigenvalue, or a pair of complex ones."""
    if not s.imag:
        return f"{s.real:.{digits}g}"
    return f"{s.real:.{digits}g} ± {s.imag:.{digits}g}i" if s.real else f"± {s.imag:.{digits}g}i"


def _text(value: Cell, digits: int) -> str:
    if isinstance(value, complex):
        return eigenvalue_text(value, digits)
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    return str(value)


def more(count: int, shown: int) -> list[Remark]:
    """Return the remark that a page does not show all, if so."""
    rest = count - shown
    return [Remark(f"And {rest} more in the file.", kind="note")] if rest > 0 else []


def note_remarks(notes: Sequence[str]) -> list[Remark]:
    """Return the notes of an analysis as sentences."""
    return [Remark(f"{x[0].upper()}{x[1:]}.", kind="note") for x in notes]


def names_of(names: Sequence[str]) -> list[tuple[str, None]]:
    """Return the names of a remark without numbers."""
    return [(name, None) for name in names]


def unit_of(name: str, units: Mapping[str, str], rate: bool = False) -> UnitText:
    """Return the unit of a quantity, or of its rate; empty if it is not known."""
    unit = units.get(name, "")
    if not rate or not unit:
        return UnitText(unit)
    return UnitText(unit_quotient(unit, "s"))


class StateQuantity(NamedTuple):
    """A quantity of one or several states: its name, unit and values."""

    name: str
    unit: UnitText
    values: list[Cell]


def state_quantities(
    states: Sequence[Mapping[str, Any]], units: Mapping[str, str]
) -> list[StateQuantity]:
    """Return q, velocities that are not all zero, λ and contacts of states.

    Parameters
    ----------
    states : sequence of mapping
        With ``q``, ``v``, ``multipliers`` and ``contacts`` by name, as in the schemas of analyses.
    units : mapping of str to str
        By coordinate, and of λ by column.
    """
    first = states[0]
    quantities = [
        StateQuantity(ModelName(q), unit_of(q, units), [x["q"][q] for x in states])
        for q in first["q"]
    ]
    quantities += [
        StateQuantity(ModelName(f"{q}'"), unit_of(q, units, rate=True), [x["v"][q] for x in states])
        for q in first["v"]
        if any(x["v"][q] for x in states)
    ]
    quantities += [
        StateQuantity(
            ModelName(f"lambda.{c}"),
            unit_of(f"lambda.{c}", units),
            [x["multipliers"].get(c, "") for x in states],
        )
        for c in dict.fromkeys(c for x in states for c in x["multipliers"])
    ]
    quantities += [
        StateQuantity(ModelName(c["name"]), UnitText(), [x["contacts"][k]["state"] for x in states])
        for k, c in enumerate(first.get("contacts", ()))
    ]
    return quantities
