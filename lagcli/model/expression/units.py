"""Units: their conversion factors to SI and their dimensions, read from text."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from lagcli.model.expression.dimension import (
    ANGLE,
    COHERENT,
    ONE,
    Dimension,
    Exponent,
    Factor,
    product,
    same,
    whole,
)
from lagcli.model.spelling import shorten

# The table of other units than the coherent ones is imported when a name is none of them.


class ParsedUnit(NamedTuple):
    """A unit: the factor that converts a value to SI, the dimension, and the SI unit.

    Parameters
    ----------
    factor : Fraction or float
    dimension : Dimension
    si : tuple of (str, exponent)
        Symbols of the coherent SI unit with their exponents, in the order of the text.
    atoms : tuple of (str, exponent)
        The symbols of the text with their exponents.
    """

    factor: Factor
    dimension: Dimension
    si: tuple[tuple[str, Exponent], ...] = ()
    atoms: tuple[tuple[str, Exponent], ...] = ()

    def power(self, exponent: Exponent) -> ParsedUnit:
        """Return a power of this unit."""
        if exponent == 1:
            return self
        dimension = product(ONE, self.dimension, exponent)
        assert isinstance(dimension, Dimension)
        return ParsedUnit(
            self.factor**exponent,
            dimension,
            tuple((x, whole(n * exponent)) for x, n in self.si),
            tuple((x, whole(n * exponent)) for x, n in self.atoms),
        )

    def times(self, other: ParsedUnit) -> ParsedUnit:
        """Return a product of units."""
        if self is _NONE:
            return other
        dimension = product(self.dimension, other.dimension)
        assert isinstance(dimension, Dimension)
        return ParsedUnit(
            self.factor * other.factor, dimension, self.si + other.si, self.atoms + other.atoms
        )


_NONE = ParsedUnit(Fraction(1), ONE)
_SUPERSCRIPTS = str.maketrans("⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹", "-+0123456789")
#: Other characters for a degree, an ohm and a product.
_CHARACTERS = str.maketrans(
    {
        **{"\u00ba": "°", "\u02da": "°", "℃": "°C", "℉": "°F", "\u2126": "Ω"},
        **dict.fromkeys("\u22c5\u2219×", "·"),
    }
)
_LETTER = "[^\\W\\d⁰¹²³⁴⁵⁶⁷⁸⁹]"
_LONGEST = 100  # maximum number of characters of a unit


@cache
def _token(ascii: bool) -> re.Pattern[str]:
    """Return the pattern of a token: for ASCII text one that is compiled in half the time."""
    letter = r"[^\W\d]" if ascii else _LETTER
    name = f"{letter}+" if ascii else rf"°[CFR]?(?!{letter}|°)|{letter}+"
    raised = "(?!)" if ascii else "[⁻⁺]?[⁰¹²³⁴⁵⁶⁷⁸⁹]{1,2}"
    return re.compile(
        r"\s*(?:(?:\*\*|\^)\s*(?P<power>[+-]?[0-9]{1,2}(?:\.[0-9]{1,2})?(?![0-9.])"
        rf"|\([+-]?[0-9]{{1,2}}/[0-9]{{1,2}}\))|(?P<raised>{raised})"
        r"|(?P<mark>[*/()·]|\.(?=[^\W\d]))|(?P<one>1)"
        rf"|(?P<name>{name})(?P<digit>[2-9])?(?![0-9]))"
    )


#: A number and its unit, which need not be one.
WITH_UNIT = re.compile(
    r"\s*([+-]?(?:[0-9]++(?:\.[0-9]*+)?|\.[0-9]++)(?:[eE][+-]?[0-9]++)?)"
    r"\s*+(?![eE][+-]?[0-9])((?:[^\W\d_]|[°˚℃℉]|1\s*/).*)",
    re.DOTALL,
)

UNIT_HELP = "units are written as `kg`, `m/s^2`, `N*m`, `deg`"


class UnknownUnit(ValueError):
    """Text that is not a unit; the message says why."""


def to_si(unit: str) -> Factor:
    """Return the factor that converts a value in this unit to SI; raises as `read_unit`."""
    return read_unit(unit).factor


@cache
def read_unit(text: str) -> ParsedUnit:
    """Return the unit of a text.

    Products, quotients and powers of the units in the table, as in ``kg*m^2/s``, ``kg m²``,
    ``N/mm2`` and ``kNm/rad``. ``a/b*c`` is evaluated from left to right: (a/b)·c. A power belongs
    to the last symbol: ``kgm^2`` is kg·m².

    Raises
    ------
    UnknownUnit
        Invalid notation, an unknown name, or a unit with several meanings.
    """
    plain = text.strip().translate(_CHARACTERS)
    if plain in ("-", "–"):
        return _NONE
    unit = _UnitReader(plain).read() if len(plain) <= _LONGEST else None
    if unit is None:
        raise UnknownUnit(f"`{shorten(text)}` is not a unit{_power_hint(plain)}")
    try:
        size = float(unit.factor)
    except OverflowError:
        size = math.inf
    if not 0 < size < math.inf:
        raise UnknownUnit(f"`{shorten(text)}` is too large or too small")
    _refuse_doubtful(text, plain, unit)
    return unit._replace(dimension=_with_torque(unit))


def si_notation(unit: str) -> str:
    """Return the SI unit for values given in a unit: ``deg/s`` becomes ``rad/s``."""
    parsed = read_unit(unit)
    if parsed.atoms == parsed.si and _is_plain(unit):
        return unit
    factors: list[tuple[str, Exponent]] = []
    for name, n in parsed.si:
        if factors and factors[-1][0] == name:
            n += factors.pop()[1]
        if n:
            factors.append((name, n))
    above = [_written(name, n) for name, n in factors if n > 0]
    below = [_written(name, -n) for name, n in factors if n < 0]
    over = f"({'*'.join(below)})" if len(below) > 1 else "".join(below)
    return ("*".join(above) or "1") + (f"/{over}" if over else "")


def _is_plain(unit: str) -> bool:
    """Whether a unit is in the notation of results: no other may be in an SI unit."""
    letters = r"[^\W\d_⁰¹²³⁴⁵⁶⁷⁸⁹]"
    separate = rf"(?:{letters}(?![0-9])|[\s*/^()]|(?<![^\W\d_])[+-]?[0-9.]+)+"
    names = "".join(x if x.isalpha() else " " for x in unit).split()
    return re.fullmatch(separate, unit) is not None and all(len(_parts(x)) == 1 for x in names)


def plain_notation(unit: str) -> str:
    """Return a unit with its powers as ``^2`` and its products as ``*``: ``N/mm²`` is N/mm^2."""
    text = unit.translate(_CHARACTERS).replace("·", "*")
    text = re.sub("[⁻⁺]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: "^" + m[0].translate(_SUPERSCRIPTS), text)
    return re.sub(rf"(?<={_LETTER})[2-9]", r"^\g<0>", text)


def commensurable(unit: str, other: str) -> bool:
    """Whether values in one unit can be given in the other; raises as `read_unit`.

    Units of one dimension, but not hertz for rates of rotation: 1 Hz may be 1 rad/s or a turn per
    second.
    """
    return same_dimension(unit, other) and not (_in_cycles(unit, other) or _in_cycles(other, unit))


def same_dimension(unit: str, other: str) -> bool:
    """Whether two units have the same dimension; raises as `read_unit`."""
    return same(read_unit(unit).dimension, read_unit(other).dimension)


def are_equal(unit: str, other: str) -> bool:
    """Whether two units are notations of one; raises as `read_unit`."""
    return same_dimension(unit, other) and to_si(unit) == to_si(other)


def remedy(unit: str, given: str) -> str:
    """Return what to write where a value is due in a unit, and given in one that does not fit."""
    if _in_cycles(given, unit):
        return NO_HERTZ
    return f"give it in {unit}, or in another unit of that dimension"


#: What to write for an angular velocity in hertz.
NO_HERTZ = "write rad/s, rev/s or rpm: 1 Hz may be 1 rad/s or a turn per second"


def is_frequency(unit: str) -> bool:
    """Whether a unit is hertz, with or without a prefix."""
    return read_unit(unit).si == (("Hz", 1),)


def _in_cycles(unit: str, other: str) -> bool:
    """Whether a unit is one with hertz where another of the same dimension has an angle."""
    one, two = read_unit(unit), read_unit(other)
    angles = one.dimension.rad != two.dimension.rad and two.dimension.rad != 0
    return _has_hertz(one) and not _has_hertz(two) and angles and same(one.dimension, two.dimension)


def _has_hertz(unit: ParsedUnit) -> bool:
    return _exponent(unit, "Hz") != 0


def _exponent(unit: ParsedUnit, symbol: str) -> Exponent:
    """Return the exponent of an SI symbol in a unit."""
    return sum((n for name, n in unit.si if name == symbol), 0)


def _is_torque_with_hertz(unit: ParsedUnit) -> bool:
    """Whether a unit is a torque times a power of hertz."""
    force, length = _exponent(unit, "N"), _exponent(unit, "m")
    return force == length and abs(force) == 1 and _has_hertz(unit)


def is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        to_si(text)
    except UnknownUnit:
        return False
    return True


def _written(name: str, exponent: Exponent) -> str:
    if exponent == 1:
        return name
    return f"{name}^{exponent}" if exponent.denominator == 1 else f"{name}^({exponent})"


def _with_torque(unit: ParsedUnit) -> Dimension:
    """Return the dimension, with J/rad for a force by a length, which is the unit of a torque."""
    for (name, n), (after, m) in zip(unit.si, unit.si[1:], strict=False):
        if {name, after} == {"N", "m"} and n == m and abs(n) == 1:
            torque = product(unit.dimension, ANGLE, -int(n))
            assert isinstance(torque, Dimension)
            return torque
    return unit.dimension


def _refuse_doubtful(text: str, plain: str, unit: ParsedUnit) -> None:
    """Raise for combinations of units that engineers read in different ways."""
    reason = ""
    names = [name for name, _ in unit.atoms]
    if unit.atoms == (("min", -1),):
        reason = "it may count revolutions; write rpm for these, or 1/s"
    elif _is_torque_with_hertz(unit):
        reason = "1 Hz may be 1 rad/s or a turn per second; write N*m*s/rad"
    elif len(names) > 1 and {"lb", "pound", "pounds"}.intersection(names):
        reason = "write lbf for the force, lbm for the mass"
    elif len(names) > 1 and "oz" in names:
        reason = "write ozf for the force, lbm for a mass"
    elif plain.startswith(("°", "deg")) and re.match(
        r"(?:°|deg(?:rees?)?)\s*[*·]?\s*[CFR](?!\w)", plain
    ):
        reason = "temperatures are given in K: 20 °C is 293.15 K"
    elif re.search(r"(?<![^\W\d])k?g\s*/\s*ms(?!\w)", plain):
        reason = "write kg/(m*s) with meters, kg/(ms) with milliseconds"
    elif re.search(r"/\s*mK(?!\w)", plain):
        reason = "write W/(m*K) with meters, W/(mK) with millikelvins"
    elif plain in ("kgm", "kgcm", "kgmm"):
        reason = f"write kg*{plain[2:]} for a product, kgf*{plain[2:]} for a torque"
    if reason:
        raise UnknownUnit(f"`{shorten(text)}` is ambiguous: {reason}")


def _power_hint(plain: str) -> str:
    """Return what to write for a power without its sign, as in ``m s-2``."""
    written = re.sub(r"(?<=[^\W\d])-(?=[1-9])", "^-", plain)
    if written == plain or "/" in plain or len(written) > _LONGEST:
        return ""
    read_unit(written)  # raises for what is no unit either way
    return f"; did you mean `{written}`?"


def _parts(name: str) -> tuple[str, ...]:
    """Return the units that a word consists of: ``Nm`` is ``("N", "m")``."""
    if name in COHERENT:
        return (name,)
    from lagcli.model.expression.unit_table import compounds, units

    return (name,) if name in units() else compounds().get(name, (name,))


def _single(name: str) -> ParsedUnit:
    """Return the unit of a name."""
    if name in COHERENT:
        return ParsedUnit(Fraction(1), COHERENT[name], ((name, 1),), ((name, 1),))
    from lagcli.model.expression.unit_table import REFUSED, compounds, units

    entry = units().get(name)
    if entry is not None:
        return ParsedUnit(entry.factor, entry.dimension, entry.si, ((name, 1),))
    if name in REFUSED:
        raise UnknownUnit(f"`{name}` is not accepted: {REFUSED[name]}")
    folded = name.casefold()
    known = [f"`{x}`" for x in (*compounds(), *units()) if x.casefold() == folded]
    hint = f"; did you mean {' or '.join(known[:2])}?" if known else ""
    raise UnknownUnit(f"`{shorten(name)}` is not a unit{hint}")


def _is_product_with_meters(name: str, exponent: Exponent) -> bool:
    """Whether a power of a unit is usual for meters by a power: ``ms^-2``, ``mN^-1``."""
    if name == "ms":
        return exponent != 1
    return name[:1] == "m" and name[1:] in COHERENT and name != "mm" and exponent < 0


def _product_and_power(name: str, text: str, exponent: Exponent, level: _UnitLevel) -> str:
    """Return both ways to write a power of a unit that may be meters by a power."""
    plain, power = f"m*{name[1:]}^{text}", f"({name})^{text}"
    if level.divisor:
        plain = f"({plain})"
    elif exponent < 0:
        quotient = f"({name})^{-exponent}" if exponent != -1 else name
        power = f"{'1' if level.before is _NONE else ''}/{quotient}"
    elif exponent.denominator == 1:
        power = "*".join([name] * int(exponent))
    return f"{plain} with meters, {power} for a power of {name}"


class _UnitReader:
    """Reads one text, from left to right."""

    def __init__(self, text: str):
        self.text = text
        # per parenthesis: the product, its last factor, the sign of the next exponent, and
        # whether there was a quotient
        self.stack: list[_UnitLevel] = [_UnitLevel()]

    def read(self) -> ParsedUnit | None:
        """Return the unit, or None for invalid notation."""
        position = 0
        pattern = _token(self.text.isascii())
        while position < len(self.text):
            match = pattern.match(self.text, position)
            if not match or not self._apply(match):
                return None
            position = match.end()
        level, *unclosed = self.stack
        return None if level.expects or unclosed else level.value

    def _apply(self, match: re.Match[str]) -> bool:
        """Apply one token; return whether it is valid here."""
        level = self.stack[-1]
        exponent = match["power"] or (match["raised"] or "").translate(_SUPERSCRIPTS)
        if exponent:
            return self._raise(exponent)
        if match["mark"] == "(":
            if level.expects:
                self.stack.append(_UnitLevel())
            return level.expects
        if match["mark"] == ")":
            if level.expects or len(self.stack) == 1:
                return False
            value = self.stack.pop().value
            return self._factor((value,))
        if mark := match["mark"]:
            if level.expects:
                return False
            if level.divided and mark != "*":
                self._refuse_quotient()
            level.last, level.sign, level.expects = None, -1 if mark == "/" else 1, True
            level.divided = level.divided or mark == "/"
            return True
        if match["one"]:
            return level.expects and self._factor((_NONE,))
        if not level.expects:
            if level.divided:
                self._refuse_quotient()
            level.sign = 1  # a space between two units means a product
        name = match["name"]
        self._factor(tuple(_single(part) for part in _parts(name)))
        level.word = name
        return self._raise(match["digit"]) if match["digit"] else True

    def _factor(self, parts: tuple[ParsedUnit, ...]) -> bool:
        """Multiply by units; the last can be raised to a power."""
        level = self.stack[-1]
        level.before = level.value
        for part in parts[:-1]:
            level.before = level.before.times(part.power(level.sign))
        level.last, level.expects = parts[-1].power(level.sign), False
        level.value = level.before.times(level.last)
        level.divisor, level.sign, level.word = level.sign < 0, 1, ""
        return True

    def _raise(self, exponent: str) -> bool:
        level = self.stack[-1]
        if level.last is None:
            return False
        try:
            n = whole(Fraction(exponent.strip("()")))
        except ZeroDivisionError:
            return False
        if _is_product_with_meters(level.word, n):
            ways = _product_and_power(level.word, exponent, n, level)
            raise UnknownUnit(f"`{shorten(self.text)}` is ambiguous: write {ways}")
        level.value = level.before.times(level.last.power(n))
        level.last = None
        return True

    def _refuse_quotient(self) -> None:
        raise UnknownUnit(
            f"`{shorten(self.text)}` is ambiguous: write parentheses after the `/`, as in"
            " `W/(m^2*K)`"
        )


class _UnitLevel:
    """The product within one pair of parentheses."""

    def __init__(self) -> None:
        self.value = self.before = _NONE
        self.last: ParsedUnit | None = None
        self.word = ""  # the last factor, if it is a name
        self.divisor = False  # whether the last factor follows a `/`
        self.sign = 1
        self.divided = False
        self.expects = True
