"""Random mechanisms of rigid bodies in space, as text of lagcli models; and the same ones turned.

A body has its position and a quaternion. Joints are placed on the bodies where they stand at the
start, so that every loop closes there. Nothing here uses lagcli.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Joints, and the freedoms that each leaves.
FREEDOMS = {"revolute": 1, "universal": 2, "cylindrical": 2, "spherical": 3}
#: Closed loops of ground and three bodies that can move: freedoms of the joints sum up to 7 or 8.
LOOPS = (
    ("revolute", "spherical", "spherical", "revolute"),
    ("revolute", "spherical", "cylindrical", "revolute"),
    ("revolute", "universal", "spherical", "revolute"),
    ("revolute", "cylindrical", "cylindrical", "cylindrical"),
    ("revolute", "universal", "universal", "universal"),
)


def product(p: Array, q: Array) -> Array:
    """Return the product of two quaternions, scalar first."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])


def matrix(e: Array) -> Array:
    """Return the rotation matrix of a unit quaternion."""
    w, x, y, z = e
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def unit(x: Array) -> Array:
    """Return x over its length."""
    return np.asarray(x / np.linalg.norm(x))


def beside(axis: Array) -> tuple[Array, Array]:
    """Return two directions at right angles to an axis and to each other."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    one = unit(np.cross(axis, helper))
    return one, np.cross(axis, one)


@dataclass(frozen=True)
class Joint:
    """A joint between two bodies (−1: ground): a point and axes in space, at the start."""

    kind: str
    one: int
    other: int
    point: Array
    axis: Array
    second: Array  # the other axis of a universal joint
    redundant: bool = False


@dataclass(frozen=True)
class Mechanism:
    """Bodies at the start, their joints, and gravity.

    Parameters
    ----------
    position, quaternion : (n, 3) and (n, 4) arrays
    velocity, spin : (n, 3) arrays
        Guesses; the spin is that in space.
    mass : (n,) array
    inertia : (n, 3) array
        Principal, along the body's axes.
    joints : list of Joint
    gravity : (3,) array
    """

    position: Array
    quaternion: Array
    velocity: Array
    spin: Array
    mass: Array
    inertia: Array
    joints: list[Joint]
    gravity: Array

    def turned(self, e: Array) -> Mechanism:
        """Return the same mechanism in a space turned by a quaternion."""
        turn = matrix(e)
        return replace(
            self,
            position=self.position @ turn.T,
            quaternion=np.array([product(e, x) for x in self.quaternion]),
            velocity=self.velocity @ turn.T,
            spin=self.spin @ turn.T,
            gravity=turn @ self.gravity,
            joints=[
                replace(j, point=turn @ j.point, axis=turn @ j.axis, second=turn @ j.second)
                for j in self.joints
            ],
        )

    def text(self, t_end: float, samples: int) -> str:
        """Return the model."""
        bodies = range(len(self.mass))
        names = [f"{c}{i}" for i in bodies for c in ("x", "y", "z", "a", "b", "c", "d")]
        lines = ["name: mechanism", f"coordinates: [{', '.join(names)}]", "definitions:"]
        lines += ["  X: [1, 0, 0]", "  Y: [0, 1, 0]", "  Z: [0, 0, 1]"]
        for i in bodies:
            a, b, c = (repr(float(x)) for x in self.inertia[i])
            lines += [
                f"  r{i}: [x{i}, y{i}, z{i}]",
                f"  R{i}: quat(a{i}, b{i}, c{i}, d{i})",
                f"  w{i}: omega(R{i})",
                f'  J{i}: "[[{a}, 0, 0], [0, {b}, 0], [0, 0, {c}]]"',
            ]
        kinetic = " + ".join(
            f"{float(self.mass[i])!r}/2*dot(r{i}', r{i}') + 1/2*dot(w{i}, J{i}*w{i})"
            for i in bodies
        )
        gravity = _vector(self.gravity)
        potential = " - ".join(f"{float(self.mass[i])!r}*dot({gravity}, r{i})" for i in bodies)
        lines += [f"T: {kinetic}", f"V: 0 - {potential}", "constraints:"]
        lines += [f"  unit{i}: a{i}^2 + b{i}^2 + c{i}^2 + d{i}^2 = 1" for i in bodies]
        for k, joint in enumerate(self.joints):
            lines += [f"  j{k}_{n}: {x}" for n, x in enumerate(self._equations(joint))]
        lines.append("initial:")
        for i in bodies:
            e = self.quaternion[i]
            # the spin in space is 2 e' e⁻¹
            rate = 0.5 * product(np.array([0.0, *self.spin[i]]), e)
            state = (*self.position[i], *e), (*self.velocity[i], *rate)
            for name, x, v in zip(names[7 * i : 7 * i + 7], *state, strict=True):
                lines.append(f"  {name}: {{guess: {float(x)!r}}}")
                lines.append(f"  {name}': {{guess: {float(v)!r}}}")
        lines.append(f"simulation: {{t_end: {t_end}, samples: {samples}}}")
        return "\n".join(lines) + "\n"

    def _point(self, body: int, point: Array) -> str:
        if body < 0:
            return _vector(point)
        local = matrix(self.quaternion[body]).T @ (point - self.position[body])
        return f"(r{body} + R{body}*{_vector(local)})"

    def _axis(self, body: int, axis: Array) -> str:
        if body < 0:
            return _vector(axis)
        return f"R{body}*{_vector(matrix(self.quaternion[body]).T @ axis)}"

    def _equations(self, joint: Joint) -> list[str]:
        one, other, kind = joint.one, joint.other, joint.kind
        here, there = self._point(one, joint.point), self._point(other, joint.point)
        u, w = beside(joint.axis)
        if kind == "cylindrical":
            far = self._point(other, joint.point + 0.3 * joint.axis)
            found = [
                f"dot({self._axis(one, d)}, {p} - {here}) = 0" for d in (u, w) for p in (there, far)
            ]
        else:
            found = [f"dot({d}, {there}) = dot({d}, {here})" for d in "XYZ"]
        if kind == "revolute":
            found += [
                f"dot({self._axis(one, joint.axis)}, {self._axis(other, d)}) = 0" for d in (u, w)
            ]
        if kind == "universal":
            found.append(
                f"dot({self._axis(one, joint.axis)}, {self._axis(other, joint.second)}) = 0"
            )
        if joint.redundant and kind in ("revolute", "cylindrical"):
            # the same said the other way round, and by a second hinge on the axis
            point = joint.point + 0.7 * joint.axis
            here, there = self._point(one, point), self._point(other, point)
            found += [
                f"dot({self._axis(other, joint.axis)}, {self._axis(one, d)}) = 0" for d in (u, w)
            ]
            if kind == "revolute":
                found += [f"dot({d}, {there}) = dot({d}, {here})" for d in "XYZ"]
        return found


def _vector(x: Array) -> str:
    return "[" + ", ".join(repr(float(c)) for c in x) + "]"


def random_mechanism(seed: int) -> Mechanism:
    """Return a mechanism: a chain, or a closed loop; along the frame's axes, or not."""
    random = np.random.default_rng(seed)
    along = bool(random.integers(2))  # along the frame's axes
    closed = bool(random.integers(2))

    def direction() -> Array:
        if along:
            return np.eye(3)[random.integers(3)] * random.choice([-1.0, 1.0])
        return unit(random.normal(size=3))

    def orientation() -> Array:
        if along:  # half and quarter turns about the frame's axes
            angle = random.choice([0.0, np.pi / 2, np.pi])
            axis = np.eye(3)[random.integers(3)]
            return np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
        return unit(random.normal(size=4))

    planar = closed and bool(random.integers(2))
    axis = direction()
    if planar:  # a four-bar linkage in space: three of its conditions are redundant
        u, w = beside(axis)
        base = random.uniform(1.2, 1.6)
        ends = [(0.0, 0.0), (0.0, 0.5), (base, random.uniform(0.9, 1.2)), (base, 0.0)]
        points = [a * u + b * w for a, b in ends]
        kinds, axes = ("revolute",) * 4, [axis] * 4
    else:
        kinds = LOOPS[random.integers(len(LOOPS))] if closed else ()
        count = 4 if closed else int(random.integers(1, 4))
        kinds = kinds or tuple(random.choice(list(FREEDOMS), size=count))
        if along and not closed:  # every link along an axis of the frame
            step = [direction() * random.uniform(0.5, 1.0) for _ in range(count)]
        else:  # a loop in special places may not move, or begin in a singular configuration
            step = [random.normal(size=3) * 0.6 for _ in range(count)]
        if closed and "spherical" not in kinds:
            along = False  # nor may one with special axes
        points = list(np.cumsum([np.zeros(3), *step], axis=0)[:count])
        axes = [direction() for _ in range(count)]
    bodies = 3 if closed else len(kinds)
    joints = []
    for k, kind in enumerate(kinds):
        second = beside(axes[k])[0]
        redundant = bool(random.integers(2)) and not planar
        other = -1 if closed and k == 3 else k
        joints.append(Joint(kind, k - 1, other, points[k], axes[k], second, redundant))
    after = [*points[1:], points[-1] + direction() * 0.8]
    centre = np.array([(points[i] + after[i]) / 2 for i in range(bodies)])
    if not planar:  # off the line, so that gravity has a lever
        centre = centre + np.array([0.2 * direction() for _ in range(bodies)])
    small = random.uniform(0.5, 1.0, size=(bodies, 3))
    return Mechanism(
        position=centre,
        quaternion=np.array([orientation() for _ in range(bodies)]),
        velocity=np.zeros((bodies, 3)),
        spin=random.normal(size=(bodies, 3)) * random.integers(2),
        mass=random.uniform(0.5, 2.0, size=bodies),
        inertia=0.05 * small,
        joints=joints,
        gravity=np.array([1.7, -2.9, -9.2]),  # along no axis: what can move does
    )
