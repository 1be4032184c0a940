"""The curves of a run by their names: which numbers they are, their unit, how they are written."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lagcli.equations.render.names import GREEK, Notation, split
from lagcli.errors import LagcliError, UsageError
from lagcli.model.names.members import format_members
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.pictures.plots.ticks import drawable
from lagcli.pictures.run_file import RunFile
from lagcli.trajectory.samples import Array

#: Forces that are listed one by one, constraints times coordinates.
_LISTED = 10_000
_SHOWN = 40  # names in a message
_RATES = (("", ""), ("_dot", "/s"), ("_ddot", "/s^2"))
_SINGLE = {
    "energy_kinetic": ("energies", "J", "$T$"),
    "energy_potential": ("energies", "J", "$V$"),
    "energy_total": ("energies", "J", "$E$"),
    "power_applied": ("powers", "W", "applied"),
    "power_constraint": ("powers", "W", "constraints"),
    "power_time": ("powers", "W", "explicit time"),
    "energy_balance": ("energy balance", "J", "energy balance"),
    "residual_equation": ("equation residual", "", "equations"),
}
_RESIDUALS = {"residual_position": "position", "residual_velocity": "velocity"}


class Curve(NamedTuple):
    """One number at each sample.

    Parameters
    ----------
    name : str
        As the user writes it, and as a CSV file's column is called.
    field : str
        Of `Samples`; an output is ``outputs/NAME``.
    place : tuple of int
        Where it is in the field after the time; of ``constraint_force_by``, constraint and
        coordinate.
    group : str
        What curves that share a panel are together.
    unit : str
        SI; empty where it is not known.
    label : str
        For matplotlib: with TeX between dollar signs.
    log : bool
        Whether its magnitude is drawn over a logarithmic axis.
    largest : bool
        Whether it is the largest magnitude in the field, each relative to its constraint's scale.
    """

    name: str
    field: str
    place: tuple[int, ...]
    group: str
    unit: str
    label: str
    log: bool = False
    largest: bool = False


class Catalogue:
    """All curves of a run.

    Parameters
    ----------
    run : Run
    """

    def __init__(self, run: RunFile):
        self.run = run
        self._places = {name: i for i, name in enumerate(run.coordinates)}
        self._constraints = {name: i for i, name in enumerate(run.constraints)}

    def find(self, text: str) -> list[Curve]:
        """Return the curves of a name, in which * stands for anything.

        Raises
        ------
        UsageError
            There is none.
        """
        name = _plain(text)
        curve = self.named(name)
        if curve is not None:
            return [curve]
        found: list[Curve] = []
        if name == "lambda":
            name = "lambda.*"
        if "*" in name:
            pattern = name.replace("[", "[[]")
            names = [n for n in self.names() if fnmatchcase(n, pattern)]
            found = [c for c in map(self.named, names) if c is not None]
        elif name and not name.endswith("]"):
            found = list(self._family(name))
        if not found:
            raise self._unknown(text, name)
        return found

    def named(self, name: str) -> Curve | None:
        """Return the curve of an exact name, if there is one."""
        curve = self._named(name)
        if curve is None or (self.run.fields is not None and curve.field not in self.run.fields):
            return None
        return curve

    def _named(self, name: str) -> Curve | None:
        if name in ("t", "time"):
            return Curve("t", "time", (), "time", "s", "$t$")
        if name in _SINGLE:
            group, unit, label = _SINGLE[name]
            return Curve(name, name, (), group, unit, label, log=name.startswith("residual"))
        if name in _RESIDUALS:
            label = _RESIDUALS[name]
            known = not np.isnan(self.run.record.scale_velocity).any()
            group = "relative residuals" if known else "residuals"
            return Curve(name, name, (), group, "", label, log=True, largest=True)
        for field, (suffix, per) in zip("qva", _RATES, strict=True):
            base = name.removesuffix(suffix) if suffix else name
            if base in self._places and name.endswith(suffix):
                return self._motion(name, base, field, per)
        if name in self.run.outputs:
            unit = self.run.record.units.get(name, "")
            label = self._look(name)
            # outputs without a unit have nothing in common but the name of their family
            group = "outputs" if unit else name.partition("[")[0]
            return Curve(name, f"outputs/{name}", (), group, unit, label)
        return self._dotted(name)

    def _motion(self, name: str, base: str, field: str, per: str) -> Curve:
        unit = self.run.record.units.get(base, "")
        groups = {"q": "coordinates", "v": "velocities", "a": "accelerations"}
        label = self._look(base, "qva".index(field))
        unit = f"{unit}{per}" if unit else ""
        return Curve(name, field, (self._places[base],), groups[field], unit, label)

    def _dotted(self, name: str) -> Curve | None:
        """Return a multiplier, a constraint force or a residual."""
        head, _, rest = name.partition(".")
        if head in _RESIDUALS and rest in self._constraints:
            group = f"{_RESIDUALS[head]} residuals"
            place = (self._constraints[rest],)
            return Curve(name, head, place, group, "", _raw(rest), log=True)
        if head == "lambda" and rest in self._constraints:
            place = (self._constraints[rest],)
            return Curve(name, "multipliers", place, "multipliers", "", self._multiplier(rest))
        if head != "Qc":
            return None
        constraint, _, q = rest.rpartition(".")
        if q not in self._places or (constraint and constraint not in self._constraints):
            return None
        unit = _per(self.run.record.units.get(q, ""))
        sign = self._look(q)
        mark = sign.strip("$") if sign.startswith("$") else rf"\mathrm{{{_word(q)}}}"
        above = rf"\mathrm{{{_word(constraint)}}}" if constraint else "c"
        label = f"$Q^{{{above}}}_{{{mark}}}$"
        if constraint:
            both = (self._constraints[constraint], self._places[q])
            return Curve(name, "constraint_force_by", both, "constraint forces", unit, label)
        place = (self._places[q],)
        return Curve(name, "constraint_force", place, "constraint forces", unit, label)

    # names

    def names(self) -> Iterator[str]:
        """Yield the names of all curves."""
        yield "t"
        q, constraints = self.run.coordinates, self.run.constraints
        for suffix, _ in _RATES:
            yield from (name + suffix for name in q)
        yield from (f"lambda.{c}" for c in constraints)
        yield from (f"Qc.{name}" for name in q)
        if len(q) * len(constraints) <= _LISTED:
            yield from (f"Qc.{c}.{name}" for c in constraints for name in q)
        yield from _SINGLE
        yield from _RESIDUALS
        yield from (f"{head}.{c}" for head in _RESIDUALS for c in constraints)
        yield from self.run.outputs

    def _family(self, name: str) -> Iterator[Curve]:
        """Yield the members of a family: of x, x_dot, lambda.rod, tension."""
        stem, ending = name, ""
        for suffix, _ in _RATES[1:]:
            if name.endswith(suffix):
                stem, ending = name.removesuffix(suffix), suffix
        start = f"{stem}["
        for every in self.names():
            if every.startswith(start) and every.endswith(f"]{ending}"):
                curve = self.named(every)
                if curve is not None:
                    yield curve

    def _unknown(self, text: str, name: str) -> UsageError:
        every = self.names() if self.run.fields is None else filter(self.named, self.names())
        question = did_you_mean(nearest(name, list(every)))
        q, constraints = self.run.coordinates, self.run.constraints
        forces = [f"Qc.{q[0]}", f"Qc.{constraints[0]}.{q[0]}"] if q and constraints else []
        lines = [
            ("coordinates", _listed(q)),
            ("velocities, …", f"{q[0]}_dot, {q[0]}_ddot" if q else ""),
            ("multipliers", _listed([f"lambda.{c}" for c in constraints])),
            ("forces", ", ".join(filter(self.named, forces))),
            ("outputs", _listed(self.run.outputs)),
            ("of all runs", ", ".join(filter(self.named, (*_SINGLE, *_RESIDUALS)))),
        ]
        return UsageError(
            f"{self.run.name} has no `{shorten(text)}`"
            + (f"; {question}" if question else "")
            + "".join(f"\n   {what:<14} {names}" for what, names in lines if names)
            + "\n   * stands for anything: 'lambda.*'"
        )

    # looks

    @cached_property
    def _names(self) -> Notation | None:
        """How the model writes its names; None where the result holds no model."""
        try:
            return Notation(self.run.model)
        except LagcliError:
            return None  # names as they are typed serve as well

    def _look(self, name: str, dots: int = 0) -> str:
        """Return a name as matplotlib shows it: in TeX, if it is a letter with a subscript."""
        letter, _ = split(name)
        names, raw = self._names, _raw(name + _RATES[dots][0])
        if names is None:
            return raw
        label = f"${names.latex(name, dots)}$"
        if name in names.with_own_latex:
            return label if _drawable(label) else raw
        return label if len(letter) == 1 or letter in GREEK else raw

    def _multiplier(self, constraint: str) -> str:
        if self._names is None:
            return _raw(f"lambda.{constraint}")
        return f"${self._names.latex_multiplier(constraint)}$"


def read_curves(run: RunFile, curves: Iterable[Curve]) -> dict[str, Array]:
    """Return the values of curves and of the time, by name.

    Parameters
    ----------
    run : Run
    curves : iterable of Curve

    Returns
    -------
    dict of str to (nt,) array
    """
    wanted = {c.name: c for c in curves}
    wanted["t"] = Curve("t", "time", (), "time", "s", "$t$")
    pieces: dict[str, list[Array]] = {name: [] for name in wanted}
    for block in run.blocks(list(dict.fromkeys(c.field for c in wanted.values()))):
        for name, curve in wanted.items():
            pieces[name].append(_values(run, curve, block[curve.field]))
    return {
        name: drawable(np.concatenate(found)) if found else np.empty(0)
        for name, found in pieces.items()
    }


def _values(run: RunFile, curve: Curve, values: Array) -> Array:
    if curve.largest:
        scale = getattr(run.record, curve.field.replace("residual", "scale"))
        known = ~np.isnan(values).all(axis=0) if len(values) else np.ones(len(scale), dtype=bool)
        relative = np.abs(values[:, known]) / np.where(np.isnan(scale[known]), 1.0, scale[known])
        return np.asarray(relative.max(axis=1, initial=0.0))
    if curve.field == "constraint_force_by":
        return run.terms.column(values, *curve.place)
    chosen = values.T[curve.place[::-1]]
    return np.abs(chosen) if curve.log else np.array(chosen)


def _plain(text: str) -> str:
    """Return a name as columns are called: phi' is phi_dot, x_dot[3] is x[3]_dot."""
    name = "".join(text.split())
    for primes, suffix in (("''", "_ddot"), ("'", "_dot")):
        if name.endswith(primes):
            name = name.removesuffix(primes) + suffix
            break
    for suffix, _ in _RATES[1:]:
        base, bracket, index = name.partition(f"{suffix}[")
        if bracket and index.endswith("]"):
            return f"{base}[{index}{suffix}"
    return name


