"""Units: their conversion factors to SI and their dimensions.

A small table covers products, quotients and powers of SI units with prefixes, and degrees. Pint is
imported only for other units.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache
from typing import Any, NamedTuple

from lagcli.model.dimensions.dimension import (
    ANGLE,
    ENERGY,
    ONE,
    POWER,
    SECOND,
    Dimension,
    product,
)
from lagcli.model.spelling import shorten

Factor = Fraction | float  # exact wherever the unit allows it, so that 7 mm is 0.007 m


class ParsedUnit(NamedTuple):
    """A unit: the factor that converts a value to SI, and the dimension."""

    factor: Factor
    dimension: Dimension

    def times(self, other: ParsedUnit, exponent: int | Fraction = 1) -> ParsedUnit:
        """Return this unit times a power of another."""
        dimension = product(self.dimension, other.dimension, exponent)
        assert isinstance(dimension, Dimension)
        return ParsedUnit(self.factor * other.factor**exponent, dimension)


_ONE = Fraction(1)
_CHARGE, _VOLT = Dimension(A=1, s=1), Dimension(kg=1, m=2, s=-3, A=-1)
_DIMENSIONS = {
    **{"m": Dimension(m=1), "s": SECOND, "A": Dimension(A=1), "K": Dimension(K=1)},
    **{"mol": Dimension(mol=1), "cd": Dimension(cd=1), "rad": ANGLE, "sr": Dimension(rad=2)},
    **{"Hz": Dimension(s=-1), "N": Dimension(kg=1, m=1, s=-2), "J": ENERGY, "W": POWER},
    **{"Pa": Dimension(kg=1, m=-1, s=-2), "C": _CHARGE, "V": _VOLT},
    **{"F": Dimension(kg=-1, m=-2, s=4, A=2), "S": Dimension(kg=-1, m=-2, s=3, A=2)},
    **dict.fromkeys(["ohm", "Ω"], Dimension(kg=1, m=2, s=-3, A=-2)),
    **{"Wb": Dimension(kg=1, m=2, s=-2, A=-1), "T": Dimension(kg=1, s=-2, A=-1)},
    **{"H": Dimension(kg=1, m=2, s=-2, A=-2)},
}
_BASE = {name: ParsedUnit(_ONE, dimension) for name, dimension in _DIMENSIONS.items()}
_BASE["g"] = ParsedUnit(Fraction(1, 1000), Dimension(kg=1))
_PREFIX = {
    **{"n": Fraction(1, 10**9), "u": Fraction(1, 10**6), "µ": Fraction(1, 10**6)},
    **{"μ": Fraction(1, 10**6), "m": Fraction(1, 1000), "c": Fraction(1, 100)},
    **{"d": Fraction(1, 10), "k": Fraction(10**3), "M": Fraction(10**6), "G": Fraction(10**9)},
}
_DEGREE = math.pi / 180
_LONG_NAMES = {
    **{"radian": "rad", "meter": "m", "metre": "m", "second": "s", "newton": "N", "joule": "J"},
    **{"watt": "W", "pascal": "Pa", "hertz": "Hz", "kelvin": "K", "ampere": "A", "volt": "V"},
    **{"coulomb": "C", "tesla": "T"},
}
_WHOLE = {
    **dict.fromkeys(["deg", "°", "degree", "degrees"], ParsedUnit(_DEGREE, ANGLE)),
    **dict.fromkeys(["1", "dimensionless"], ParsedUnit(_ONE, ONE)),
    **{name: _BASE[short] for name, short in _LONG_NAMES.items()},
    **{
        "kilogram": ParsedUnit(_ONE, Dimension(kg=1)),
        "t": ParsedUnit(Fraction(1000), Dimension(kg=1)),
    },
    **{"min": ParsedUnit(Fraction(60), SECOND), "h": ParsedUnit(Fraction(3600), SECOND)},
    **{"L": ParsedUnit(Fraction(1, 1000), Dimension(m=3))},
}
_SI_NAMES = {
    **dict.fromkeys(["deg", "°", "degree", "degrees"], "rad"),
    **{"min": "s", "h": "s", "L": "m^3", "t": "kg", "g": "kg"},
}
_TOKEN = re.compile(
    r"\s*(?:(\*\*|\^)\s*([+-]?[0-9]{1,2}(?:\.[0-9]{1,2})?(?![0-9.])|\([+-]?[0-9]{1,2}/[0-9]{1,2}\))"
    r"|([*/()·])|([^\W\d]+|°|1)|([²³]))"
)
#: A force by a length is the unit of a torque, which is counted as J/rad.
_TORQUE = re.compile(r"(?<!\w)[kMmuµμ]?N\s*[*·]\s*[cm]?m(?!\w|\s*(?:\*\*|\^|[²³]))")
_LONGEST = 100  # maximum number of characters of a unit

UNIT_HELP = "units are written as `kg`, `m/s^2`, `N*m`, `deg`"


class UnknownUnit(ValueError):
    """Text that is not a unit; the message says why."""


def to_si(unit: str) -> Factor:
    """Return the factor that converts a value in this unit to SI; raises as `read_unit`."""
    return read_unit(unit).factor


@cache
def read_unit(text: str) -> ParsedUnit:
    """Return the unit of a text.

    ``a/b*c`` is evaluated from left to right, as in Pint: (a/b)·c.

    Raises
    ------
    UnknownUnit
        Invalid notation, a name that neither the table nor Pint knows, or a unit with an offset
        (degC).
    """
    unit = _product(text) if len(text) <= _LONGEST else None
    if unit is None:
        raise UnknownUnit(f"`{shorten(text)}` is not a unit")
    try:
        size = float(unit.factor)
    except OverflowError:
        size = math.inf
    if not 0 < size < math.inf:
        raise UnknownUnit(f"`{shorten(text)}` is too large or too small")
    if _TORQUE.search(text):
        unit = unit.times(_BASE["rad"], -1)
    return unit


def si_notation(unit: str) -> str:
    """Return the SI unit for values given in a unit: ``deg/s`` becomes ``rad/s``."""

    def replaced(match: re.Match[str]) -> str:
        name = match[0]
        si = _SI_NAMES.get(name) or (name if _single(name).factor == 1 else None)
        if si is None and name[1:] in _BASE:
            si = "kg" if name[1:] == "g" else name[1:]
        if si is None:
            si = f"{_registry().Quantity(1, name).to_base_units().units:~C}".replace("**", "^")
        return f"({si})" if re.search("[*/^]", si) and name != unit else si

    return unit if to_si(unit) == 1 else re.sub(r"[^\W\d]+|°", replaced, unit)


def _single(name: str) -> ParsedUnit:
    if name in _WHOLE:
        return _WHOLE[name]
    if name in _BASE:
        return _BASE[name]
    if len(name) > 1 and name[0] in _PREFIX and name[1:] in _BASE:
        return _BASE[name[1:]]._replace(factor=_PREFIX[name[0]] * _BASE[name[1:]].factor)
    return _by_pint(name)


def _product(text: str) -> ParsedUnit | None:
    """Return the unit, or None for invalid notation."""
    position = 0
    one = _WHOLE["1"]
    # per parenthesis: the product, its last factor, the sign of the next exponent
    stack: list[tuple[ParsedUnit, ParsedUnit | None, int]] = [(one, None, 1)]
    expect_unit = True
    while position < len(text.rstrip()):
        match = _TOKEN.match(text, position)
        if not match:
            return None
        position = match.end()
        raising, exponent, mark, name, small = match.groups()
        before, last, sign = stack[-1]
        if raising or small:
            if last is None:
                return None
            try:
                n = Fraction(exponent.strip("()") if raising else "..²³".index(small))
            except ZeroDivisionError:
                return None
            factor = before.factor / last.factor * last.factor ** (int(n) if n == int(n) else n)
            dimension = before.times(last, n - 1).dimension
            stack[-1] = (ParsedUnit(factor, dimension), None, 1)
        elif mark == "(":
            if not expect_unit:
                return None
            stack.append((one, None, 1))
        elif name or mark == ")":
            if mark == ")":
                if expect_unit or len(stack) == 1:
                    return None
                value = stack.pop()[0]
                before, last, sign = stack[-1]
            else:
                value = _single(name)
                if not expect_unit:
                    sign = 1  # a space between two units means a product
            value = one.times(value, sign)
            stack[-1] = (before.times(value), value, 1)
            expect_unit = False
        else:
            if expect_unit:
                return None
            stack[-1] = (before, None, -1 if mark == "/" else 1)
            expect_unit = True
    return None if expect_unit or len(stack) > 1 else stack[0][0]


#: Pint's names of the base units.
_OF_PINT = {
    **{"kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K"},
    **{"mole": "mol", "candela": "cd", "radian": "rad"},
}


def _by_pint(name: str) -> ParsedUnit:
    registry = _registry()
    try:
        unit = registry.parse_units(name)
        zero, one = (registry.Quantity(x, unit).to_base_units() for x in (0.0, 1.0))
        exponents = {_OF_PINT[base]: Fraction(x) for base, x in one.unit_items()}
    except Exception as error:  # Pint raises many exception types, including tokenizer errors
        raise UnknownUnit(f"`{name}` is not a unit") from error
    if zero.magnitude != 0.0:
        raise UnknownUnit(f"`{name}` has an offset: use an absolute unit, such as K")
    return ParsedUnit(float(one.magnitude), Dimension(**exponents))


@cache
def _registry() -> Any:
    import pint

    # without a cache folder: reading Pint's cache is slower than parsing its definitions
    return pint.UnitRegistry(cache_folder=None)


def is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        to_si(text)
    except UnknownUnit:
        return False
    return True
