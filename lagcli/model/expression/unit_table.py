"""The table of units: those that are not coherent SI units, with prefixes and other spellings."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from lagcli.model.expression.dimension import (
    ANGLE,
    CHARGE,
    COHERENT,
    ENERGY,
    FORCE,
    LENGTH,
    MASS,
    ONE,
    POWER,
    PRESSURE,
    SECOND,
    Dimension,
    Factor,
)


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
    "g": (Fraction(1, 1000), MASS, "kg"),
    "t": (Fraction(1000), MASS, "kg"),
    "lb": (_POUND, MASS, "kg"),
    "oz": (_POUND / 16, MASS, "kg"),
    "slug": (_POUND_FORCE / _FOOT, MASS, "kg"),
    "in": (_INCH, LENGTH, "m"),
    "ft": (_FOOT, LENGTH, "m"),
    "yd": (3 * _FOOT, LENGTH, "m"),
    "mi": (_MILE, LENGTH, "m"),
    "nmi": (_NAUTICAL, LENGTH, "m"),
    "au": (Fraction(149_597_870_700), LENGTH, "m"),
    "Å": (Fraction(1, 10**10), LENGTH, "m"),
    "L": (Fraction(1, 1000), Dimension(m=3), "m^3"),
    "l": (Fraction(1, 1000), Dimension(m=3), "m^3"),
    "ha": (Fraction(10_000), Dimension(m=2), "m^2"),
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
    "kgf": (_KILOPOND, FORCE, "N"),
    "lbf": (_POUND_FORCE, FORCE, "N"),
    "ozf": (_POUND_FORCE / 16, FORCE, "N"),
    "kip": (1000 * _POUND_FORCE, FORCE, "N"),
    "dyn": (Fraction(1, 10**5), FORCE, "N"),
    "bar": (Fraction(10**5), PRESSURE, "Pa"),
    "atm": (Fraction(101_325), PRESSURE, "Pa"),
    "psi": (_PSI, PRESSURE, "Pa"),
    "ksi": (1000 * _PSI, PRESSURE, "Pa"),
    "hp": (550 * _POUND_FORCE * _FOOT, POWER, "W"),
    "PS": (75 * _KILOPOND, POWER, "W"),
    "VA": (Fraction(1), POWER, "W"),
    "Wh": (Fraction(3600), ENERGY, "J"),
    "Ws": (Fraction(1), ENERGY, "J"),
    "erg": (Fraction(1, 10**7), ENERGY, "J"),
    "eV": (Fraction(1_602_176_634, 10**28), ENERGY, "J"),
    "Ah": (Fraction(3600), CHARGE, "C"),
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
    table = {x: TableUnit(Fraction(1), d, ((x, 1),)) for x, d in COHERENT.items()}
    for name, (factor, dimension, si) in _OTHERS.items():
        table[name] = TableUnit(factor, dimension, _SYMBOLS.get(si) or (((si, 1),) if si else ()))
    plain = dict(table)
    for name in (*COHERENT, *_PREFIXED):
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
