"""Conversion factors of units to SI.

A small table covers products, quotients and powers of SI units with prefixes, and degrees. Pint is
imported only for other units.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache
from typing import Any

from lagcli.model.spelling import shorten

Factor = Fraction | float  # exact wherever the unit allows it, so that 7 mm is 0.007 m

_ONE = Fraction(1)
_BASE: dict[str, Factor] = {
    **dict.fromkeys(["m", "s", "A", "K", "mol", "cd", "rad", "sr"], _ONE),
    **dict.fromkeys(["Hz", "N", "Pa", "J", "W", "C", "V", "F", "ohm", "Ω", "S", "Wb"], _ONE),
    **{"T": _ONE, "H": _ONE, "g": Fraction(1, 1000)},
}
_PREFIX = {
    **{"n": Fraction(1, 10**9), "u": Fraction(1, 10**6), "µ": Fraction(1, 10**6)},
    **{"μ": Fraction(1, 10**6), "m": Fraction(1, 1000), "c": Fraction(1, 100)},
    **{"d": Fraction(1, 10), "k": Fraction(10**3), "M": Fraction(10**6), "G": Fraction(10**9)},
}
_DEGREE = math.pi / 180
_WHOLE: dict[str, Factor] = {
    **dict.fromkeys(["deg", "°", "degree", "degrees"], _DEGREE),
    **dict.fromkeys(["radian", "1", "dimensionless"], _ONE),
    **dict.fromkeys(["meter", "metre", "second", "newton", "joule", "watt", "pascal"], _ONE),
    **dict.fromkeys(["hertz", "kilogram", "kelvin", "ampere", "volt", "coulomb", "tesla"], _ONE),
    **{"min": Fraction(60), "h": Fraction(3600), "L": Fraction(1, 1000), "t": Fraction(1000)},
}
_SI_NAMES = {
    **dict.fromkeys(["deg", "°", "degree", "degrees"], "rad"),
    **{"min": "s", "h": "s", "L": "m^3", "t": "kg", "g": "kg"},
}
_TOKEN = re.compile(
    r"\s*(?:(\*\*|\^)\s*([+-]?[0-9]{1,2})(?![0-9])|([*/()·])|([^\W\d]+|°|1)|([²³]))"
)
_LONGEST = 100  # maximum number of characters of a unit

UNIT_HELP = "units are written as `kg`, `m/s^2`, `N*m`, `deg`"


class UnknownUnit(ValueError):
    """Text that is not a unit; the message says why."""


@cache
def to_si(unit: str) -> Factor:
    """Return the factor that converts a value in this unit to SI.

    ``a/b*c`` is evaluated from left to right, as in Pint: (a/b)·c.

    Raises
    ------
    UnknownUnit
        Invalid notation, a name that neither the table nor Pint knows, or a unit with an offset
        (degC).
    """
    factor = _product(unit) if len(unit) <= _LONGEST else None
    if factor is None:
        raise UnknownUnit(f"`{shorten(unit)}` is not a unit")
    try:
        size = float(factor)
    except OverflowError:
        size = math.inf
    if not 0 < size < math.inf:
        raise UnknownUnit(f"`{shorten(unit)}` is too large or too small")
    return factor


def si_notation(unit: str) -> str:
    """Return the SI unit for values given in a unit: ``deg/s`` becomes ``rad/s``."""

    def replaced(match: re.Match[str]) -> str:
        name = match[0]
        si = _SI_NAMES.get(name) or (name if _single(name) == 1 else None)
        if si is None and name[1:] in _BASE:
            si = "kg" if name[1:] == "g" else name[1:]
        if si is None:
            si = f"{_registry().Quantity(1, name).to_base_units().units:~C}".replace("**", "^")
        return f"({si})" if re.search("[*/^]", si) and name != unit else si

    return unit if to_si(unit) == 1 else re.sub(r"[^\W\d]+|°", replaced, unit)


def _single(name: str) -> Factor:
    if name in _WHOLE:
        return _WHOLE[name]
    if name in _BASE:
        return _BASE[name]
    if len(name) > 1 and name[0] in _PREFIX and name[1:] in _BASE:
        return _PREFIX[name[0]] * _BASE[name[1:]]
    return _by_pint(name)


def _product(unit: str) -> Factor | None:
    """Return the factor, or None for invalid notation."""
    position = 0
    # per parenthesis: the product, its last factor, the sign of the next exponent
    stack: list[tuple[Factor, Factor | None, int]] = [(_ONE, None, 1)]
    expect_unit = True
    while position < len(unit.rstrip()):
        match = _TOKEN.match(unit, position)
        if not match:
            return None
        position = match.end()
        power, exponent, mark, name, small = match.groups()
        product, last, sign = stack[-1]
        if power or small:
            if last is None:
                return None
            n = int(exponent) if power else "..²³".index(small)
            stack[-1] = (product / last * last**n, None, 1)
        elif mark == "(":
            if not expect_unit:
                return None
            stack.append((_ONE, None, 1))
        elif name or mark == ")":
            if mark == ")":
                if expect_unit or len(stack) == 1:
                    return None
                value = stack.pop()[0]
                product, last, sign = stack[-1]
            else:
                value = _single(name)
                if not expect_unit:
                    sign = 1  # a space between two units means a product
            value = value**sign
            stack[-1] = (product * value, value, 1)
            expect_unit = False
        else:
            if expect_unit:
                return None
            stack[-1] = (product, None, -1 if mark == "/" else 1)
            expect_unit = True
    return None if expect_unit or len(stack) > 1 else stack[0][0]


def _by_pint(name: str) -> float:
    registry = _registry()
    try:
        unit = registry.parse_units(name)
        zero, one = (registry.Quantity(x, unit).to_base_units().magnitude for x in (0.0, 1.0))
    except Exception as error:  # Pint raises many exception types, including tokenizer errors
        raise UnknownUnit(f"`{name}` is not a unit") from error
    if zero != 0.0:
        raise UnknownUnit(f"`{name}` has an offset: use an absolute unit, such as K")
    return float(one)


@cache
def _registry() -> Any:
    import pint

    # without a cache folder: reading Pint's cache is slower than parsing its definitions
    return pint.UnitRegistry(cache_folder=None)
