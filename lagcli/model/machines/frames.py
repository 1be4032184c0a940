"""Axes of joints in space: u, with v and w that complete it to a right-handed frame."""

from __future__ import annotations

import math
from typing import NamedTuple

from lagcli.model.machines.kind import MachineJoint
from lagcli.model.machines.references import items_of
from lagcli.model.yaml.source import Scalar, YamlNode

Vector = tuple[float, float, float]
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_LETTERS = {"x": _X, "y": _Y, "z": _Z}
_EXAMPLE = "write `axis=z`, a vector such as `axis=[0, 0.6, 0.8]`, or both: `axis=[x, [0, 0, 1]]`"
#: Sine of the largest angle between vectors that count as parallel, or as at right angles.
_ANGLE = 1e-9


class Basis(NamedTuple):
    """The axes u, v, w of a joint in the frame of a body; unit vectors."""

    u: Vector
    v: Vector
    w: Vector


def dot(one: Vector, two: Vector) -> float:
    """Return the scalar product."""
    return math.fsum(x * y for x, y in zip(one, two, strict=True))


def cross(one: Vector, two: Vector) -> Vector:
    """Return the vector product."""
    (a, b, c), (x, y, z) = one, two
    return b * z - c * y, c * x - a * z, a * y - b * x


def completed(axis: Vector) -> Basis:
    """Return u along an axis, and v and w: for x, y and z the other two axes, cyclic.

    For an oblique u, v is along u × e, where e is the axis least along u, and w = u × v.
    """
    axes = (_X, _Y, _Z)
    norm = math.hypot(*axis)
    u = (axis[0] / norm, axis[1] / norm, axis[2] / norm)
    if u in axes:
        k = axes.index(u)
        return Basis(u, axes[(k + 1) % 3], axes[(k + 2) % 3])
    least = min(range(3), key=lambda i: abs(u[i]))
    v = cross(u, axes[least])
    size = math.hypot(*v)
    v = (v[0] / size, v[1] / size, v[2] / size)
    return Basis(u, v, cross(u, v))


def read_axes(joint: MachineJoint, name: str = "axis") -> tuple[Basis, Basis] | None:
    """Return the axes of a joint in the frames of its two bodies; report what is none."""
    node = joint.required(name, f"{name}=z")
    if node is None:
        return None
    items = items_of(node)
    if items is not None and len(items) == 2:
        pair = [_axis(joint, name, item) for item in items]
        return None if None in pair else (completed(pair[0]), completed(pair[1]))  # type: ignore[arg-type]
    one = _axis(joint, name, node)
    return None if one is None else (completed(one), completed(one))


def _axis(joint: MachineJoint, name: str, node: YamlNode) -> Vector | None:
    if isinstance(node, Scalar):
        text = node.value.strip()
        sign = -1.0 if text.startswith("-") else 1.0
        if text.removeprefix("-") in _LETTERS:
            x, y, z = _LETTERS[text.removeprefix("-")]
            return (x, y, z) if sign > 0 else (0.0 - x, 0.0 - y, 0.0 - z)
    items = items_of(node)
    if items is None or len(items) != 3:
        given = node.what if items is None else f"a list of {len(items)}"
        joint.fault("shape", f"the `{name}` of {joint.title} is {given}", _EXAMPLE, node)
        return None
    numbers = []
    for item in items:
        try:
            numbers.append(float(item.value) if isinstance(item, Scalar) else math.nan)
        except ValueError:
            numbers.append(math.nan)
    if not all(map(math.isfinite, numbers)):
        item = items[[math.isfinite(x) for x in numbers].index(False)]
        joint.fault(
            "wrong-value",
            f"a component of the `{name}` of {joint.title} is {item.what}, not a number",
            f"give three numbers, of any length: {_EXAMPLE}",
            item,
        )
        return None
    if not any(numbers):
        joint.fault(
            "wrong-value", f"the `{name}` of {joint.title} is the zero vector", _EXAMPLE, node
        )
        return None
    return numbers[0], numbers[1], numbers[2]


def right_angle(one: Vector, two: Vector) -> bool:
    """Whether two unit vectors are at right angles."""
    return abs(dot(one, two)) < _ANGLE


def written(vector: Vector) -> str:
    """Return a vector of numbers in the language of models."""
    return "[" + ", ".join(repr(x + 0.0).removesuffix(".0") for x in vector) + "]"


def on_body(joint: MachineJoint, side: int, vector: Vector) -> str:
    """Return a direction that is fixed in a body, in the fixed frame."""
    rotation = joint.rotation(side)
    return f"{rotation}*{written(vector)}" if rotation else written(vector)


def equal_rotations(joint: MachineJoint) -> str:
    """Return the equation of two bodies that do not turn relative to each other."""
    second, first = (joint.rotation(side) or "rot_x(0)" for side in (1, 0))
    return f"{second} = {first}"


def moments(joint: MachineJoint) -> None:
    """Write the rows that keep the axes of the bodies parallel, and that of the angle if used.

    λ are the moments about v and w of the first body, and about u.
    """
    first, second = joint.axes
    v, w = on_body(joint, 0, first.v), on_body(joint, 0, first.w)
    u = on_body(joint, 1, second.u)
    joint.row("Mv", f"-dot({w}, {u}) = 0")
    joint.row("Mw", f"dot({v}, {u}) = 0")
    if joint.measured:
        joint.free("angle")
        q, turned = f"{joint.key.name}.angle", on_body(joint, 1, second.v)
        joint.row("Mu", f"cos({q})*dot({w}, {turned}) - sin({q})*dot({v}, {turned}) = 0")
