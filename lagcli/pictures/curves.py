"""The curves of a run that plots, reports and the live page draw: names, values, units, labels."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import product
from typing import NamedTuple

import numpy as np

from lagcli.arrays import Array
from lagcli.columns import (
    BY_NAME,
    DERIVATIVES,
    RESIDUALS,
    SAMPLED,
    SCALARS,
    ColumnName,
    column_names,
    derivative_names,
    impulse_unit,
    read_column_name,
    unit_of_column,
    unit_quotient,
)
from lagcli.equations.typesetting.notation import GREEK, Notation, split
from lagcli.errors import UsageError
from lagcli.model.names.members import format_members
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.pictures.run_file import RunFile
from lagcli.pictures.selection import drawable

#: Largest number of forces that are listed individually, constraints times coordinates.
_LISTED = 10_000
_SHOWN = 40  # names in a message
#: Matches the suffix of a family or a vector: the index of a member, a component, or both.
_PART = re.compile(r"(\[[^\]]*\])?(\.[a-z0-9]+)?")
_RATES = ("v", "a")
#: The field of impulses, which an event log has, and the prefix of their names.
IMPULSE, _IMPULSE = "impulse", "impulse."
_EVERY_MULTIPLIER = str(ColumnName("multipliers", "*"))
_DOTS = {"q": 0, "v": 1, "a": 2}
_RESIDUALS = {quantity.name: quantity for quantity in RESIDUALS}


class Curve(NamedTuple):
    """A quantity with one value per sample.

    Parameters
    ----------
    name : str
        Name on the command line, equal to the column of a CSV file.
    field : str
        Field of `Samples`; an output is ``outputs/NAME``.
    place : tuple of int or None
        Index in the field after the time; None if the curve is 0.
    group : str
        Label of the group of curves that share a panel.
    unit : str
        SI unit; empty if unknown.
    label : str
        Label in legends; see `Catalogue`.
    log : bool
        Whether its magnitude is drawn on a logarithmic axis.
    scale : float
        Divisor of the values.
    largest : bool
        Whether it is the largest magnitude in the field, relative to each constraint's scale.
    constraint : str
        The constraint of a multiplier, a force or a residual; empty for other curves.
    """

    name: str
    field: str
    place: tuple[int, ...] | None
    group: str
    unit: str
    label: str
    log: bool = False
    scale: float = 1.0
    largest: bool = False
    constraint: str = ""

    def of(self, block: Mapping[str, Array]) -> Array:
        """Return the values in a block of samples, (nt,); not of the largest magnitude."""
        values = block[self.field]
        if self.place is None:
            return np.zeros(len(values))
        chosen: Array = np.moveaxis(values, 0, -1)[self.place]
        return chosen if self.scale == 1 else chosen / self.scale


class Catalogue:
    """All curves of a run.

    Parameters
    ----------
    run : RunFile
    tex : bool
        Whether labels are for matplotlib, with TeX between dollar signs and names as typed if they
        are not letters; otherwise they are plain text, in which an underscore begins a subscript.
    """

    def __init__(self, run: RunFile, tex: bool = False):
        self.run, self.tex = run, tex
        self._labels = ColumnLabels(run.notation, tex)
        self._places = {name: i for i, name in enumerate(run.coordinates)}
        self._constraints = {name: i for i, name in enumerate(run.constraints)}
        self._conserved = {name: i for i, name in enumerate(run.conserved_names)}
        self._derivatives = {curve.name: curve for curve in self._differentiated()}

    def find(self, text: str) -> list[Curve]:
        """Return the curves that match a name, in which * is a wildcard.

        Raises
        ------
        UsageError
            No curve matches.
        """
        if text.strip() in self._derivatives:  # including initial values: dphi/dphi'
            return [self._derivatives[text.strip()]]
        name = _plain(text)
        curve = self.named(name)
        if curve is not None:
            return [curve]
        curves: list[Curve] = []
        if f"{name}.*" == _EVERY_MULTIPLIER:
            name = _EVERY_MULTIPLIER
        if "*" in name:
            pattern = name.replace("[", "[[]")
            names = [n for n in self.names() if fnmatchcase(n, pattern)]
            curves = [c for c in map(self.named, names) if c is not None]
        elif name:
            curves = list(self._family(name))
        if not curves:
            raise self._unknown(text, name)
        return curves

    def named(self, name: str) -> Curve | None:
        """Return the curve of an exact name, if there is one."""
        curve = self._named(name)
        if curve is None or (self.run.fields is not None and curve.field not in self.run.fields):
            return None
        return curve

    def _named(self, name: str) -> Curve | None:
        column = read_column_name(name, self._places, self._constraints, self._conserved)
        if column is not None:
            return self._of(column)
        if name in _RESIDUALS:
            known = not np.isnan(self.run.record.scale_velocity).any()
            group, label = "relative residuals" if known else "residuals", _RESIDUALS[name].label
            return Curve(name, name, None, group, "", label, log=True, largest=True)
        if name in self._derivatives:
            return self._derivatives[name]
        if name.startswith(_IMPULSE) and self.run.record.events is not None:
            return self._impulse(name.removeprefix(_IMPULSE))
        if name in self.run.outputs:
            unit = self.run.record.units.get(name, "")
            # outputs without a unit are grouped by family
            group = "outputs" if unit else name.partition("[")[0]
            return Curve(name, f"outputs/{name}", (), group, unit, self._labels.look(name))
        return None

    def of(self, quantity: str) -> list[Curve]:
        """Return the curves of a quantity of `lagcli.columns.QUANTITIES`, but not of each term."""
        run = self.run
        names = column_names(
            BY_NAME[quantity], run.coordinates, run.constraints, (), run.conserved_names
        )
        return [self._of(name) for name in names]

    def forces(self, columns: Iterable[tuple[str, str]]) -> list[Curve]:
        """Return the forces of constraints on coordinates, given their names."""
        return [self._of(ColumnName("constraint_force_by", c, q)) for c, q in columns]

    def impulses(self) -> list[Curve]:
        """Return the impulses of the constraints that have some."""
        log = self.run.record.events
        struck = [] if log is None else log.impulses(self.run.constraints)
        return [curve for curve in map(self._impulse, struck) if curve is not None]

    def _impulse(self, constraint: str) -> Curve | None:
        """Return the impulses of a constraint, which have no column but an event log."""
        if constraint not in self._constraints:
            return None
        column = ColumnName("multipliers", constraint)
        unit = impulse_unit(unit_of_column(column, self.run.record.units)) or ""
        label, place = self._labels.impulse(constraint), (self._constraints[constraint],)
        name = _IMPULSE + constraint
        return Curve(name, IMPULSE, place, "impulses", unit, label, constraint=constraint)

    def outputs(self) -> list[Curve]:
        """Return the curves of the outputs."""
        return [curve for curve in map(self._named, self.run.outputs) if curve is not None]

    def _of(self, name: ColumnName) -> Curve:
        """Return the curve of a column."""
        quantity, run = BY_NAME[name.quantity], self.run
        unit = unit_of_column(name, run.record.units) or ""
        place: tuple[int, ...] | None
        if quantity.along == "term":
            acting = run.terms.acting(self._constraints[name.constraint])
            term = acting.get(self._places[name.coordinate])
            place = None if term is None else (term,)
        else:
            axis = self._constraints, self._places, self._conserved
            parts = name.constraint, name.coordinate, name.conserved
            place = tuple(at[part] for at, part in zip(axis, parts, strict=True) if part)
        return Curve(
            *(str(name), quantity.name, place, quantity.panel, unit, self._labels.of(name)),
            log=quantity.role == "residual",
            constraint=name.constraint,
        )

    def _differentiated(self) -> Iterator[Curve]:
        """Yield the derivatives: ``dphi/dl``."""
        run = self.run
        for quantity in DERIVATIVES if run.sensitivity else ():
            differentiated = self.of(quantity.name.removeprefix("d"))
            names = derivative_names(quantity, run.coordinates, run.constraints, run.sensitivity)
            places = product(range(len(differentiated)), range(len(run.sensitivity)))
            for name, (i, j) in zip(names, places, strict=True):
                by, above = run.sensitivity[j], differentiated[i]
                below = run.record.units.get(by, "")
                unit = unit_quotient(above.unit, below) if above.unit and below else ""
                group = f"{quantity.name}/d{by}"
                if self.tex:
                    d, below = r"$\partial$", look_of_value(run.notation, by)
                else:
                    d, below = "∂", by
                label = f"{d}{above.label}/{d}{below}"
                yield Curve(name, quantity.name, (i, j), group, unit, label)

    # names

    def names(self) -> Iterator[str]:
        """Yield the names of all curves."""
        q, constraints = self.run.coordinates, self.run.constraints
        for quantity in SAMPLED:
            pairs = len(q) * len(constraints) <= _LISTED and quantity.along == "term"
            terms = list(product(constraints, q)) if pairs else ()
            conserved = self.run.conserved_names
            yield from map(str, column_names(quantity, q, constraints, terms, conserved))
        yield from _RESIDUALS
        yield from (curve.name for curve in self.impulses())
        yield from self.run.outputs
        yield from self._derivatives

    def _family(self, name: str) -> Iterator[Curve]:
        """Yield members of a family and components: of x, x_dot, lambda.rod, r, lambda.pin."""
        stem, ending = name, ""
        for rate in _RATES:
            suffix = BY_NAME[rate].pattern.format(coordinate="")
            if name.endswith(suffix):
                stem, ending = name.removesuffix(suffix), suffix
        for every in self.names():
            rest = every.removeprefix(stem).removesuffix(ending)
            if every == stem + rest + ending and rest and _PART.fullmatch(rest):
                curve = self.named(every)
                if curve is not None:
                    yield curve

    def _unknown(self, text: str, name: str) -> UsageError:
        every = self.names() if self.run.fields is None else filter(self.named, self.names())
        question = did_you_mean(nearest(name, list(every)))
        q, constraints = self.run.coordinates, self.run.constraints
        forces: list[str] = []
        if q and constraints:
            of_one = ColumnName("constraint_force_by", constraints[0], q[0])
            forces = [str(of_one._replace(quantity="constraint_force", constraint="")), str(of_one)]
        rates = [str(ColumnName(rate, "", q[0])) for rate in _RATES] if q else []
        multipliers = [str(ColumnName("multipliers", c)) for c in constraints]
        kept = self.run.conserved_names
        scalars = (*(quantity.name for quantity in SCALARS), *_RESIDUALS)
        lines = [
            ("coordinates", _listed(q)),
            ("velocities, …", ", ".join(rates)),
            ("multipliers", _listed(multipliers)),
            ("forces", ", ".join(filter(self.named, forces))),
            ("impulses", _listed([curve.name for curve in self.impulses()])),
            ("conserved", _listed([str(ColumnName("conserved", conserved=n)) for n in kept])),
            ("outputs", _listed(self.run.outputs)),
            ("derivatives", _listed([*self._derivatives])),
            ("of all runs", ", ".join(filter(self.named, scalars))),
        ]
        return UsageError(
            f"{self.run.name} has no `{shorten(text)}`"
            + (f"; {question}" if question else "")
            + "".join(f"\n   {what:<14} {names}" for what, names in lines if names)
            + f"\n   * matches any text, as in '{_EVERY_MULTIPLIER}'"
        )


class ColumnLabels:
    """The labels of columns in the notation of a model.

    Parameters
    ----------
    names : Notation or None
        Names of the model; if not given, names are written as in columns.
    tex : bool
        See `Catalogue`.
    """

    def __init__(self, names: Notation | None, tex: bool):
        self.names, self.tex = names, tex

    def of(self, name: ColumnName) -> str:
        """Return the label of a column."""
        quantity = BY_NAME[name.quantity]
        if quantity.name in _DOTS:
            return self.look(name.coordinate, _DOTS[quantity.name])
        if name.coordinate:
            return self._force(name.coordinate, name.constraint)
        if quantity.name == "multipliers":
            return self._multiplier(name)
        if name.constraint or name.conserved:
            return self.raw(name.constraint or name.conserved)
        label = quantity.label or str(name)
        return f"${label}$" if self.tex and len(label) == 1 else label

    def impulse(self, constraint: str) -> str:
        """Return the label of the impulse of a constraint."""
        label = self._multiplier(ColumnName("multipliers", constraint))
        return label.replace(r"\lambda", r"\Lambda").replace("λ", "Λ")

    def look(self, name: str, dots: int = 0) -> str:
        """Return a coordinate, parameter or output, with dots."""
        names = self.names
        if self.tex:
            return look(names, name, dots)
        return str(ColumnName("qva"[dots], "", name)) if names is None else names.text(name, dots)

    def raw(self, text: str) -> str:
        """Return a text as it is."""
        return raw(text) if self.tex else text

    def _force(self, q: str, constraint: str) -> str:
        sign = self.look(q)
        if not self.tex:
            return sign
        mark = sign.strip("$") if sign.startswith("$") else rf"\mathrm{{{_word(q)}}}"
        above = rf"\mathrm{{{_word(constraint)}}}" if constraint else "c"
        return f"$Q^{{{above}}}_{{{mark}}}$"

    def _multiplier(self, name: ColumnName) -> str:
        names = self.names
        if names is None:
            return self.raw(str(name))
        if self.tex:
            return f"${names.latex_multiplier(name.constraint)}$"
        return names.multiplier(name.constraint)


def look_of_column(
    names: Notation | None, name: str, coordinates: Sequence[str], constraints: Sequence[str]
) -> str:
    """Return a column, an output or an expression for matplotlib."""
    column = read_column_name(_plain(name), coordinates, constraints)
    labels = ColumnLabels(names, tex=True)
    if column is not None:
        return labels.of(column)
    return look(names, name) if names is not None and name in names.declared else raw(name)


def look(names: Notation | None, name: str, dots: int = 0) -> str:
    """Return a name for matplotlib: in TeX, if it is a letter with a subscript.

    Parameters
    ----------
    names : Notation or None
        Names of the model; if not given, the name is written as in columns.
    name : str
    dots : int
        Order of the derivative with respect to time.
    """
    letter, _ = split(name)
    typed = raw(str(ColumnName("qva"[dots], "", name)))
    if names is None:
        return typed
    label = f"${names.latex(name, dots)}$"
    if name in names.with_own_latex:
        return label if _drawable(label) else typed
    return label if len(letter) == 1 or letter in GREEK else typed


def look_of_value(names: Notation | None, name: str) -> str:
    """Return the name of a parameter or an initial value, phi or phi', for matplotlib."""
    base = name.rstrip("'")
    dots = len(name) - len(base)
    known = names is not None and base in names.declared and dots <= 2
    return look(names, base, dots) if known else raw(name)


