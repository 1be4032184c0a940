"""Units: their conversion factors to SI and their dimensions, read from text."""

from __future__ import annotations

import math
import re
from fractions import Fraction
from functools import cache

from lagcli.model.expression.dimension import (
    ANGLE,
    ENERGY,
    ONE,
    POWER,
    SECOND,
    Dimension,
    product,
    same,
)
from lagcli.model.spelling import shorten
from lagcli.named_tuples import NamedTuple


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
    si: tuple[tuple[str, Fraction], ...] = ()
    atoms: tuple[tuple[str, Fraction], ...] = ()

    def power(self, exponent: Fraction) -> ParsedUnit:
        """Return a power of this unit."""
        dimension = product(ONE, self.dimension, exponent)
        assert isinstance(dimension, Dimension)
        whole = int(exponent) if exponent.denominator == 1 else exponent
        return ParsedUnit(
            self.factor**whole,
            dimension,
            tuple((x, n * exponent) for x, n in self.si),
            tuple((x, n * exponent) for x, n in self.atoms),
        )

    def times(self, other: ParsedUnit) -> ParsedUnit:
        """Return a product of units."""
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
        raise UnknownUnit(f"`{shorten(text)}` is not a unit")
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
    factors: list[tuple[str, Fraction]] = []
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
    return re.fullmatch(separate, unit) is not None and compounds().keys().isdisjoint(names)


