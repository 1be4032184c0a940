"""Varied quantities: resolution of names, and units of their values."""

from __future__ import annotations

from fractions import Fraction

from lagcli.errors import UsageError
from lagcli.model.expression.dimension import same
from lagcli.model.expression.units import Factor, read_unit, to_si
from lagcli.model.model import Model
from lagcli.model.spelling import did_you_mean, nearest


def varied_name(model: Model, name: str) -> str:
    """Return the parameter, coordinate or velocity (``phi'``) that a name denotes.

    Raises
    ------
    UsageError
        The model has no such quantity.
    """
    plain = "".join(name.split())
    if plain in model.parameters or plain in model.initial_positions:
        return plain
    base, bracket, index = plain.partition("_dot[")
    for found in (plain.removesuffix("'"), plain.removesuffix("_dot"), f"{base}[{index}"):
        if found != plain and found in model.initial_velocities and (bracket or "[" not in index):
            return f"{found}'"
    known = [*model.parameters, *model.initial_positions]
    known += [f"{q}'" for q in model.initial_velocities]
    help_ = did_you_mean(nearest(plain, known)) or "it has " + ", ".join(known[:30])
    raise UsageError(f"--vary: the model has no parameter or initial value `{plain}`; {help_}")


def si_factor(model: Model, name: str, unit: str | None) -> Factor:
    """Return the factor that converts values of a quantity to SI.

    Raises
    ------
    UsageError
        The file gives the parameter in a unit other than SI, and no unit is given here, or it gives
        the quantity in a unit of another dimension.
    UnknownUnit
    """
    parameter = model.parameters.get(name)
    stated = parameter.unit if parameter else _coordinate_unit(model, name)
    if unit is not None:
        given = read_unit(unit)
        if stated is not None and not same(given.dimension, read_unit(stated).dimension):
            raise UsageError(
                f"--vary {name}: `{name}` is in {stated} in the file, and in {unit} here; give it"
                f" in {stated}, or in another unit of that dimension"
            )
        return given.factor
    if stated is not None and to_si(stated) != 1:
        raise UsageError(
            f"--vary {name}: `{name}` is given in {stated} in the file, and without a unit here;"
            f" write the unit after the values, as in --vary '{name}=1:2:0.1 {stated}'"
        )
    return Fraction(1)


def _coordinate_unit(model: Model, name: str) -> str | None:
    """Return the SI unit of an initial position or velocity, if the file states it."""
    base = name.removesuffix("'")
    unit = next((c.unit for c in model.coordinates if c.name == base), None)
    if unit is None or base == name:
        return unit
    return f"({unit})/s" if "/" in unit else f"{unit}/s"
