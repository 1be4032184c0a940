"""Formatting of numbers."""

from __future__ import annotations

from fractions import Fraction

from lagcli.equations.simplification.factors import LARGEST_DENOMINATOR
from lagcli.model.expression.trees import NumberExpr, walk
from lagcli.model.model import Model

DIGITS = 6


def written_decimals(model: Model) -> frozenset[int]:
    """Return the denominators of decimals in the model: 0.2 is 1/5."""
    found: set[int] = set()
    for tree in model.trees.values():
        found.update(part.value.denominator for part in walk(tree) if isinstance(part, NumberExpr))
    return frozenset(found)


def decimal(value: Fraction, decimals: frozenset[int]) -> str | None:
    """Return a number as an integer or decimal, or None if a fraction is preferable.

    A number is written as a decimal if it terminates within six digits and its denominator is large
    (1/20), a power of ten (1/10), or that of a decimal in the model (0.2).
    """
    q = value.denominator
    if q == 1:
        return str(value.numerator)
    if 10**DIGITS % q:
        return None
    if q > LARGEST_DENOMINATOR or q == 10 or (q == 5 and 5 in decimals):
        digits = f"{float(value):.{DIGITS}f}".rstrip("0")
        return digits if len(digits.lstrip("-0.")) <= DIGITS else None
    return None


def is_rounded(value: Fraction, plain: str | None, numeric: bool) -> bool:
    """Return whether a number is printed with six significant digits.

    With parameter values inserted, every longer decimal and every fraction is rounded. In symbolic
    equations, only fractions of long numbers are, which result from measured or computed constants
    of the model: 0.704466 is easier to read than 35223315263779/50000000000000.

    Parameters
    ----------
    plain : str or None
        Result of `decimal` for the value.
    numeric : bool
        Whether parameter values are inserted.
    """
    if numeric:
        return plain is None or len(plain) > DIGITS
    return plain is None and max(abs(value.numerator), value.denominator) >= 10**DIGITS


def rounded(value: Fraction) -> tuple[str, int | None]:
    """Return mantissa and power of ten of a number with at most six significant digits."""
    text = f"{float(value):.{DIGITS}g}"
    mantissa, _, exponent = text.partition("e")
    return mantissa, int(exponent) if exponent else None
