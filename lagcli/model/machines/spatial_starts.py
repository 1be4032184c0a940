"""Start of a machine in space: bodies placed along the joints, from the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from lagcli.model.machines.frames import Basis
from lagcli.model.machines.starts import Machine, SingleJoint
from lagcli.model.names.draft import Draft
from lagcli.model.sections.coordinates import KINDS
from lagcli.model.yaml.source import Scalar

Array = Any
#: Size of rounding errors: parts of a guess that are smaller become 0, as a tiny number would be
#: taken for the size of its coordinate.
_NOISE = 1e-14
_PARTS = KINDS["quaternion"].parts
#: Largest fraction of the trace of J by which a moment of inertia may exceed the sum of the others.
_ROUNDING = 1e-9


class SpatialPose(NamedTuple):
    """Where a body in space is: its center of mass (3,), and its rotation (3, 3)."""

    r: Array
    R: Array

    def at(self, local: tuple[float, ...]) -> Array:
        """Return the place of a point of the body."""
        return self.r + self.R @ np.array(local)


def rotation(axis: Array, angle: float) -> Array:
    """Return the rotation about a unit vector by an angle, (3, 3)."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * skew + (1 - math.cos(angle)) * (skew @ skew)


def quaternion(R: Array) -> Array:
    """Return the unit quaternion of a rotation, (4,), its largest component positive."""
    (a, b, c), (d, e, f), (g, h, i) = R
    outer = np.array(
        [
            [1 + a + e + i, h - f, c - g, d - b],
            [h - f, 1 + a - e - i, b + d, c + g],
            [c - g, b + d, 1 - a + e - i, f + h],
            [d - b, c + g, f + h, 1 - a - e + i],
        ]
    )  # 4 e eᵀ: the row with the largest diagonal entry is the most exact
    row = outer[int(np.argmax(np.diag(outer)))]
    return row / np.linalg.norm(row)


def matrix(e: Array) -> Array:
    """Return the rotation of a quaternion, (3, 3), of any length but 0."""
    a, b, c, d = e / np.linalg.norm(e)
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    )


def _columns(basis: Basis) -> Array:
    return np.array(basis).T