def _per(unit: str) -> str:
    """Return the unit of a generalized force: J per unit of the coordinate."""
    known = {"m": "N", "rad": "N*m", "": ""}
    return known.get(unit, f"J/({unit})")


def pretty_unit(unit: str) -> str:
    """Return a unit as people write it: m/s^2 as m/s²."""
    for plain, shown in (("^2", "²"), ("^3", "³"), ("*", "·")):
        unit = unit.replace(plain, shown)
    return unit


def _drawable(label: str) -> bool:
    """Return whether matplotlib can draw a label: its mathtext lacks some of LaTeX's commands."""
    from matplotlib.mathtext import MathTextParser

    try:
        MathTextParser("path").parse(label)
    except ValueError:
        return False
    return True


def _raw(text: str) -> str:
    return text.replace("$", r"\$")


def _word(text: str) -> str:
    """Return a name in the upright letters of mathtext."""
    return text.replace("_", r"\_")


def _listed(names: Sequence[str]) -> str:
    """Return names in few words: those of a family as x[1..20]."""
    families: dict[str, list[str]] = {}
    for name in names:
        families.setdefault(name.partition("[")[0], []).append(name)
    shown = [
        format_members(base, members).replace("`", "") if members[0].endswith("]") else base
        for base, members in families.items()
    ]
    more = f", … ({len(names)})" if len(shown) > _SHOWN else ""
    return ", ".join(shown[:_SHOWN]) + more