def plain_notation(unit: str) -> str:
    """Return a unit with its powers as ``^2`` and its products as ``*``: ``N/mm²`` is N/mm^2."""
    text = unit.translate(_CHARACTERS).replace("·", "*")
    text = re.sub("[⁻⁺]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda m: "^" + m[0].translate(_SUPERSCRIPTS), text)
    return re.sub(rf"(?<={_LETTER})[2-9]", r"^\g<0>", text)


def commensurable(unit: str, other: str) -> bool:
    """Whether two units have the same dimension; raises as `read_unit`."""
    return same(read_unit(unit).dimension, read_unit(other).dimension)


def is_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        to_si(text)
    except UnknownUnit:
        return False
    return True


def _written(name: str, exponent: Fraction) -> str:
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
    if unit.atoms == (("min", Fraction(-1)),):
        reason = "it may count revolutions; write rpm for these, or 1/s"
    elif len(names) > 1 and {"lb", "pound", "pounds"}.intersection(names):
        reason = "write lbf for the force, lbm for the mass"
    elif len(names) > 1 and "oz" in names:
        reason = "write ozf for the force, lbm for a mass"
    elif plain.startswith(("°", "deg")) and re.match(
        r"(?:°|deg(?:rees?)?)\s*[*·]?\s*[CFR](?!\w)", plain
    ):
        reason = "temperatures are given in K: 20 °C is 293.15 K"
    elif plain in ("kgm", "kgcm", "kgmm"):
        reason = f"write kg*{plain[2:]} for a product, kgf*{plain[2:]} for a torque"
    if reason:
        raise UnknownUnit(f"`{shorten(text)}` is ambiguous: {reason}")


def _single(name: str) -> ParsedUnit:
    """Return the unit of a name."""
    entry = units().get(name)
    if entry is not None:
        return _of_table(name, entry)
    if name in REFUSED:
        raise UnknownUnit(f"`{name}` is not accepted: {REFUSED[name]}")
    folded = name.casefold()
    known = [f"`{x}`" for x in (*compounds(), *units()) if x.casefold() == folded]
    hint = f"; did you mean {' or '.join(known[:2])}?" if known else ""
    raise UnknownUnit(f"`{shorten(name)}` is not a unit{hint}")


def _of_table(name: str, unit: TableUnit) -> ParsedUnit:
    si = tuple((x, Fraction(n)) for x, n in unit.si)
    return ParsedUnit(unit.factor, unit.dimension, si, ((name, Fraction(1)),))


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
        exponent = match["power"] or (match["raised"] or "").translate(
            _SUPERSCRIPTS
        )
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
        parts = compounds().get(name, (name,)) if name not in units() else (name,)
        self._factor(tuple(_single(part) for part in parts))
        return self._raise(match["digit"]) if match["digit"] else True

    def _factor(self, parts: tuple[ParsedUnit, ...]) -> bool:
        """Multiply by units; the last can be raised to a power."""
        level = self.stack[-1]
        sign = Fraction(level.sign)
        level.before = level.value
        for part in parts[:-1]:
            level.before = level.before.times(part.power(sign))
        level.last, level.expects = parts[-1].power(sign), False
        level.value = level.before.times(level.last)
        level.sign = 1
        return True

    def _raise(self, exponent: str) -> bool:
        level = self.stack[-1]
        if level.last is None:
            return False
        try:
            n = Fraction(exponent.strip("()"))
        except ZeroDivisionError:
            return False
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
        self.sign = 1
        self.divided = False
        self.expects = True


Factor = Fraction | float  # exact wherever the unit allows it, so that 7 mm is 0.007 m


class TableUnit(NamedTuple):
    """A unit of the table.

    Parameters
    ----------
    factor : Fraction or float
        Value in SI.
    dimension : Dimension
    si : tuple of (str, int)
        The coherent SI unit as symbols with exponents: ``(("rad", 1), ("s", -1))`` of rpm.
    """

    factor: Factor
    dimension: Dimension
    si: tuple[tuple[str, int], ...]


_AREA, _VOLUME, _PRESSURE = Dimension(m=2), Dimension(m=3), Dimension(kg=1, m=-1, s=-2)
_MASS, _LENGTH, _FORCE = Dimension(kg=1), Dimension(m=1), Dimension(kg=1, m=1, s=-2)
_CHARGE, _VOLT = Dimension(A=1, s=1), Dimension(kg=1, m=2, s=-3, A=-1)

#: Coherent SI units.
_COHERENT = {
    **{"m": _LENGTH, "s": SECOND, "A": Dimension(A=1), "K": Dimension(K=1)},
    **{"mol": Dimension(mol=1), "cd": Dimension(cd=1), "rad": ANGLE, "sr": Dimension(rad=2)},
    **{"Hz": Dimension(s=-1), "N": _FORCE, "J": ENERGY, "W": POWER, "Pa": _PRESSURE},
    **{"C": _CHARGE, "V": _VOLT, "ohm": Dimension(kg=1, m=2, s=-3, A=-2)},
    **{"F": Dimension(kg=-1, m=-2, s=4, A=2), "S": Dimension(kg=-1, m=-2, s=3, A=2)},
    **{"Wb": Dimension(kg=1, m=2, s=-2, A=-1), "T": Dimension(kg=1, s=-2, A=-1)},
    **{"H": Dimension(kg=1, m=2, s=-2, A=-2), "kg": _MASS},
}

_PREFIXES = {
    **{"p": Fraction(1, 10**12), "n": Fraction(1, 10**9), "u": Fraction(1, 10**6)},
    **{"µ": Fraction(1, 10**6), "μ": Fraction(1, 10**6), "m": Fraction(1, 1000)},
    **{"c": Fraction(1, 100), "d": Fraction(1, 10), "k": Fraction(10**3)},
    **{"M": Fraction(10**6), "G": Fraction(10**9)},
}
#: Prefixes that only some units take, because `PS`, `Tm` or `hN` mean something else, or nothing.
_FURTHER = {
    "da": (Fraction(10), ("N",)),
    "h": (Fraction(100), ("Pa", "L", "l")),
    "f": (Fraction(1, 10**15), ("N", "J", "F", "s", "m")),
    "T": (Fraction(10**12), ("Hz", "J", "W", "Pa")),
}
_LONG_PREFIXES = {
    **{"nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k", "mega": "M"},
    "giga": "G",
}
_LONG_NAMES = {
    **{"meter": "m", "metre": "m", "second": "s", "gram": "g", "newton": "N", "joule": "J"},
    **{"watt": "W", "pascal": "Pa", "hertz": "Hz", "kelvin": "K", "ampere": "A", "volt": "V"},
    **{"coulomb": "C", "tesla": "T", "radian": "rad", "liter": "L", "litre": "L"},
}
#: Other spellings.
_SPELLINGS = {
    **{"°": "deg", "degree": "deg", "degrees": "deg", "Ω": "ohm", "angstrom": "Å"},
    **{"inch": "in", "inches": "in", "foot": "ft", "feet": "ft", "yard": "yd", "yards": "yd"},
    **{"mile": "mi", "miles": "mi", "knots": "knot", "pound": "lb", "pounds": "lb", "lbm": "lb"},
    **{"kp": "kgf", "tonne": "t", "tonnes": "t", "sec": "s", "minute": "min", "minutes": "min"},
    **{"hr": "h", "hour": "h", "hours": "h", "day": "d", "days": "d", "year": "yr", "years": "yr"},
    **{"turn": "rev", "turns": "rev", "revolution": "rev", "revolutions": "rev", "U": "rev"},
    "dimensionless": "1",
}

_INCH, _FOOT = Fraction(254, 10_000), Fraction(3048, 10_000)
_POUND = Fraction(45_359_237, 10**8)
_KILOPOND = Fraction(980_665, 10**5)
_POUND_FORCE = _POUND * _KILOPOND
_PSI = _POUND_FORCE / _INCH**2
_MILE, _NAUTICAL = Fraction(1_609_344, 1000), Fraction(1852)

#: Units that are not coherent: factor, dimension, SI unit.
_OTHERS: dict[str, tuple[Factor, Dimension, str]] = {
    "1": (Fraction(1), ONE, ""),
    "g": (Fraction(1, 1000), _MASS, "kg"),
    "t": (Fraction(1000), _MASS, "kg"),
    "lb": (_POUND, _MASS, "kg"),
    "oz": (_POUND / 16, _MASS, "kg"),
    "slug": (_POUND_FORCE / _FOOT, _MASS, "kg"),
    "in": (_INCH, _LENGTH, "m"),
    "ft": (_FOOT, _LENGTH, "m"),
    "yd": (3 * _FOOT, _LENGTH, "m"),
    "mi": (_MILE, _LENGTH, "m"),
    "nmi": (_NAUTICAL, _LENGTH, "m"),
    "au": (Fraction(149_597_870_700), _LENGTH, "m"),
    "Å": (Fraction(1, 10**10), _LENGTH, "m"),
    "L": (Fraction(1, 1000), _VOLUME, "m^3"),
    "l": (Fraction(1, 1000), _VOLUME, "m^3"),
    "ha": (Fraction(10_000), _AREA, "m^2"),
    "min": (Fraction(60), SECOND, "s"),
    "h": (Fraction(3600), SECOND, "s"),
    "d": (Fraction(86_400), SECOND, "s"),
    "yr": (Fraction(31_557_600), SECOND, "s"),
    "deg": (math.pi / 180, ANGLE, "rad"),
    "gon": (math.pi / 200, ANGLE, "rad"),
    "arcmin": (math.pi / 10_800, ANGLE, "rad"),
    "arcsec": (math.pi / 648_000, ANGLE, "rad"),
    "rev": (2 * math.pi, ANGLE, "rad"),
    "rpm": (math.pi / 30, Dimension(s=-1, rad=1), "rad/s"),
    "rps": (2 * math.pi, Dimension(s=-1, rad=1), "rad/s"),
    "mph": (_MILE / 3600, Dimension(m=1, s=-1), "m/s"),
    "knot": (_NAUTICAL / 3600, Dimension(m=1, s=-1), "m/s"),
    "kgf": (_KILOPOND, _FORCE, "N"),
    "lbf": (_POUND_FORCE, _FORCE, "N"),
    "ozf": (_POUND_FORCE / 16, _FORCE, "N"),
    "kip": (1000 * _POUND_FORCE, _FORCE, "N"),
    "dyn": (Fraction(1, 10**5), _FORCE, "N"),
    "bar": (Fraction(10**5), _PRESSURE, "Pa"),
    "atm": (Fraction(101_325), _PRESSURE, "Pa"),
    "psi": (_PSI, _PRESSURE, "Pa"),
    "ksi": (1000 * _PSI, _PRESSURE, "Pa"),
    "hp": (550 * _POUND_FORCE * _FOOT, POWER, "W"),
    "PS": (75 * _KILOPOND, POWER, "W"),
    "VA": (Fraction(1), POWER, "W"),
    "Wh": (Fraction(3600), ENERGY, "J"),
    "Ws": (Fraction(1), ENERGY, "J"),
    "erg": (Fraction(1, 10**7), ENERGY, "J"),
    "eV": (Fraction(1_602_176_634, 10**28), ENERGY, "J"),
    "Ah": (Fraction(3600), _CHARGE, "C"),
    "cP": (Fraction(1, 1000), Dimension(kg=1, m=-1, s=-1), "Pa*s"),
    "cSt": (Fraction(1, 10**6), Dimension(m=2, s=-1), "m^2/s"),
}
#: Units that take no prefix: `Grad` is German for a degree.
_ALONE = ("kg", "sr", "cd")
_SMALL_ONLY = {"rad": ("n", "u", "µ", "μ", "m")}
#: Units that take prefixes in addition to the coherent ones.
_PREFIXED = ("g", "L", "l", "bar", "Wh", "Ws", "VA", "eV", "Ah")

_SYMBOLS = {
    **{"m^3": (("m", 3),), "m^2": (("m", 2),), "rad/s": (("rad", 1), ("s", -1)), "": ()},
    **{"m/s": (("m", 1), ("s", -1)), "Pa*s": (("Pa", 1), ("s", 1))},
    "m^2/s": (("m", 2), ("s", -1)),
}

#: What looks like a unit and is none, or has several meanings: the remedy.
REFUSED = {
    **dict.fromkeys(
        ["°C", "degC", "celsius", "Celsius", "°F", "degF", "fahrenheit", "Fahrenheit", "°R"],
        "a temperature on this scale has an offset or another zero; give it in K:"
        " 20 °C is 293.15 K",
    ),
    **dict.fromkeys(
        ["gal", "gallon", "gallons", "pint", "quart", "floz"],
        "it differs between countries; write L or m^3",
    ),
    **dict.fromkeys(
        ["cal", "kcal", "Cal", "Btu", "BTU", "btu"], "it has several definitions; write J"
    ),
    **dict.fromkeys(
        ["ton", "tons", "tonf", "kt", "Mt"], "it has several meanings; write t, kg, kN or knot"
    ),
    **dict.fromkeys(["kn", "kts"], "write kN for kilonewtons, knot for a speed"),
    **dict.fromkeys(["Grad", "grad", "grade"], "write deg for degrees, gon for 1/400 of a turn"),
    **dict.fromkeys(["kmh", "kph", "kmph"], "write km/h"),
    **dict.fromkeys(["fps"], "write ft/s"),
    **dict.fromkeys(["ccm", "cc"], "write cm^3"),
    **dict.fromkeys(["Upm", "UpM"], "write U/min or rpm"),
    **dict.fromkeys(
        ["lbft", "ftlb", "lbfft", "ftlbf", "footpound"], "write ft*lbf for a torque or an energy"
    ),
    **dict.fromkeys(["lbin", "inlb", "lbfin", "inlbf"], "write in*lbf for a torque"),
    **dict.fromkeys(["ozin", "inoz"], "write in*ozf for a torque"),
    **dict.fromkeys(["gm", "gms"], "write g for grams, g*m for a product"),
    **dict.fromkeys(["Kg", "KG", "kgs", "kilo", "kilos"], "write kg"),
    **dict.fromkeys(["mil", "mils"], "it has several meanings; write in or mrad"),
    **dict.fromkeys(["Gal", "Gals"], "write cm/s^2"),
    **dict.fromkeys(
        ["CV", "cv", "ch", "HP", "bhp"], "write PS for metric, hp for other horsepower"
    ),
    **dict.fromkeys(["pi"], "write a value and its unit as `{value: 2*pi, unit: rad/s}`"),
    **dict.fromkeys(["r", "tr"], "write rev for revolutions, rad for radians"),
}

#: Units written without a sign between them. `Nms` is N*m*s, not a force times milliseconds.
_HEADS = {
    "N": ("m", "mm", "cm", "s", "ms", "mms", "cms"),
    "J": ("s",),
    "A": ("s",),
    "V": ("s",),
    "Pa": ("s",),
    "kg": ("m", "mm", "cm"),
    "g": ("mm", "cm"),
    "t": ("mm",),
}
_TAILS = {"ms": ("m", "s"), "mms": ("mm", "s"), "cms": ("cm", "s")}
_COMPOUND_PREFIXES = ("", "n", "u", "µ", "μ", "m", "c", "d", "da", "k", "M", "G")


@cache
def units() -> dict[str, TableUnit]:
    """Return all units of one symbol, with their prefixes."""
    table = {x: TableUnit(Fraction(1), d, ((x, 1),)) for x, d in _COHERENT.items()}
    for name, (factor, dimension, si) in _OTHERS.items():
        table[name] = TableUnit(factor, dimension, _SYMBOLS.get(si) or (((si, 1),) if si else ()))
    plain = dict(table)
    for name in (*_COHERENT, *_PREFIXED):
        prefixes = dict(_PREFIXES)
        if name in _SMALL_ONLY:
            prefixes = {p: _PREFIXES[p] for p in _SMALL_ONLY[name]}
        prefixes |= {p: size for p, (size, only) in _FURTHER.items() if name in only}
        for prefix, size in prefixes.items() if name not in _ALONE else ():
            table.setdefault(prefix + name, plain[name]._replace(factor=size * plain[name].factor))
    for name, short in _LONG_NAMES.items():
        for before, prefix in {"": "", **_LONG_PREFIXES}.items():
            if prefix + short in table:
                table[before + name] = table[prefix + short]
                if name != "hertz":
                    table[before + name + "s"] = table[prefix + short]
    table |= {name: table[short] for name, short in _SPELLINGS.items()}
    table |= {f"{prefix}Ω": table[f"{prefix}ohm"] for prefix in _PREFIXES}
    return table


@cache
def compounds() -> dict[str, tuple[str, ...]]:
    """Return the units written without a sign between them: ``Nm`` is ``("N", "m")``."""
    parts_of: dict[str, tuple[str, ...]] = {}
    known = units()
    for head, tails in _HEADS.items():
        for prefix in _COMPOUND_PREFIXES if head in ("N", "J", "A", "V", "Pa") else ("",):
            for tail in tails:
                if prefix + head in known and prefix + head + tail not in known:
                    parts = _TAILS[tail] if head == "N" and tail in _TAILS else (tail,)
                    parts_of[prefix + head + tail] = (prefix + head, *parts)
    return parts_of
