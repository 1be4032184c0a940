"""Start of a machine: bodies placed along the joints, from the ground."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import symengine as se

from lagcli.model.diagnostics import Broken, Diagnostics
from lagcli.model.expression.grammar import parse
from lagcli.model.expression.tokens import ExpressionError
from lagcli.model.machines.bodies import Bodies, Body
from lagcli.model.machines.joints import Joints
from lagcli.model.machines.kind import MachineJoint
from lagcli.model.machines.references import Reference, read_key
from lagcli.model.machines.written import MachineEntries
from lagcli.model.model import TIME
from lagcli.model.names.draft import Draft, Formula, Parsed, QuantityValue, read_quantity
from lagcli.model.names.expansion import expand
from lagcli.model.names.namespace import Allowed
from lagcli.model.sections.initial import canonical_name, given_values, guess_or
from lagcli.model.sections.parameters import override_node
from lagcli.model.yaml.source import Derived, Scalar, YamlNode
from lagcli.model.yaml.source import Mapping as MappingNode

Point = tuple[float, ...]
#: Kinds of joints that determine where the second body is, given the first.
_PLACING = ("revolute", "fixed", "prismatic", "slot", "rod")


class Pose(NamedTuple):
    """Where a body is: its center of mass, and its angle."""

    x: float
    y: float
    angle: float

    def at(self, local: Point) -> Point:
        """Return the place of a point of the body."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return self.x + c * local[0] - s * local[1], self.y + s * local[0] + c * local[1]


class SingleJoint(NamedTuple):
    """A joint between two single bodies."""

    joint: MachineJoint
    names: tuple[str, str]
    points: tuple[Point, Point]
    indices: Mapping[str, int]
    name: str


