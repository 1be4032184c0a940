"""Parsers of options that are numbers, also with a unit: ``3``, ``0.5``, ``500 ms``."""

from __future__ import annotations

import math

import typer


def real(text: str) -> float:
    """Return a number without a unit; raises ValueError if the text is none.

    Spellings that only Python knows, such as ``1_0`` and digits of other scripts, are not numbers.
    """
    if "_" in text or not text.isascii():
        raise ValueError(f"{text!r} is not a number")
    return float(text)


class NumberIn:
    """Parser of an option's value: a number in a unit, or with another unit of its dimension.

    Parameters
    ----------
    unit : str
        SI unit of numbers without a unit, and of the converted value.
    """

    __name__ = "quantity"

    def __init__(self, unit: str):
        self.unit = unit

    def __call__(self, text: str) -> float:
        """Return the number in the unit.

        Raises
        ------
        BadParameter
            The text is not a number, or its unit is unknown or has another dimension.
        """
        try:
            return real(text)
        except ValueError:
            return self._converted(text)

    def _converted(self, text: str) -> float:
        # imported on demand: a number needs no table of units
        from fractions import Fraction

        from lagcli.model.expression.dimension import same
        from lagcli.model.expression.units import WITH_UNIT, UnknownUnit, read_unit

        match = WITH_UNIT.fullmatch(text)
        if match is None:
            raise typer.BadParameter(f"{text!r} is not a number, as in 2 or '2 {self.unit}'.")
        written = match[2].strip()
        try:
            unit = read_unit(written)
        except UnknownUnit as error:
            raise typer.BadParameter(f"{text!r}: {error}.") from None
        if not same(unit.dimension, read_unit(self.unit).dimension):
            raise typer.BadParameter(f"{text!r} is in {written}, but must be in {self.unit}.")
        value = float(match[1])
        if value == 0 or math.isinf(value):
            return value  # the fraction of such a number may be too long
        try:
            return float(Fraction(match[1]) * unit.factor)  # exact until here: 7 ms is 0.007 s
        except OverflowError:
            return math.copysign(math.inf, value)


class NumbersIn:
    """Parser of an option's value: quantities, separated by commas.

    Parameters
    ----------
    unit : str
        As of `NumberIn`.
    """

    __name__ = "list"

    def __init__(self, unit: str):
        self.member = NumberIn(unit)

    def __call__(self, text: str) -> list[float]:
        """Return the numbers in the unit; raises as `NumberIn`."""
        return [self.member(x) for x in text.split(",")]
