"""Dimensions: exponents of the base units, their SI notation, and those of vectors."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import NamedTuple

Exponent = int | Fraction
Factor = Fraction | float  # to SI; exact where the unit allows it, so that 7 mm is 0.007 m

_RAD = 7  # place of the angle among the exponents


class Dimension(NamedTuple):
    """Exponents of kg, m, s, A, K, mol, cd, and of rad.

    A radian is the number 1: dimensions that differ only in ``rad`` are equal (`same`). Its
    exponent is kept to write rad/s for a rate of rotation and N*m for a torque, which is J/rad.
    ``numbers`` are the exponents of numbers in an expression whose dimension is not known yet
    (`FreeNumbers`).
    """

    kg: Exponent = 0
    m: Exponent = 0
    s: Exponent = 0
    A: Exponent = 0
    K: Exponent = 0
    mol: Exponent = 0
    cd: Exponent = 0
    rad: Exponent = 0
    numbers: tuple[tuple[int, Exponent], ...] = ()


class Special:
    """A value that fits any dimension.

    Parameters
    ----------
    name : str
    """

    def __init__(self, name: str):
        self.name = name

    def __repr__(self) -> str:
        return self.name

    def __reduce__(self) -> str:
        return self.name  # each is a singleton


#: The number 0, which has any dimension.
ZERO = Special("ZERO")
#: A number without a unit in an expression.
NUMBER = Special("NUMBER")
#: A quantity without a unit.
UNKNOWN = Special("UNKNOWN")

Scalar = Dimension | Special

ONE = Dimension()
ANGLE = Dimension(rad=1)
SECOND = Dimension(s=1)
MASS, LENGTH, CHARGE = Dimension(kg=1), Dimension(m=1), Dimension(A=1, s=1)
FORCE, PRESSURE = Dimension(kg=1, m=1, s=-2), Dimension(kg=1, m=-1, s=-2)
ENERGY, POWER = Dimension(kg=1, m=2, s=-2), Dimension(kg=1, m=2, s=-3)

#: Coherent SI units.
COHERENT = {
    **{"m": LENGTH, "s": SECOND, "A": Dimension(A=1), "K": Dimension(K=1)},
    **{"mol": Dimension(mol=1), "cd": Dimension(cd=1), "rad": ANGLE, "sr": Dimension(rad=2)},
    **{"Hz": Dimension(s=-1), "N": FORCE, "J": ENERGY, "W": POWER, "Pa": PRESSURE},
    **{"C": CHARGE, "V": Dimension(kg=1, m=2, s=-3, A=-1), "ohm": Dimension(kg=1, m=2, s=-3, A=-2)},
    **{"F": Dimension(kg=-1, m=-2, s=4, A=2), "S": Dimension(kg=-1, m=-2, s=3, A=2)},
    **{"Wb": Dimension(kg=1, m=2, s=-2, A=-1), "T": Dimension(kg=1, s=-2, A=-1)},
    **{"H": Dimension(kg=1, m=2, s=-2, A=-2), "kg": MASS},
}


def same(a: Dimension, b: Dimension) -> bool:
    """Whether two dimensions are equal, with rad = 1."""
    return a[:_RAD] == b[:_RAD]


@cache
def product(a: Scalar, b: Scalar, exponent: Exponent = 1) -> Scalar:
    """Return the dimension of a·b^exponent."""
    if a is ZERO or b is ZERO:
        return ZERO
    if a is UNKNOWN or b is UNKNOWN:
        return UNKNOWN
    if not isinstance(b, Dimension):
        return a
    if not isinstance(a, Dimension):
        a = ONE
    exponents = [whole(x + y * exponent) for x, y in zip(a[:8], b[:8], strict=True)]
    numbers = dict(a.numbers)
    for number, x in b.numbers:
        numbers[number] = whole(numbers.get(number, 0) + x * exponent)
    return Dimension._make([*exponents, tuple(sorted((n, x) for n, x in numbers.items() if x))])


@cache
def power(a: Scalar, exponent: Exponent) -> Scalar:
    """Return the dimension of a^exponent."""
    return product(ONE, a, exponent) if isinstance(a, Dimension) else a


def whole(x: Exponent) -> Exponent:
    """Return an exponent as an int if it is one."""
    return int(x) if x.denominator == 1 else x


_NAMES: dict[tuple[Exponent, ...], str] = {
    (1, 1, -2, 0): "N",
    (1, 2, -2, 0): "J",
    (1, 2, -3, 0): "W",
    (1, 0, -1, 0): "N*s/m",
    (1, 1, -1, 0): "kg*m/s",
    (1, 2, -1, 0): "kg*m^2/s",
    (0, 0, 1, 1): "C",
    (1, 2, -3, -1): "V",
    (1, 2, -3, -2): "ohm",
    (-1, -2, 4, 2): "F",
    (1, 2, -2, -2): "H",
    (1, 0, -2, -1): "T",
    (1, 2, -2, -1): "Wb",
}
_BASES = Dimension._fields[:8]


@cache
def unit_of(dimension: Dimension) -> str:
    """Return the coherent SI unit of a dimension, in the notation of model files.

    Uses N, J, W and the electrical units where they are shorter than base units. An energy per
    angle is written N*m; the angle is written only alone or per time.
    """
    exponents = dict(zip(_BASES, dimension[:8], strict=True))
    angle = exponents.pop("rad")
    if not any(x for name, x in exponents.items() if name != "s"):
        return _written({"rad": 1, **exponents} if angle == 1 else exponents)
    if dimension[4:_RAD] == (0, 0, 0):
        name = _NAMES.get(dimension[:4])
        if name == "kg*m^2/s" and angle < 0:
            return "N*m*s"  # of a rotational damper, not an angular momentum
        if name is not None:
            return "N*m" if name == "J" and (angle < 0 or angle % 2 == 1) else name
    # F = m a: a force takes the place of the mass, if that leaves fewer factors
    mass = exponents.pop("kg")
    force = {"N": mass, **exponents, "m": exponents["m"] - mass, "s": exponents["s"] + 2 * mass}
    base = {"kg": mass, **exponents}
    return _written(min(base, force, key=lambda form: sum(abs(float(x)) for x in form.values())))


def _written(form: dict[str, Exponent]) -> str:
    above = [_factor(name, x) for name, x in form.items() if x > 0]
    below = [_factor(name, -x) for name, x in form.items() if x < 0]
    text = "*".join(above) or "1"
    if len(below) > 1:
        return f"{text}/({'*'.join(below)})"
    return f"{text}/{below[0]}" if below else text


def _factor(name: str, exponent: Exponent) -> str:
    if exponent == 1:
        return name
    text = f"{float(exponent):.3g}" if exponent.denominator in (1, 2, 4, 5, 8) else f"({exponent})"
    return f"{name}^{text}"


class TensorDimension(NamedTuple):
    """Dimensions of the entries of a vector (one column) or a matrix."""

    rows: tuple[tuple[Scalar, ...], ...]

    def map(self, function: Callable[[Scalar], Scalar]) -> TensorDimension:
        """Apply a function to each entry."""
        return TensorDimension(tuple(tuple(map(function, row)) for row in self.rows))

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of entries in each row."""
        return tuple(map(len, self.rows))

    @property
    def flat(self) -> tuple[Scalar, ...]:
        """All entries, row by row."""
        return tuple(x for row in self.rows for x in row)


Value = Scalar | TensorDimension


ROTATION = TensorDimension(((ONE,) * 3,) * 3)


def rate_of(value: Value, order: int) -> Value:
    """Return the dimension of a time derivative."""
    if not order:
        return value
    if isinstance(value, TensorDimension):
        return value.map(lambda x: scalar_rate(x, order))
    return scalar_rate(value, order)


def scalar_rate(x: Scalar, order: int) -> Scalar:
    """Return the dimension of the time derivative of a scalar."""
    if isinstance(x, Dimension):
        return product(x, SECOND, -order)
    return ZERO if x is NUMBER else x


def differing(a: Value, b: Value) -> tuple[Scalar, Scalar]:
    """Return the first pair of entries that differ."""
    if not (isinstance(a, TensorDimension) and isinstance(b, TensorDimension)):
        assert not isinstance(a, TensorDimension)
        assert not isinstance(b, TensorDimension)
        return a, b
    for x, y in zip(a.flat, b.flat, strict=True):
        if x is not y and isinstance(x, Dimension) and isinstance(y, Dimension) and same(x, y):
            continue
        if x is not y and x is not ZERO and y is not ZERO and UNKNOWN not in (x, y):
            return x, y
    return a.flat[0], b.flat[0]
