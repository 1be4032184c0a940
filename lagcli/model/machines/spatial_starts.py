"""Start of a machine in space: bodies placed along the joints, from the ground."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from lagcli.model.machines import rotations
from lagcli.model.machines.frames import Vector, dot
from lagcli.model.machines.rotations import IDENTITY, Matrix, applied, plus, product, transposed
from lagcli.model.machines.starts import Machine, SingleJoint
from lagcli.model.names.draft import Draft
from lagcli.model.sections.coordinates import KINDS
from lagcli.model.yaml.source import Scalar

#: Size of rounding errors: parts of a guess that are smaller become 0, as a tiny number would be
#: taken for the size of its coordinate.
_NOISE = 1e-14
_PARTS = KINDS["quaternion"].parts
#: Relative rounding error of moments of inertia.
_ROUNDING = 1e-9
_ZERO = (0.0, 0.0, 0.0)


class SpatialPose(NamedTuple):
    """Where a body in space is: its center of mass, and its rotation."""

    r: Vector
    R: Matrix

    def at(self, local: tuple[float, ...]) -> Vector:
        """Return the place of a point of the body."""
        return plus(self.r, applied(self.R, local))


class SpatialMachine(Machine):
    """Bodies and joints of a file in space, when their rows are written."""

    origin: Any = SpatialPose(_ZERO, IDENTITY)
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
        numbers = pose.r if vector == "r" else rotations.quaternion(pose.R)
        least = _NOISE * max(map(abs, numbers))
        numbers = [0.0 if abs(x) < least else x for x in numbers]
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
        x, y, z = (values.get(f"{name}.r.{c}", r) for c, r in zip("xyz", start.r, strict=True))
        return SpatialPose((x, y, z), self._given_rotation(name, values) or start.R)

    def _given_rotation(self, name: str, values: Mapping[str, float]) -> Matrix | None:
        e = [values.get(f"{name}.e.{part}", math.nan) for part in _PARTS]
        return rotations.matrix(e) if any(e) and all(map(math.isfinite, e)) else None

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
        relative, offset = IDENTITY, _ZERO  # R_Aᵀ R_B, and d in A's frame
        if joint.axes:
            first, second = joint.axes
            if kind not in ("universal", "rolling") and (angle or first != second):
                turned = product(rotations.about_x(angle), second)
                relative = product(transposed(first), turned)
            if kind == "screw":
                position = self.number(joint.size, link.indices) * angle / math.tau
            offset = plus(_ZERO, first.u, position)
        elif kind == "rod":
            offset = (self._value(joint.keys["length"][1], link.indices) or 0.0, 0.0, 0.0)
        R = product(placed.R, relative if forward else transposed(relative))
        R = self._given_rotation(name, values) or R
        one, two = (placed.R, R) if forward else (R, placed.R)
        p, q = link.points
        if kind == "rolling":
            normal, axis = applied(one, joint.axes[0].u), applied(two, joint.axes[1].u)
            sine = math.sqrt(max(0.0, 1 - dot(axis, normal) ** 2))
            offset = plus(_ZERO, normal, self.number(joint.size, link.indices) * sine)
        elif kind != "rod":
            offset = applied(one, offset)
        if forward:
            return SpatialPose(plus(plus(placed.at(p), offset), applied(R, q), -1), R)
        return SpatialPose(plus(plus(placed.at(q), offset, -1), applied(R, p), -1), R)

    def _axes(self, link: SingleJoint, poses: Mapping[str, Any]) -> tuple[Matrix, Matrix]:
        """Return the axes u, v, w of a joint on both bodies, as rows in the fixed frame."""
        one, two = (
            product(axes, transposed(poses[name].R))
            for name, axes in zip(link.names, link.joint.axes, strict=True)
        )
        return one, two

    def _between(self, stem: str, part: str, poses: Mapping[str, Any]) -> float:
        """Return the coordinate of a joint between placed bodies."""
        try:
            link = next(x for x in self._links() if x.name == stem)
            first, second = self._axes(link, poses)
        except (ValueError, KeyError, StopIteration):
            return 0.0
        if part == "position":
            one, two = (poses[n].at(p) for n, p in zip(link.names, link.points, strict=True))
            return dot(first[0], plus(two, one, -1))
        angle = math.atan2(dot(first[2], second[1]), dot(first[1], second[1]))
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
        first, second = self._axes(link, poses)
        if joint.kind.name == "prismatic":
            trace = sum(dot(one, two) for one, two in zip(first, second, strict=True))
            opposite = trace < 1  # 1 + 2 cos of the angle between them
        else:
            opposite = dot(first[0], second[0]) < 0
        angle = self._angles.get(f"{link.name}.angle")
        if not opposite and angle is not None:
            opposite = math.cos(angle - self._between(link.name, "angle", poses)) < 0
        if opposite:
            draft.report.add(
                "contradiction",
                f"the rotations of `{link.names[0]}` and `{link.names[1]}` under `initial`"
                f" contradict {joint.title}: its axis is reversed, or its angle is another"
                " half turn",
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
        J = [[0.0] * 3 for _ in range(3)]
        for part, parameter in found.items():
            J["xyz".index(part[0])]["xyz".index(part[-1])] = parameter.value
        shown = f"the inertia of `{place.value}`"
        location = next((p.location for p in found.values() if p.location), place.location)
        if any(
            not math.isclose(J[i][j], J[j][i], rel_tol=_ROUNDING) for i in (0, 1) for j in (1, 2)
        ):
            draft.report.add(
                "wrong-value",
                f"{shown} is not a symmetric matrix",
                location,
                "give the products of inertia −∫ x y dm on both sides of the diagonal",
            )
            return
        moments = rotations.principal_moments((tuple(J[0]), tuple(J[1]), tuple(J[2])))  # type: ignore[arg-type]
        if moments[0] < -_ROUNDING * max(map(abs, moments)):
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
