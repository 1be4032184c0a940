"""Joints, couplings and drives of a file: their rows, and what acts on their coordinates."""

from __future__ import annotations

import re
from collections.abc import Iterable

from lagcli.model.machines.bodies import GROUND, NOT_NAMES, Bodies
from lagcli.model.machines.kind import JointKind, MachineJoint, Nodes
from lagcli.model.machines.references import JointCall, Key, read_call, read_key, read_reference
from lagcli.model.machines.registry import KINDS, OF_COORDINATE
from lagcli.model.machines.written import MachineEntries
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping, Scalar, YamlNode

_NOT_JOINTS = (*NOT_NAMES, GROUND)


class Joints:
    """The joints of a file.

    Parameters
    ----------
    written : MachineEntries
    bodies : Bodies
    fixed : collection of str
        Coordinates of joints with a fixed initial value: ``O.angle``. They become coordinates of
        the model, unless they are the angle of a body on a fixed pin.
    """

    def __init__(self, written: MachineEntries, bodies: Bodies, fixed: Iterable[str]):
        self.written, self.bodies, self.report = written, bodies, written.report
        self.fixed = set(fixed)
        self.kinds = KINDS[bodies.dimension]
        self.by_base: dict[str, MachineJoint] = {}
        self.moved: set[str] = set()
        self.driven: dict[str, MachineJoint] = {}

    def read(self, node: Mapping) -> None:
        """Read the entries of `joints`, and write their rows."""
        calls: list[tuple[Key, JointCall]] = []
        for name, key_node, value in node:
            key = read_key(key_node, self.bodies.free_index)
            if key is None or key.base in _NOT_JOINTS:
                self.report.add(
                    "bad-name",
                    f"`{shorten(name)}` cannot be the name of a joint",
                    key_node.location,
                    "a name is a letter followed by letters, digits and _; a family of joints is"
                    " `J[i = 2..N]`",
                )
                continue
            if key.base in self.bodies.by_base:
                other = self.bodies.by_base[key.base][0].key.node
                self.report.add(
                    "duplicate-name",
                    f"`{key.base}` is declared twice: as a body and as a joint",
                    key_node.location,
                    "rename one of the two",
                    (("the body is declared here", other.location),),
                )
                continue
            call = self._call(key, value)
            if call is not None:
                calls.append((key, call))
        couplings = [c for _, c in calls if self.kinds[c.kind].connects != "bodies"]
        moved = (read_reference(x) for call in couplings for x in call.arguments)
        self.moved = {reference.base for reference in moved if reference is not None}
        for key, call in sorted(calls, key=lambda c: self.kinds[c[1].kind].connects != "bodies"):
            joint = self._joint(key, call, self.kinds[call.kind])
            if joint is not None:
                self.by_base[key.base] = joint
                joint.kind.write(joint)
                self._acting(joint)

    def _call(self, key: Key, value: YamlNode) -> JointCall | None:
        dimension = self.bodies.dimension
        elsewhere = KINDS[5 - dimension]
        call = read_call(value, {**elsewhere, **self.kinds})
        what = f"the joint `{key.node.value}`"
        kinds = ", ".join(f"`{k}`" for k in self.kinds)
        if isinstance(call, str):
            self.report.add(
                "wrong-type",
                f"{what} {call}",
                value.location,
                f"write `{key.node.value}: revolute(ground.O, crank.a)`, or"
                f" `{{revolute: [ground.O, crank.a]}}`; the kinds are {kinds}",
            )
            return None
        if call.kind not in self.kinds and call.kind in elsewhere:
            self.report.add(
                "unknown-kind",
                f"{what} is of the kind `{call.kind}`, which exists "
                + ("in space only" if dimension == 2 else "in a plane only"),
                call.kind_node.location,
                "this machine is planar: write `dimension: 3`, and points of three components"
                if dimension == 2
                else f"the kinds in space are {kinds}",
            )
            return None
        if call.kind not in self.kinds:
            self.report.add(
                "unknown-kind",
                f"there is no joint of the kind `{shorten(call.kind)}`",
                call.kind_node.location,
                did_you_mean(nearest(call.kind, list(self.kinds), 1)) or f"the kinds are {kinds}",
            )
            return None
        kind = self.kinds[call.kind]
        wanted = 1 if kind.connects == "joint" else 2
        if len(call.arguments) != wanted:
            self.report.add(
                "wrong-arguments",
                f"{what} connects {wanted} {kind.connects}, not {len(call.arguments)}",
                call.kind_node.location,
                f"write `{kind.example}`",
            )
            return None
        known = (*kind.keys, *(OF_COORDINATE if kind.movable else ()))
        for name, (node, _) in call.keys.items():
            if name not in known:
                self.report.add(
                    "unknown-key",
                    f"a joint of the kind `{kind.name}` has no key `{shorten(name)}`",
                    node.location,
                    did_you_mean(nearest(name, list(known), 1))
                    or ("its keys are " + ", ".join(known) if known else f"write `{kind.example}`"),
                )
                return None
        return call

    def _joint(self, key: Key, call: JointCall, kind: JointKind) -> MachineJoint | None:
        references = [read_reference(node) for node in call.arguments]
        what = f"the joint `{key.node.value}`"
        for reference, node in zip(references, call.arguments, strict=True):
            if reference is None:
                self.report.add(
                    "bad-name",
                    f"{what} names `{shorten(node.value)}`, which is not a name",
                    node.location,
                    f"write `{kind.example}`",
                )
        known = [r for r in references if r is not None]
        if len(known) < len(references):
            return None
        joint = MachineJoint(key, kind, call.keys, self.written, known[0], known[-1])
        if kind.connects == "bodies":
            found = [self.bodies.find(r, what) for r in known]
            if None in found:
                return None
            joint.bodies = tuple(b for b in found if b is not None)
            joint.measured = self._measured(joint)
            if known[0].name == known[1].name:
                joint.fault(
                    "contradiction",
                    f"{what} connects `{known[0].name}` with itself",
                    "connect two different bodies",
                    call.arguments[1],
                )
                return None
            return joint
        joint.joints = tuple(j for r in known if (j := self._moved(r, what)) is not None)
        if len(joint.joints) < len(known):
            return None
        if kind.name == "drive":
            return joint if self._drives(joint) else None
        return joint

    def _measured(self, joint: MachineJoint) -> bool:
        """Whether a drive, a key of the joint or an expression of the file uses its angle."""
        base = joint.key.base
        used = rf"(?<![\w.]){re.escape(base)}\s*(\[[^\]]*\])?\s*\.angle(?!\w)"
        return (
            base in self.moved
            or any(key in joint.keys for key in (*OF_COORDINATE, "angle"))
            or re.search(used, self.written.draft.source.text) is not None
        )

    def _moved(self, reference: object, what: str) -> MachineJoint | None:
        """Return the joint whose coordinate a coupling moves; report others."""
        base, node = reference.base, reference.node  # type: ignore[attr-defined]
        joint = self.by_base.get(base)
        if joint is None:
            self.report.add(
                "unknown-name",
                f"{what} names the joint `{base}`, which is not declared",
                node.location,
                did_you_mean(nearest(base, list(self.by_base)))
                or "name a joint of this file with an angle or a position",
            )
        elif not joint.quantity:
            self.report.add(
                "contradiction",
                f"{what} moves `{base}`, a joint of the kind `{joint.kind.name}`, which has no"
                " angle and no position",
                node.location,
                "move a revolute or a prismatic joint",
            )
            return None
        return joint

    def _drives(self, joint: MachineJoint) -> bool:
        """Return whether a drive moves a joint that nothing else drives; report others."""
        (driven,) = joint.joints
        name = joint.first.name
        moved = next((k for k in driven.quantities if k in joint.keys), driven.quantity)
        other = self.driven.setdefault(f"{name}.{moved}", joint)
        if other is not joint:
            self.report.add(
                "contradiction",
                f"the joint `{name}` has two drives, `{other.key.node.value}` and"
                f" `{joint.key.node.value}`",
                joint.key.node.location,
                "remove one of them",
                (("the first one is here", other.key.node.location),),
            )
            return False
        acting = driven.keys
        if driven.kind.name == "cylindrical":
            nested = driven.given(moved)
            acting = nested.entries if isinstance(nested, Mapping) else {}
        for key in ("torque", "force"):
            if key in acting:
                node = acting[key][0]
                self.report.add(
                    "contradiction",
                    f"the joint `{name}` has a `{key}` and the drive `{joint.key.node.value}`,"
                    " which determines it",
                    node.location,
                    f"remove one of them; the {key} of the drive is `lambda.{joint.key.name}`",
                )
                return False
        return True

    def _acting(self, joint: MachineJoint) -> None:
        """Write what acts on the coordinates of a joint: springs, dampers, torques, stops."""
        if joint.kind.name != "cylindrical":
            self._acting_on(joint, joint.quantity, joint.keys, "")
        for quantity in joint.quantities if joint.kind.name == "cylindrical" else ():
            node = joint.given(quantity)
            if node is None:
                self._explicit(joint, quantity)
                continue
            what = f"`{quantity}` of {joint.title}"
            example = f"write `{quantity}: {{damping: 2}}`"
            mapping = self.written.draft.mapping(node, what, example)
            if mapping is not None:
                self.written.draft.fields(mapping, what, OF_COORDINATE)
                known = {n: e for n, e in mapping.entries.items() if n in OF_COORDINATE}
                self._acting_on(joint, quantity, known, f"{quantity}.")

    def _acting_on(self, joint: MachineJoint, quantity: str, keys: Nodes, prefix: str) -> None:
        written, key = self.written, joint.key
        used = [k for k in OF_COORDINATE if k in keys and k not in joint.kind.keys]
        if not quantity:
            if used and joint.kind.movable:
                joint.fault(
                    "contradiction",
                    f"{joint.title} has no angle for its `{used[0]}`: it is on a point mass",
                    "give the body an `inertia`",
                    keys[used[0]][0],
                )
            return
        q = f"{key.name}.{quantity}"
        action = "torque" if quantity == "angle" else "force"
        wrong = "force" if action == "torque" else "torque"
        if wrong in keys:
            joint.fault(
                "unknown-key",
                f"{joint.title} has an {quantity}, on which no {wrong} acts"
                if quantity == "angle"
                else f"{joint.title} has a {quantity}, on which no {wrong} acts",
                f"write `{action}`",
                keys[wrong][0],
            )
            return
        values = {k: joint.number(prefix + k, keys[k][1]) for k in used if k != action}
        for name, needs in (("rest", "stiffness"), ("restitution", "min")):
            if name in values and needs not in values and not (name != "rest" and "max" in values):
                joint.fault(
                    "missing-value",
                    f"{joint.title} has `{name}`, but no `{needs}`",
                    f"give `{needs}`, or remove `{name}`",
                    keys[name][0],
                )
        rate = f"{q}'"
        if "stiffness" in values:
            rest = values.get("rest", "0")
            turned = q if rest == "0" else f"({q} - {rest})"
            written.term("V", f"{values['stiffness']}/2*{turned}^2", key)
        if "damping" in values:
            written.term("D", f"{values['damping']}/2*{rate}^2", key)
        if "armature" in values:
            written.term("T", f"{values['armature']}/2*{rate}^2", key)
        declared = f"{key.declared}.{quantity}"
        if action in keys:
            text = joint.expression(prefix + action, keys[action][1])
            written.add("Q", declared, text, key.node, joint.inlined)
        if "friction" in values:
            joint.row(f"{prefix}friction", f"{rate} = 0", limit=values["friction"])
        impact = {"restitution": values["restitution"]} if "restitution" in values else {}
        for end, sign in (("min", ">="), ("max", "<=")):
            if end in values:
                joint.row(f"{prefix}{end}", f"{q} {sign} {values[end]}", **impact)
        self._explicit(joint, quantity)

    def _explicit(self, joint: MachineJoint, quantity: str) -> None:
        """Make a coordinate of the model of a joint's, where the start prescribes its value."""
        key = joint.key
        names = {f"{key.base}.{quantity}", f"{key.base}[].{quantity}"}
        if names.isdisjoint(self.fixed) or (pinned(joint) and not key.index):
            return
        declared = f"{key.declared}.{quantity}"
        if declared in self.written.blocks["coordinates"]:
            return
        place, node = self.written.blocks["definitions"].pop(declared)
        assert isinstance(node, Scalar)
        unit = "rad" if quantity == "angle" else "m"
        self.written.add("coordinates", declared, unit, place)
        joint.row("q", f"{node.value} = {key.name}.{quantity}")


def pinned(joint: MachineJoint) -> str | None:
    """Return the coordinate of a body that the angle of a pin on the ground is; else None."""
    planar = joint.kind.dimension == 2
    if planar and joint.kind.name == "revolute" and joint.bodies[0].fixed and joint.quantity:
        return f"{joint.second.name}.phi"
    return None