class Machine:
    """Bodies and joints of a file, when their rows are written.

    Parameters
    ----------
    written : MachineEntries
    bodies : Bodies
    joints : Joints
    """

    origin: Any = Pose(0.0, 0.0, 0.0)
    placing: tuple[str, ...] = _PLACING
    #: Initial values that place a body, after its name.
    example = ("x: 0", "y: 0")

    def __init__(self, written: MachineEntries, bodies: Bodies, joints: Joints):
        self.written, self.bodies, self.joints = written, bodies, joints
        self.draft: Draft = written.draft
        node = self.draft.get("initial")
        self.given = list(node) if isinstance(node, MappingNode) else []
        self.own = {b.key.base for b in bodies} | set(joints.by_base)

    def place(self, draft: Draft, overrides: Mapping[str, object]) -> None:
        """Add guesses for the bodies' coordinates and velocities that the file does not give.

        Each body is placed by its joint to one that is placed, from the ground. The joint's
        coordinate is that of `initial`, a drive's at t = 0, or 0. ``overrides`` replace values
        of `initial`.
        """
        self.draft = draft
        draft.names.placing = set()
        report, draft.report = draft.report, Diagnostics([])
        try:  # the sections report errors in the values that are used here
            values = {n: x.value for n, x in given_values(draft).items()}
            values |= self._overriding(overrides)
            poses = self._placed(values)
        finally:
            draft.report = report
        self._check(draft, poses, values)
        for name in draft.names.coordinates:
            base = re.split(r"[.\[]", name)[0]
            if base in self.own and "." in name:
                self._guess(name, self._place_of(base), poses, values)
        added = self.written.blocks["initial"]
        if added:
            place = next(iter(added.values()))[0]
            key, node = draft.root.entries.get("initial") or (
                Derived("initial", place.location, place),
                place,
            )
            if isinstance(node, MappingNode) or (
                isinstance(node, Scalar) and (node is place or node.missing)
            ):
                own = node.entries if isinstance(node, MappingNode) else {}
                entries = {**own, **{n: e for n, e in added.items() if n not in own}}
                made = MappingNode(node.source, node.start, node.end, entries)
                draft.root.entries["initial"] = (key, made)

    def _guess(
        self, name: str, place: Scalar, poses: Mapping[str, Any], values: Mapping[str, float]
    ) -> None:
        """Write the guesses for a coordinate and its velocity, where the file gives no values."""
        stem, _, part = name.rpartition(".")
        pose = poses.get(stem, self.origin)
        guess = {"x": pose.x, "y": pose.y, "phi": pose.angle}.get(part)
        if guess is None:
            guess = self._between(stem, part, poses)
        for target, value in ((name, guess), (f"{name}'", 0.0)):
            if target not in values:
                self.written.guess(target, repr(value).removesuffix(".0"), place)

    def _overriding(self, overrides: Mapping[str, object]) -> dict[str, float]:
        """Return the values of coordinates that options give; `read_initial` reports others."""
        found = {}
        for option, value in overrides.items():
            name = canonical_name(self.draft, "".join(option.split()))
            node = guess_or(override_node("--set-initial", option, value))
            if isinstance(node, MappingNode):
                node = node.entries["guess"][1]
            number = self._value(node, {}) if name is not None else None
            if name is not None and number is not None:
                found[name] = number
        return found

    def _place_of(self, base: str) -> Scalar:
        if base in self.bodies.by_base:
            return self.bodies.by_base[base][0].key.node
        return self.joints.by_base[base].key.node

    # values

    def number(self, text: str, indices: Mapping[str, int]) -> float:
        """Return the value of an expression of parameters and time, at t = 0.

        Raises
        ------
        ValueError
            It has none.
        """
        draft = self.draft
        node = Derived(text, draft.source.location(0, 0), draft.root)
        try:
            tree = expand(parse(text), draft.names)
            formula = Formula(draft, Parsed(node, tree), "", Allowed.MOTION, tuple(indices))
            value = formula.scalar(indices)
        except (ExpressionError, Broken):
            value = None
        if value is None:
            raise ValueError(text)
        if draft.names.placing is not None:
            draft.names.placing |= {str(s) for s in value.free_symbols} & draft.parameters.keys()
        known = {TIME: 0}
        known |= {se.Symbol(n): p.value for n, p in draft.parameters.items()}
        try:
            return float(value.subs(known))
        except (RuntimeError, TypeError, ValueError):
            raise ValueError(text) from None

    def _point(self, text: tuple[str, ...], indices: Mapping[str, int]) -> Point:
        return tuple(self.number(component, indices) for component in text)

    def _span(self, key_index: str, span: str) -> Iterator[dict[str, int]]:
        """Yield the values of the index of a family; one empty mapping for a single name."""
        if not key_index:
            yield {}
            return
        first, _, last = span.partition("..")
        for k in range(int(self.number(first, {})), int(self.number(last, {})) + 1):
            yield {key_index: k}

    def _name(self, base: str, index: str, indices: Mapping[str, int]) -> str:
        return f"{base}[{round(self.number(index, indices))}]" if index else base

    def _links(self) -> Iterator[SingleJoint]:
        for joint in self.joints.by_base.values():
            if joint.kind.name not in self.placing:
                continue
            key = joint.key
            for indices in self._span(key.index, key.span):
                sides = []
                for reference, body in zip((joint.first, joint.second), joint.bodies, strict=True):
                    name = self._name(reference.base, reference.index[1:-1], indices)
                    local = self._local(reference, body, name)
                    sides.append((name, local))
                own = key.base
                if key.index or key.span:
                    own = self._name(key.base, key.index or key.span, indices)
                (one, p), (two, q) = sides
                yield SingleJoint(joint, (one, two), (p, q), indices, own)

    def _local(self, reference: Reference, body: Body, name: str) -> Point:
        if not reference.point:
            return (0.0,) * self.bodies.dimension
        found = [b for b in self.bodies.by_base[reference.base] if reference.point in b.points]
        body = body if reference.point in body.points else found[0]
        indices = {}
        if body.key.index:
            indices = {body.key.index: int(name[name.index("[") + 1 : -1])}
        return self._point(body.points[reference.point], indices)

    # placing

    def _placed(self, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the poses of the bodies that joints and values determine."""
        poses = {"ground": self.origin}
        try:
            links = list(self._links())
            given = self._joint_values()
        except ValueError:
            return poses
        depth = {"ground": 0}  # joints between a body and the ground
        while True:
            ready = [x for x in links if (x.names[0] in poses) != (x.names[1] in poses)]
            if not ready:
                break
            link = min(
                ready,
                key=lambda x: (
                    x.joint.kind.name == "rod",
                    min(depth.get(n, len(links)) for n in x.names),
                ),
            )
            forward = link.names[0] in poses
            name = link.names[int(forward)]
            depth[name] = depth[link.names[1 - int(forward)]] + 1
            try:
                poses[name] = self._next(link, poses, forward, values, given)
            except ValueError:
                poses[name] = self.origin
        for body in self.bodies:
            try:
                every = list(self._span(body.key.index, body.key.span))
            except ValueError:
                continue
            for indices in every:
                name = body.key.base
                if body.key.span:
                    name = self._name(name, body.key.index or body.key.span, indices)
                poses[name] = self._given_pose(name, poses.get(name, self.origin), values)
        return poses

    def _given_pose(self, name: str, start: Any, values: Mapping[str, float]) -> Any:
        """Return the pose of a body, with the values that the file gives."""
        x, y, phi = (values.get(f"{name}.{c}") for c in ("x", "y", "phi"))
        return Pose(
            start.x if x is None else x,
            start.y if y is None else y,
            start.angle if phi is None else phi,
        )

    def _joint_values(self) -> dict[str, float]:
        """Return the given coordinates of joints, and those of drives at t = 0."""
        found: dict[str, float] = {}
        for joint in self.joints.by_base.values():
            if joint.kind.name == "drive" and "speed" not in joint.keys:
                part = "angle" if "angle" in joint.keys else "position"
                for indices in self._span(joint.key.index, joint.key.span):
                    text = joint.keys[part][1]
                    assert isinstance(text, Scalar)
                    own, index = joint.first.base, joint.first.index[1:-1]
                    name = f"{self._name(own, index, indices)}.{part}"
                    value = self._value(text, indices)
                    if value is not None:
                        found[name] = value
        for name, key, node in self.given:
            stem, _, part = name.strip().rpartition(".")
            read = read_key(Derived(stem, key.location, key), "i_") if part else None
            named = self.joints.by_base.get(read.base) if read else None
            if read is None or named is None or part not in named.quantities:
                continue
            value_node: YamlNode = node
            if isinstance(node, MappingNode) and "guess" in node.entries:
                value_node = node.entries["guess"][1]
            for indices in self._span(read.index, read.span):
                own = read.base
                if read.span:
                    own = self._name(own, read.index or read.span, indices)
                value = self._value(value_node, indices)
                if value is not None:
                    found[f"{own}.{part}"] = value
        return found

    def _value(self, node: YamlNode, indices: Mapping[str, int]) -> float | None:
        quantity = read_quantity(self.draft, node, "")
        if quantity is None:
            return None
        if quantity.number is None and isinstance(node, Scalar):
            try:
                return self.number(node.value, indices) * float(quantity.factor)
            except ValueError:
                return None
        return QuantityValue(self.draft, quantity, "").number()

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
        sign = 1 if forward else -1
        kind, q = joint.kind.name, given.get(f"{link.name}.{joint.quantity}", 0.0)
        turn = q if kind == "revolute" else 0.0
        if kind in ("fixed", "prismatic") and "angle" in joint.keys:
            turn = self.number(f"{link.name}.angle", {})
        angle = values.get(f"{name}.phi", placed.angle + sign * turn)
        own, other = link.points if not forward else link.points[::-1]
        at = placed.at(other)
        if kind in ("prismatic", "slot"):
            frame = placed.angle if forward else angle
            x, y = (self.number(d, link.indices) for d in joint.direction)
            c, s = math.cos(frame), math.sin(frame)
            at = (at[0] + sign * q * (c * x - s * y), at[1] + sign * q * (s * x + c * y))
        elif kind == "rod":
            node = joint.keys["length"][1]
            at = (at[0] + sign * (self._value(node, link.indices) or 0.0), at[1])
        dx, dy = Pose(0.0, 0.0, angle).at(own)
        return Pose(at[0] - dx, at[1] - dy, angle)

    def _between(self, stem: str, part: str, poses: Mapping[str, Any]) -> float:
        """Return the coordinate of a joint between placed bodies."""
        try:
            link = next(x for x in self._links() if x.name == stem)
            one, two = (poses[name] for name in link.names)
            if part == "angle":
                return two.angle - one.angle
            p, q = one.at(link.points[0]), two.at(link.points[1])
            x, y = (self.number(d, link.indices) for d in link.joint.direction)
            c, s = math.cos(one.angle), math.sin(one.angle)
            return (q[0] - p[0]) * (c * x - s * y) + (q[1] - p[1]) * (s * x + c * y)
        except (ValueError, KeyError, StopIteration):
            return 0.0

    # checks

    def _check(self, draft: Draft, poses: Mapping[str, Any], values: Mapping[str, float]) -> None:
        """Report bodies that nothing holds, stops in wrong order, and wheels that do not meet."""
        held = {"ground"}
        joints = [j for j in self.joints.by_base.values() if j.kind.connects == "bodies"]
        pairs = [(j.first.base, j.second.base) for j in joints]
        started = {re.split(r"[.\[]", n)[0] for n in values}
        held |= started & set(self.bodies.by_base)
        grown = True
        while grown:
            grown = False
            for pair in pairs:
                if held.intersection(pair) and not held.issuperset(pair):
                    held |= set(pair)
                    grown = True
        for body in self.bodies:
            if body.key.base not in held:
                shown = body.key.node.value
                draft.report.add(
                    "missing-initial",
                    f"no joint connects the body `{shown}` with the ground, and it has no initial"
                    " values",
                    body.key.node.location,
                    "add a joint, or values such as `initial: {"
                    + ", ".join(f"{body.key.name}.{value}" for value in self.example)
                    + "}`",
                )
        for joint in self.joints.by_base.values():
            self._check_stops(draft, joint)
            if joint.kind.name == "gear":
                self._check_centers(draft, joint)

    def _check_stops(self, draft: Draft, joint: MachineJoint) -> None:
        if not {"min", "max"} <= joint.keys.keys() or joint.key.index:
            return
        ends = [draft.parameters.get(f"{joint.key.name}.{end}") for end in ("min", "max")]
        least, most = (0.0 if p is None else p.value for p in ends)
        if least > most:
            draft.report.add(
                "contradiction",
                f"{joint.title} has min = {least:g} above max = {most:g} (SI)",
                joint.keys["min"][0].location,
                "exchange the two",
            )

    def _check_centers(self, draft: Draft, joint: MachineJoint) -> None:
        """Report wheels with fixed centers whose distance is not that of the radii."""
        centers = []
        for reference in (joint.first, joint.second):
            pins = [x for x in self._pins() if reference.name in (x.first.name, x.second.name)]
            if reference.base == "ground":
                centers.append(("ground", self._local(reference, joint.bodies[0], "ground")))
                continue
            if len(pins) != 1 or reference.index:
                return
            (pin,) = pins
            outer = pin.first if pin.second.name == reference.name else pin.second
            body = pin.bodies[0] if outer is pin.first else pin.bodies[1]
            try:
                centers.append((outer.name, self._local(outer, body, outer.name)))
            except ValueError:
                return
        (one, p), (two, q) = centers
        radii = [draft.parameters.get(f"{joint.key.name}.radii.{k}") for k in ("first", "second")]
        if one != two or joint.key.index or None in radii:
            return
        first, second = (r.value for r in radii if r is not None)
        inner = "inner" in joint.keys and joint.keys["inner"][1].what == "`true`"
        wanted = abs(first - second) if inner else first + second
        distance = math.dist(p, q)
        if abs(distance - wanted) > 1e-6 * max(first, second):
            said = "difference" if inner else "sum"
            draft.report.add(
                "contradiction",
                f"the centers of {joint.title} are {distance:.6g} m apart, but the {said} of its"
                f" radii is {wanted:.6g} m",
                joint.key.node.location,
                "move a center, or change a radius"
                + ("" if inner else "; a wheel inside a ring has `inner=true`"),
            )

    def _pins(self) -> list[MachineJoint]:
        return [j for j in self.joints.by_base.values() if j.kind.name == "revolute"]
