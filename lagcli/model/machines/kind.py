"""What a kind of joint or coupling is, and what it writes its rows with."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from lagcli.model.machines.references import Key, Reference, is_quantity, items_of
from lagcli.model.machines.written import MachineEntries
from lagcli.model.yaml.source import Scalar, YamlNode

if TYPE_CHECKING:
    from lagcli.model.machines.bodies import Body
    from lagcli.model.machines.frames import Basis

Nodes = Mapping[str, tuple[Scalar, YamlNode]]
#: The time as a factor of a unit, where it is read as tons: ``60 rpm*t``.
_TIME = re.compile(r"\*\s*t\b")


@dataclass(eq=False)
class MachineJoint:
    """A joint of two bodies, or a coupling of joints, while it is written.

    Parameters
    ----------
    key : Key
    kind : JointKind
    keys : mapping of str to (Scalar, YamlNode)
        Its keys, with their values.
    written : MachineEntries
    first, second : Reference
        The bodies; of a coupling the joints.
    bodies : tuple of Body
    joints : tuple of MachineJoint
    quantity : str
        ``angle`` or ``position``: its coordinate q is `NAME.angle`.
    quantities : list of str
        Both, of a cylindrical joint; of others none or `quantity`.
    rows : list of str
        Names of its constraints, which those of its multipliers begin with.
    axes : pair of Basis
        In space: its axes in the frames of the bodies.
    measured : bool
        In space: whether its angle is used, and thus a coordinate of the model.
    size : str
        In space: the pitch of a screw, or the radius of a disc that rolls.
    """

    key: Key
    kind: JointKind
    keys: Nodes
    written: MachineEntries
    first: Reference
    second: Reference
    bodies: tuple[Body, ...] = ()
    joints: tuple[MachineJoint, ...] = ()
    quantity: str = ""
    quantities: list[str] = field(default_factory=list)
    rows: list[str] = field(default_factory=list)
    inlined: list[Scalar] = field(default_factory=list)
    direction: tuple[str, str] = ("0", "0")
    axes: tuple[Basis, Basis] = ()  # type: ignore[assignment]
    measured: bool = False
    size: str = "0"

    @property
    def title(self) -> str:
        """The joint in messages."""
        return f"the {self.kind.what} `{self.key.node.value}`"

    def fault(self, kind: str, message: str, help_: str, node: YamlNode | None = None) -> None:
        """Report an error of this joint."""
        self.written.report.add(kind, message, (node or self.key.node).location, help_)

    # values

    def given(self, name: str) -> YamlNode | None:
        """Return the value of a key."""
        return self.keys[name][1] if name in self.keys else None

    def required(self, name: str, example: str) -> YamlNode | None:
        """Return the value of a key; report that it is missing."""
        node = self.given(name)
        if node is None:
            self.fault(
                "missing-value",
                f"{self.title} has no `{name}`",
                f"give `{name}`, as in `{example}`",
            )
        return node

    def number(self, name: str, node: YamlNode) -> str:
        """Return a number of the joint, which becomes the parameter `JOINT.name`."""
        return self.written.parameter(self.key, name, node)

    def expression(self, name: str, node: YamlNode) -> str:
        """Return a value that may depend on time and on the motion; the whole side of an equation.

        In a product it needs parentheses.
        """
        if isinstance(node, Scalar) and is_quantity(node.value) and _TIME.search(node.value):
            self.fault(
                "units",
                f"{self.title} gives `{name}` as `{node.value}`, whose `t` is the unit ton",
                "a number with a unit is no factor of a product; write it as a parameter,"
                f" `parameters: {{n: 60 rpm}}` and `{name}: n*t`",
                node,
            )
        text, inlined = self.written.value(self.key, name, node)
        self.inlined += inlined
        return text

    # geometry

    def angle(self, side: int) -> str:
        """Return the angle of a body."""
        reference, body = (self.first, self.second)[side], self.bodies[side]
        if body.fixed:
            return "0"
        if not body.turns:
            self.fault(
                "missing-value",
                f"{self.title} turns the body `{reference.name}`, which has no inertia",
                f"write `{reference.base}: {{mass: …, inertia: 0.02 kg*m^2}}`, or the `length` of a"
                " rod",
            )
        return f"{reference.name}.phi"

    def point(self, side: int) -> str:
        """Return the vector to the point of a body, or to its center of mass."""
        reference, body = (self.first, self.second)[side], self.bodies[side]
        if reference.point:
            return f"{reference.name}.{reference.point}"
        return body.center(reference.name)

    def distance(self) -> str:
        """Return the vector from the first point to the second."""
        first, second = self.point(0), self.point(1)
        return second if first in ("[0, 0]", "[0, 0, 0]") else f"{second} - {first}"

    def speed(self, side: int) -> str:
        """Return the velocity of the point of a body; empty for the ground."""
        reference, body = (self.first, self.second)[side], self.bodies[side]
        if body.fixed:
            return ""
        if reference.point:
            return f"{reference.name}.{reference.point}'"
        return body.velocity(reference.name)

    def rotation(self, side: int) -> str:
        """Return the rotation of a body in space; empty for the ground."""
        reference, body = (self.first, self.second)[side], self.bodies[side]
        if body.fixed:
            return ""
        if not body.turns:
            self.fault(
                "missing-value",
                f"{self.title} turns the body `{reference.name}`, which has no inertia",
                f"write `{reference.base}: {{mass: …, inertia: [0.02, 0.03, 0.04]}}`, or a `shape`",
            )
        return f"{reference.name}.e"

    def approach(self) -> str:
        """Return the velocity of the second point minus that of the first; empty if both rest."""
        first, second = self.speed(0), self.speed(1)
        return f"{second} - {first}" if first and second else second or (first and f"-{first}")

    def along(self, side: int = 0) -> tuple[str, str] | None:
        """Return the unit vectors along `along` and at right angles to it, in the fixed frame.

        `along` is given in the frame of a body: a letter, a vector, or an angle.
        """
        node = self.required("along", "along=x")
        if node is None:
            return None
        angle = self.angle(side) if not self.bodies[side].fixed else ""
        letter = node.value.strip() if isinstance(node, Scalar) else ""
        items = items_of(node)
        if letter in ("x", "y"):
            self.direction = ("1", "0") if letter == "x" else ("0", "1")
            axes = (f"cos({angle})", f"sin({angle})") if angle else ("1", "0")
            return _axes(*axes, turned=letter == "y")
        if items is not None and len(items) == 2:
            x, y = (self.number(f"along.{a}", v) for a, v in zip("xy", items, strict=True))
            if (x, y) == ("0", "0"):
                self.fault("wrong-value", f"`along` of {self.title} is 0", "give a direction", node)
                return None
            norm = f"sqrt({x}^2 + {y}^2)"
            self.direction = (f"{x}/{norm}", f"{y}/{norm}")
            if not angle:
                return _axes(*self.direction)
            cos, sin = f"cos({angle})", f"sin({angle})"
            return _axes(f"({x}*{cos} - {y}*{sin})/{norm}", f"({x}*{sin} + {y}*{cos})/{norm}")
        if items is not None or not isinstance(node, Scalar):
            self.fault(
                "shape",
                f"`along` of {self.title} must be a direction in the plane, not {node.what}",
                "write x, y, a vector such as [1, 2], or an angle such as 30 deg",
                node,
            )
            return None
        own = self.number("along", node)
        self.direction = (f"cos({own})", f"sin({own})")
        whole = f"{angle} + {own}" if angle else own
        return _axes(f"cos({whole})", f"sin({whole})")

    # rows

    def row(self, suffix: str, equation: str, **fields: str) -> None:
        """Write a constraint of the joint, `JOINT` or `JOINT.suffix`."""
        name = f"{self.key.declared}.{suffix}" if suffix else self.key.declared
        self.rows.append(name)
        self.written.constraint(name, equation, self.key.node, fields, self.inlined)

    def coordinate(self, quantity: str, text: str) -> None:
        """Define the joint's coordinate q, `JOINT.angle` or `JOINT.position`."""
        self.quantity = quantity
        self.quantities.append(quantity)
        self.written.add(
            "definitions", f"{self.key.declared}.{quantity}", text, self.key.node, self.inlined
        )

    def free(self, quantity: str) -> None:
        """Declare the joint's coordinate q as one of the model."""
        self.quantity = quantity
        self.quantities.append(quantity)
        declared = f"{self.key.declared}.{quantity}"
        self.written.add(
            "coordinates", declared, "rad" if quantity == "angle" else "m", self.key.node
        )

    @property
    def q(self) -> str:
        """The joint's coordinate in expressions."""
        return f"{self.key.name}.{self.quantity}"


def _axes(x: str, y: str, turned: bool = False) -> tuple[str, str]:
    """Return a unit vector and that at a right angle to it."""
    one = f"[{x}, {y}]"
    two = f"[{_negative(y)}, {x}]"
    return (two, f"[{_negative(x)}, {_negative(y)}]") if turned else (one, two)


def _negative(text: str) -> str:
    return "0" if text == "0" else f"-{text}"


class JointKind(NamedTuple):
    """A kind of joint or coupling.

    Parameters
    ----------
    name : str
    connects : str
        ``bodies``, ``joints``, or ``joint`` for one joint.
    write : callable
        Writes the rows of a MachineJoint.
    keys : tuple of str
        Keys of this kind alone.
    movable : bool
        Whether its coordinate may have a spring, a damper, a stop.
    example, rows, multipliers : str
        For the documentation.
    dimension : int
        That of the space in which the kind exists; 2 also for couplings of joints, in both.
    """

    name: str
    connects: str
    write: Callable[[MachineJoint], None]
    keys: tuple[str, ...]
    movable: bool
    example: str
    rows: str
    multipliers: str
    dimension: int = 2

    @property
    def what(self) -> str:
        """The noun in messages."""
        return "joint" if self.connects == "bodies" and self.movable else self.name
