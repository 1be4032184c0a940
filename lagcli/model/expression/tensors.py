"""Values of expressions: scalars, vectors, matrices and rotations with SymEngine entries."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import symengine as se
from symengine import Basic

from lagcli.model.expression.algebra import constant_value, is_zero, terms_cancel
from lagcli.model.expression.constants import cases, number
from lagcli.model.expression.functions import KINKS, kinks_of

Rows = tuple[tuple[Basic, ...], ...]
Derivative = Callable[[Basic], Basic]


class ShapeError(ValueError):
    """Incompatible shapes.

    Parameters
    ----------
    message : str
    help : str, optional
    """

    def __init__(self, message: str, help: str | None = None):
        super().__init__(message)
        self.help = help


class Tensor(NamedTuple):
    """A matrix; a vector is a matrix with one column.

    Parameters
    ----------
    rows : tuple of tuples of expressions
    factors : tuple of RotationFactor
        Factors of a rotation or of a product of 3×3 matrices. `omega` uses them to obtain the
        angular velocity without matrix products.
    """

    rows: Rows
    factors: tuple[RotationFactor, ...] = ()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Tensor) and self.rows == other.rows

    def __hash__(self) -> int:
        return hash(self.rows)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return len(self.rows), len(self.rows[0])

    @property
    def is_vector(self) -> bool:
        """Whether the matrix has one column."""
        return self.shape[1] == 1

    @property
    def is_rotation(self) -> bool:
        """Whether the matrix is a rotation; see `RotationFactor.is_rotation`."""
        if self.shape != (3, 3):
            return False
        return all(turn.is_rotation for turn in self.factors or (RotationFactor(self.rows),))

    @property
    def entries(self) -> tuple[Basic, ...]:
        """All entries, row by row."""
        return tuple(x for row in self.rows for x in row)

    @property
    def kind(self) -> str:
        """Description for messages."""
        m, n = self.shape
        return f"a vector of {m}" if n == 1 else f"a {m}×{n} matrix"

    def map(self, function: Callable[[Basic], Basic]) -> Tensor:
        """Apply a function to each entry."""
        return Tensor(tuple(tuple(function(x) for x in row) for row in self.rows))


Value: TypeAlias = "Basic | Tensor"


class Sized(NamedTuple):
    """A value with its size, nesting depth and order of derivative.

    Parameters
    ----------
    value : expression, vector or matrix
    size : int
        Number of operations when fully expanded.
    depth : int
        Nesting depth of functions, powers and products.
    constant : bool
        Whether it contains no symbols.
    order : int
        Highest derivative of a coordinate in it; negative without coordinates.
    """

    value: Value
    size: int = 1
    depth: int = 0
    constant: bool = False
    order: int = -1


class RotationFactor(NamedTuple):
    """Factor of a product of rotations.

    Parameters
    ----------
    rows : 3 rows of 3 expressions
    parameters : tuple of expressions
        (angle,) for a rotation about a constant axis, (e0, e1, e2, e3) for a quaternion, () for a
        matrix given by its entries.
    axis : tuple of 3 expressions, or None
        Unit vector of the axis.
    """

    rows: Rows
    parameters: tuple[Basic, ...] = ()
    axis: tuple[Basic, ...] | None = None

    def inverse(self) -> RotationFactor:
        """Return the inverse rotation."""
        rows = tuple(zip(*self.rows, strict=True))
        if self.axis is not None:
            return RotationFactor(rows, (-self.parameters[0],), self.axis)
        return RotationFactor(rows, (*self.parameters[:1], *[-e for e in self.parameters[1:]]))

    def quaternion(self) -> tuple[Basic, ...]:
        """Return the unit quaternion of this rotation.

        Raises
        ------
        ShapeError
            The rotation is given by a matrix.
        """
        if not self.parameters:
            raise ShapeError(
                "the quaternion of a matrix is not known; write it with rot_x, rot_y, rot_z, rot or"
                " quat",
                self.remedy(),
            )
        if self.axis is None:
            return self.parameters
        half = self.parameters[0] / 2
        return (se.cos(half), *(n * se.sin(half) for n in self.axis))

    @property
    def is_rotation(self) -> bool:
        """Whether this is a rotation, RᵀR = 1 and det R = 1.

        A quaternion is assumed to be one: its normalization is a constraint of the model. A matrix
        is tested numerically at some points. Entries may be rounded to a double.
        """
        if self.parameters:
            return True
        columns = [Tensor(tuple((x,) for x in column)) for column in zip(*self.rows, strict=True)]
        x, y, z = columns
        pairs = [(x, x, 1), (y, y, 1), (z, z, 1), (x, y, 0), (y, z, 0), (cross(x, y), z, 1)]
        return all(_has_product(a, b, value) for a, b, value in pairs)

    def remedy(self) -> str | None:
        """Return what to write for a matrix of rounded numbers; None for any other."""
        if self.parameters:
            return None
        try:
            numbers = [[number(x) for x in row] for row in self.rows]
        except (ValueError, RuntimeError):
            return None  # it depends on names
        from lagcli.model.expression.rotations import quaternion_text

        text = quaternion_text(numbers)
        return text and f"write the rotation nearest to the matrix: `{text}`"

    def rate(self, derivative: Derivative) -> tuple[Basic, ...]:
        """Return the body-frame angular velocity of this rotation."""
        if not self.parameters:
            return _from_matrix(self.rows, derivative)
        if self.axis is not None:
            rate = derivative(self.parameters[0])
            return tuple(n * rate for n in self.axis)
        e0, e1, e2, e3 = self.parameters
        d0, d1, d2, d3 = (derivative(e) for e in self.parameters)
        return (
            2 * (e0 * d1 - e1 * d0 - e2 * d3 + e3 * d2),
            2 * (e0 * d2 - e2 * d0 - e3 * d1 + e1 * d3),
            2 * (e0 * d3 - e3 * d0 - e1 * d2 + e2 * d1),
        )


def _has_product(a: Tensor, b: Tensor, value: int) -> bool:
    """Whether two vectors have a scalar product, within rounding of its terms."""
    if any(isinstance(x, KINKS) for v in (a, b) for e in v.entries for x in kinks_of(e)):
        return is_zero(dot(a, b) - value)
    terms = [x * y for x, y in zip(a.entries, b.entries, strict=True)]
    return terms_cancel([*terms, se.Integer(-value)])


def rotation_remedy(value: Basic | Tensor) -> str | None:
    """Return what to write for a matrix that is a rotation but for rounding; None for any other."""
    if not isinstance(value, Tensor) or value.shape != (3, 3):
        return None
    factors = value.factors or (RotationFactor(value.rows),)
    return next((x.remedy() for x in factors if not x.is_rotation), None)


def vector(*entries: Basic) -> Tensor:
    """Return a column vector."""
    return Tensor(tuple((x,) for x in entries))


def diagonal(*entries: Basic) -> Tensor:
    """Return a diagonal matrix."""
    zero = se.Integer(0)
    size = range(len(entries))
    return Tensor(tuple(tuple(entries[i] if i == j else zero for j in size) for i in size))


def component(a: Tensor, key: str, indices: tuple[int, ...]) -> Basic:
    """Return a component of a vector or matrix.

    Parameters
    ----------
    a : Tensor
    key : str
        x, y or z of a vector; 0 to 3 of the quaternion of a rotation; empty with indices.
    indices : tuple of int
        From 1: of a vector, or the row and column of a matrix.
    """
    if key and key in "0123":
        if a.shape != (3, 3):
            raise ShapeError(f"`.{key}` belongs to the quaternion of a rotation, not to {a.kind}")
        return quaternion_of(a)[int(key)]
    if key:
        indices = ("xyz".index(key) + 1,)
    if len(indices) != (1 if a.is_vector else 2):
        example = "`[2]` or `.y`" if a.is_vector else "row and column, as in `[2, 3]`"
        raise ShapeError(f"a component of {a.kind} is given by {example}")
    for index, size in zip(indices, a.shape, strict=False):
        if not 1 <= index <= size:
            name = f".{key}" if key else f"number {index}"
            raise ShapeError(f"{a.kind} has no component {name}")
    return a.rows[indices[0] - 1][indices[1] - 1 if len(indices) > 1 else 0]


def quaternion_of(a: Tensor) -> tuple[Basic, ...]:
    """Return the quaternion of a product of rotations about constant axes and quaternions."""
    total: tuple[Basic, ...] = tuple(map(se.Integer, (1, 0, 0, 0)))
    for turn in a.factors or (RotationFactor(a.rows),):
        total = _hamilton_product(total, turn.quaternion())
    return total


def _hamilton_product(a: tuple[Basic, ...], b: tuple[Basic, ...]) -> tuple[Basic, ...]:
    (a0, a1, a2, a3), (b0, b1, b2, b3) = a, b
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
        a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
    )


def kind_of(value: Basic | Tensor) -> str:
    """Return a description of a value for messages."""
    return value.kind if isinstance(value, Tensor) else "a scalar"


def choose(condition: Basic, a: Basic | Tensor, b: Basic | Tensor) -> Basic | Tensor:
    """Return a, entry by entry, where a condition holds, else b."""
    if not (isinstance(a, Tensor) or isinstance(b, Tensor)):
        return cases(condition, a, b)
    if not (isinstance(a, Tensor) and isinstance(b, Tensor) and a.shape == b.shape):
        raise ShapeError(
            f"the cases of if() must be of the same kind, not {kind_of(a)} and {kind_of(b)}"
        )
    return Tensor(
        tuple(
            tuple(cases(condition, x, y) for x, y in zip(r, s, strict=True))
            for r, s in zip(a.rows, b.rows, strict=True)
        )
    )


def add(a: Tensor, b: Tensor, sign: int = 1) -> Tensor:
    """Return a ± b."""
    if a.shape != b.shape:
        raise ShapeError(f"{a.kind} and {b.kind} cannot be added")
    return Tensor(
        tuple(
            tuple(x + sign * y for x, y in zip(r, s, strict=True))
            for r, s in zip(a.rows, b.rows, strict=True)
        )
    )


def multiply(a: Tensor, b: Tensor) -> Tensor:
    """Return the matrix product."""
    if a.is_vector and b.is_vector:
        raise ShapeError(f"{a.kind} times {b.kind} is ambiguous: use dot(a, b) or cross(a, b)")
    if a.shape[1] != b.shape[0]:
        raise ShapeError(f"{a.kind} cannot be multiplied by {b.kind}")
    columns = list(zip(*b.rows, strict=True))
    rows = tuple(
        tuple(se.Add(*[x * y for x, y in zip(row, column, strict=True)]) for column in columns)
        for row in a.rows
    )
    factors = _factors(a) + _factors(b) if a.shape == b.shape == (3, 3) else ()
    return Tensor(rows, factors)


def _factors(a: Tensor) -> tuple[RotationFactor, ...]:
    return a.factors or (RotationFactor(a.rows),)


def transpose(a: Tensor) -> Tensor:
    """Return aᵀ."""
    rows = tuple(tuple(column) for column in zip(*a.rows, strict=True))
    return Tensor(rows, tuple(f.inverse() for f in reversed(a.factors)))


def dot(a: Tensor, b: Tensor) -> Basic:
    """Return the scalar product of two vectors."""
    if not (a.is_vector and b.is_vector and a.shape == b.shape):
        raise ShapeError(f"dot needs two vectors of equal length, not {a.kind} and {b.kind}")
    return se.Add(*[x * y for x, y in zip(a.entries, b.entries, strict=True)])


def cross(a: Tensor, b: Tensor) -> Tensor:
    """Return the cross product of two 3-vectors."""
    if a.shape != (3, 1) or b.shape != (3, 1):
        raise ShapeError(f"cross needs two vectors of 3, not {a.kind} and {b.kind}")
    (a1, a2, a3), (b1, b2, b3) = a.entries, b.entries
    return vector(a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1)


def axial(a: Tensor) -> Tensor:
    """Return the axial vector of the antisymmetric part of a 3×3 matrix: sin α n of a rotation."""
    if a.shape != (3, 3):
        raise ShapeError(f"axial needs a 3×3 matrix, not {a.kind}")
    return vector(*_axial(a.rows))


def _axial(rows: Rows) -> tuple[Basic, ...]:
    half = se.Rational(1, 2)
    return (
        half * (rows[2][1] - rows[1][2]),
        half * (rows[0][2] - rows[2][0]),
        half * (rows[1][0] - rows[0][1]),
    )


def norm(a: Tensor) -> Basic:
    """Return the Euclidean norm of a vector."""
    return se.sqrt(dot(a, a))


def rotation(axis: Tensor, angle: Basic) -> Tensor:
    """Return the rotation about a constant axis (normalized here) by an angle (Rodrigues)."""
    if axis.shape != (3, 1):
        raise ShapeError(f"the axis of a rotation must be a vector of 3, not {axis.kind}")
    square = dot(axis, axis)
    length = se.sqrt(constant_value(square) or square)  # [sin(a), 0, cos(a)] has the length 1
    x, y, z = n = tuple(e / length for e in axis.entries)
    s, c = se.sin(angle), se.cos(angle)
    u = 1 - c
    rows = (
        (c + x * x * u, x * y * u - z * s, x * z * u + y * s),
        (y * x * u + z * s, c + y * y * u, y * z * u - x * s),
        (z * x * u - y * s, z * y * u + x * s, c + z * z * u),
    )
    # for a coordinate axis, x*x*(1 - c) + c simplifies to 1
    shown = tuple(tuple(se.expand(e) for e in r) for r in rows)
    return Tensor(shown, (RotationFactor(shown, (angle,), n),))


def quaternion(e0: Basic, e1: Basic, e2: Basic, e3: Basic) -> Tensor:
    """Return the rotation of a unit quaternion (e0 is the scalar part)."""
    rows = (
        (e0**2 + e1**2 - e2**2 - e3**2, 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)),
        (2 * (e1 * e2 + e0 * e3), e0**2 - e1**2 + e2**2 - e3**2, 2 * (e2 * e3 - e0 * e1)),
        (2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), e0**2 - e1**2 - e2**2 + e3**2),
    )
    return Tensor(rows, (RotationFactor(rows, (e0, e1, e2, e3)),))


def angular_velocity(r: Tensor, derivative: Derivative) -> Tensor:
    """Return the body-frame angular velocity ω of a rotation R: RᵀṘ = ω×.

    For R = R₁R₂…: ω = R₂ᵀω₁ + ω₂, evaluated from left to right.
    """
    if r.shape != (3, 3):
        raise ShapeError(f"omega needs a rotation (a 3×3 matrix), not {r.kind}")
    if len(r.factors) < 2 or not r.is_rotation:
        single = r.factors[0] if len(r.factors) == 1 else RotationFactor(r.rows)
        return vector(*single.rate(derivative))
    first, *others = r.factors
    omega = vector(*first.rate(derivative))
    for turn in others:
        turned = multiply(transpose(Tensor(turn.rows)), omega)
        omega = add(turned, vector(*turn.rate(derivative)))
    return omega


def _from_matrix(rows: Rows, derivative: Derivative) -> tuple[Basic, ...]:
    """Return ω of a rotation given by its matrix."""
    r = Tensor(rows)
    return _axial(multiply(transpose(r), r.map(derivative)).rows)