class SpatialMachine(Machine):
    """Bodies and joints of a file in space, when their rows are written."""

    origin: Any = SpatialPose(np.zeros(3), np.eye(3))
    placing = (
        *("spherical", "revolute", "cylindrical", "prismatic", "universal", "planar", "fixed"),
        *("screw", "rolling", "rod"),
    )
    example = ("r: [0, 0, 0]", "e: 1")

    def _guess(
        self, name: str, place: Scalar, poses: Mapping[str, Any], values: Mapping[str, float]
    ) -> None:
        """Write the guess for a coordinate, and that for its velocity.

        A body's point and quaternion are written whole where the file gives no part of them.
        """
        stem, _, part = name.rpartition(".")
        body, _, vector = stem.rpartition(".")
        if body not in poses or vector not in ("r", "e"):
            guess = self._angles.get(name)
            value = self._between(stem, part, poses) if guess is None else guess
            for target, number in ((name, value), (f"{name}'", 0.0)):
                if target not in values:
                    self.written.guess(target, _number(number), place)
            return
        parts = ("x", "y", "z") if vector == "r" else _PARTS
        pose = poses[body]
        numbers = pose.r if vector == "r" else quaternion(pose.R)
        numbers = np.where(abs(numbers) < _NOISE * abs(numbers).max(), 0.0, numbers)
        for primes, every in (("", list(map(_number, numbers))), ("'", ["0"] * len(parts))):
            given = [f"{stem}.{p}{primes}" in values for p in parts]
            if not any(given):
                if part == parts[0]:
                    text = "0" if primes else f"[{', '.join(every)}]"
                    self.written.guess(f"{stem}{primes}", text, place)
            elif f"{name}{primes}" not in values:
                self.written.guess(f"{name}{primes}", every[parts.index(part)], place)

    def _placed(self, values: Mapping[str, float]) -> dict[str, Any]:
        try:
            self._angles = self._joint_values()
        except ValueError:
            self._angles = {}
        return super()._placed(values)

    def _given_pose(self, name: str, start: Any, values: Mapping[str, float]) -> Any:
        r = [values.get(f"{name}.r.{c}", x) for c, x in zip("xyz", start.r, strict=True)]
        e = [values.get(f"{name}.e.{c}") for c in _PARTS]
        R = start.R if None in e or not any(e) else matrix(np.array(e))
        return SpatialPose(np.array(r), R)

    def _next(
        self,
        link: SingleJoint,
        poses: Mapping[str, Any],
        forward: bool,
        values: Mapping[str, float],
        given: Mapping[str, float],
    ) -> Any:
        """Return the pose of a body beside one that is placed."""
        joint, name = link.joint, link.names[int(forward)]
        placed = poses[link.names[1 - int(forward)]]
        kind = joint.kind.name
        position = given.get(f"{link.name}.position", 0.0)
        angle = given.get(f"{link.name}.angle", 0.0)
        relative, offset = np.eye(3), np.zeros(3)  # R_Aᵀ R_B, and d in A's frame
        if joint.axes:
            first, second = map(_columns, joint.axes)
            if kind not in ("universal", "rolling") and (angle or joint.axes[0] != joint.axes[1]):
                relative = first @ rotation((1.0, 0.0, 0.0), angle) @ second.T
            offset = first[:, 0] * position
        if kind == "screw":
            pitch = self.number(joint.size, link.indices)
            offset = np.array(joint.axes[0].u) * (pitch * angle / math.tau)
        elif kind == "rod":
            length = self._value(joint.keys["length"][1], link.indices) or 0.0
            offset = np.array([length, 0.0, 0.0])
        given_e = [values.get(f"{name}.e.{c}") for c in _PARTS]
        R = placed.R @ (relative if forward else relative.T)
        if None not in given_e and any(given_e):
            R = matrix(np.array(given_e))
        p, q = link.points
        if kind == "rolling":
            normal = (placed.R if forward else R) @ np.array(joint.axes[0].u)
            axis = (R if forward else placed.R) @ np.array(joint.axes[1].u)
            radius = self.number(joint.size, link.indices)
            offset = normal * radius * math.sqrt(max(0.0, 1 - float(axis @ normal) ** 2))
        elif kind != "rod":
            offset = (placed.R if forward else R) @ offset
        if forward:
            return SpatialPose(placed.at(p) + offset - R @ np.array(q), R)
        return SpatialPose(placed.at(q) - offset - R @ np.array(p), R)

    def _between(self, stem: str, part: str, poses: Mapping[str, Any]) -> float:
        """Return the coordinate of a joint between placed bodies."""
        try:
            link = next(x for x in self._links() if x.name == stem)
            one, two = (poses[name] for name in link.names)
        except (ValueError, KeyError, StopIteration):
            return 0.0
        if not link.joint.axes:
            return 0.0
        first, second = (one.R @ _columns(link.joint.axes[0]), two.R @ _columns(link.joint.axes[1]))
        if part == "position":
            return float(first[:, 0] @ (two.at(link.points[1]) - one.at(link.points[0])))
        angle = math.atan2(first[:, 2] @ second[:, 1], first[:, 1] @ second[:, 1])
        return angle if abs(angle) > _NOISE else 0.0

    def _check(self, draft: Draft, poses: Mapping[str, Any], values: Mapping[str, float]) -> None:
        super()._check(draft, poses, values)
        for body in self.bodies:
            key = body.key
            for indices in self._span(key.index, key.span) if body.turns else ():
                own = self._name(key.base, key.index or key.span, indices) if key.span else key.base
                self._check_inertia(draft, own, key.node)

        for link in self._links():
            if all(n == "ground" or f"{n}.e.0" in values for n in link.names) and link.joint.axes:
                self._check_rotation(draft, link, poses)

    def _check_rotation(self, draft: Draft, link: SingleJoint, poses: Mapping[str, Any]) -> None:
        """Report bodies that are given the other way round: the rows hold for these as well."""
        joint = link.joint
        if joint.kind.name in ("universal", "rolling"):
            return
        first, second = (
            poses[n].R @ _columns(axes) for n, axes in zip(link.names, joint.axes, strict=True)
        )
        if joint.kind.name == "prismatic":
            opposite = float(np.trace(first.T @ second)) < 1  # beyond a quarter turn
        else:
            opposite = float(first[:, 0] @ second[:, 0]) < 0
        angle = self._angles.get(f"{link.name}.angle")
        if not opposite and angle is not None:
            opposite = math.cos(angle - self._between(link.name, "angle", poses)) < 0
        if opposite:
            draft.report.add(
                "contradiction",
                f"the rotations of `{link.names[0]}` and `{link.names[1]}` under `initial` contradict"
                f" {joint.title}: its axis is reversed, or its angle is another half turn",
                joint.key.node.location,
                "give the rotation of one of the two, or the angle of the joint alone; the other"
                " body is placed by the joint",
            )

    def _check_inertia(self, draft: Draft, name: str, place: Scalar) -> None:
        """Report moments of inertia that no body has: one above the sum of the others."""
        found = {
            part.removeprefix(f"{name}.inertia."): p
            for part, p in draft.parameters.items()
            if part.startswith(f"{name}.inertia.")
        }
        J = np.zeros((3, 3))
        for part, parameter in found.items():
            i, j = "xyz".index(part[0]), "xyz".index(part[-1])
            J[i, j] = parameter.value
        shown = f"the inertia of `{place.value}`"
        location = next((p.location for p in found.values() if p.location), place.location)
        if not np.allclose(J, J.T, rtol=_ROUNDING, atol=0):
            draft.report.add(
                "wrong-value",
                f"{shown} is not a symmetric matrix",
                location,
                "give the products of inertia −∫ x y dm on both sides of the diagonal",
            )
            return
        moments = np.linalg.eigvalsh(J)
        if moments[0] < -_ROUNDING * abs(moments).max():
            draft.report.add(
                "wrong-value",
                f"{shown} has the negative principal moment {moments[0]:.6g} kg·m² (SI)",
                location,
                "moments of inertia about the center of mass are positive",
            )
        elif moments[0] + moments[1] < moments[2] * (1 - _ROUNDING):
            draft.report.add(
                "wrong-value",
                f"{shown} has the principal moments {', '.join(f'{x:.6g}' for x in moments)}"
                " (SI), of which one exceeds the sum of the others",
                location,
                "no body has such moments: A + B ≥ C about any point; check the units, and that"
                " they are given about the center of mass",
            )


def _number(value: float) -> str:
    return repr(float(value) + 0.0).removesuffix(".0")