def read_curves(run: RunFile, curves: Iterable[Curve]) -> dict[str, Array]:
    """Return the values of curves and of the time, by name.

    Returns
    -------
    dict of str to (nt,) array
    """
    wanted = {c.name: c for c in curves}
    wanted["t"] = Curve("t", "time", (), "time", "s", "$t$")
    pieces: dict[str, list[Array]] = {name: [] for name in wanted}
    for block in run.blocks(list(dict.fromkeys(c.field for c in wanted.values()))):
        for name, curve in wanted.items():
            pieces[name].append(magnitudes(run, curve, block))
    return {
        name: drawable(np.concatenate(values)) if values else np.empty(0)
        for name, values in pieces.items()
    }


def magnitudes(run: RunFile, curve: Curve, block: Mapping[str, Array]) -> Array:
    """Return the values of a curve, or their magnitudes on a logarithmic axis."""
    if curve.largest:
        values, scale = block[curve.field], getattr(run.record, BY_NAME[curve.field].scale)
        known = ~np.isnan(values).all(axis=0) if len(values) else np.ones(len(scale), dtype=bool)
        relative = np.abs(values[:, known]) / np.where(np.isnan(scale[known]), 1.0, scale[known])
        return np.asarray(relative.max(axis=1, initial=0.0))
    values = curve.of(block)
    return np.abs(values) if curve.log else np.array(values)


def _plain(text: str) -> str:
    """Return a name as in columns: phi' is phi_dot, x_dot[3] is x[3]_dot."""
    name = "".join(text.split())
    primes = len(name) - len(name.rstrip("'"))
    if primes in (1, 2):
        name = str(ColumnName(_RATES[primes - 1], "", name.rstrip("'")))
    for rate in _RATES:
        suffix = BY_NAME[rate].pattern.format(coordinate="")
        base, bracket, index = name.partition(f"{suffix}[")
        if bracket and index.endswith("]"):
            return f"{base}[{index}{suffix}"
    return name


def _drawable(label: str) -> bool:
    """Return whether matplotlib can draw a label: its mathtext lacks some commands of LaTeX."""
    from matplotlib.mathtext import MathTextParser

    try:
        MathTextParser("path").parse(label)
    except ValueError:
        return False
    return True


def raw(text: str) -> str:
    """Return a text escaped for matplotlib, without TeX."""
    return text.replace("$", r"\$")


def _word(text: str) -> str:
    """Return a name in upright letters of mathtext."""
    return text.replace("_", r"\_")


def _listed(names: Sequence[str]) -> str:
    """Return a list of names, with families as x[1..20]."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(name.partition("[")[0], []).append(name)
    shown = [
        format_members(base, members).replace("`", "") if "[" in members[0] else base
        for base, members in families.items()
    ]
    more = f", … ({len(names)})" if len(shown) > _SHOWN else ""
    return ", ".join(shown[:_SHOWN]) + more
