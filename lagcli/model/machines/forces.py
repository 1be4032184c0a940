"""Forces between points of bodies: springs, actuators, and given forces and moments."""

from __future__ import annotations

from lagcli.model.machines.bodies import Bodies
from lagcli.model.machines.joints import Joints
from lagcli.model.machines.kind import JointKind, MachineJoint
from lagcli.model.machines.references import items_of, read_call, read_key, read_reference
from lagcli.model.machines.written import MachineEntries
from lagcli.model.spelling import did_you_mean, nearest, shorten
from lagcli.model.yaml.source import Mapping, YamlNode


def _spring(force: MachineJoint) -> None:
    _length(force)
    q, key, written = f"{force.key.name}.length", force.key, force.written
    stiffness, damping = force.given("stiffness"), force.given("damping")
    if stiffness is None and damping is None:
        force.required("stiffness", "stiffness=500 N/m")
    if stiffness is not None:
        node = force.given("length")
        rest = "0" if node is None else force.number("rest", node)
        stretched = q if rest == "0" else f"({q} - {rest})"
        written.term("V", f"{force.number('stiffness', stiffness)}/2*{stretched}^2", key)
    if damping is not None:
        written.term("D", f"{force.number('damping', damping)}/2*{q}'^2", key)


def _actuator(force: MachineJoint) -> None:
    _length(force)
    node = force.required("force", "force=200 N")
    if node is not None:
        text = force.expression("force", node)
        name = f"{force.key.declared}.length"
        force.written.add("Q", name, text, force.key.node, force.inlined)


def _length(force: MachineJoint) -> None:
    name = f"{force.key.declared}.length"
    force.written.add("definitions", name, f"norm({force.distance()})", force.key.node)


def _wrench(force: MachineJoint) -> None:
    written, key = force.written, force.key
    given = [k for k in ("force", "moment") if k in force.keys]
    if not given:
        force.required("force", "force=[0, -20 N]")
    if "force" in given:
        node = force.keys["force"][1]
        items = items_of(node)
        dimension = force.bodies[0].dimension
        if items is None or len(items) != dimension:
            zeros = "0, " * (dimension - 1)
            force.fault(
                "shape",
                f"the `force` of {force.title} must be a vector of {dimension}, not {node.what}",
                f"write `force=[{zeros}-20 N]`, in the fixed frame",
                node,
            )
            return
        every = [force.expression(f"force.{a}", v) for a, v in zip("xyz", items, strict=False)]
        text = f"[{', '.join(every)}]"
        frame = force.given("in")
        if frame is not None:
            if not _own_frame(force, frame):
                return
            if dimension == 3:
                text = f"{force.rotation(0)}*{text}"
            else:
                (x, y), angle = every, force.angle(0)
                c, s = f"cos({angle})", f"sin({angle})"
                text = f"[({x})*{c} - ({y})*{s}, ({x})*{s} + ({y})*{c}]"
        name = f"{key.declared}.place"
        written.add("definitions", name, force.point(0), key.node)
        written.add("Q", name, text, key.node, force.inlined)
    if "moment" in given:
        _moment(force)


def _moment(force: MachineJoint) -> None:
    """Write a given moment: on the angle of a body, or in space on its rotation."""
    written, key, node = force.written, force.key, force.keys["moment"][1]
    name = f"{key.declared}.turned"
    if force.bodies[0].dimension == 2:
        angle = force.angle(0)
        if angle != "0":
            written.add("definitions", name, angle, key.node)
            text = force.expression("moment", node)
            written.add("Q", name, text, key.node, force.inlined)
        return
    items = items_of(node)
    if items is None or len(items) != 3:
        force.fault(
            "shape",
            f"the `moment` of {force.title} must be a vector of 3, not {node.what}",
            "write `moment=[0, 0, 2 N*m]`, in the fixed frame",
            node,
        )
        return
    frame = force.given("in")
    rotation = force.rotation(0)
    if not rotation or (frame is not None and not _own_frame(force, frame)):
        return
    every = (force.expression(f"moment.{a}", v) for a, v in zip("xyz", items, strict=True))
    text = f"[{', '.join(every)}]"  # the generalized force of a rotation is in the body's frame
    if frame is None:
        text = f"transpose({rotation})*{text}"
    written.add("definitions", name, rotation, key.node)
    written.add("Q", name, text, key.node, force.inlined)


def _own_frame(force: MachineJoint, node: YamlNode) -> bool:
    """Whether a force is given in the frame of its body; report another."""
    own = force.first.name
    if getattr(node, "value", "").strip() != own:
        force.fault(
            "unknown-name",
            f"{force.title} is given in the frame of {node.what}, which is not its body",
            f"write `in={own}`, or leave it out: the force is then in the fixed frame",
            node,
        )
        return False
    return True


FORCES = {
    kind.name: kind
    for kind in (
        JointKind(
            "spring",
            "bodies",
            _spring,
            ("stiffness", "length", "damping"),
            False,
            "spring(ground.C, lever.D, stiffness=4530 N/m, length=78 mm)",
            "V = ½ stiffness (|P_B − P_A| − length)²",
            "",
        ),
        JointKind(
            "actuator",
            "bodies",
            _actuator,
            ("force",),
            False,
            "actuator(base.P, boom.Q, force=2 kN)",
            "",
            "",
        ),
        JointKind(
            "wrench",
            "body",
            _wrench,
            ("force", "moment", "in"),
            False,
            "wrench(ram, force=[0, 500 N])",
            "",
            "",
        ),
    )
}


def read_forces(written: MachineEntries, bodies: Bodies, joints: Joints, node: Mapping) -> None:
    """Read the entries of `forces`, and write what they add to V, D and Q."""
    report = written.report
    for name, key_node, value in node:
        key = read_key(key_node, bodies.free_index)
        taken = key is not None and (key.base in bodies.by_base or key.base in joints.by_base)
        if key is None or taken:
            report.add(
                "duplicate-name" if taken else "bad-name",
                f"`{shorten(name)}` cannot be the name of a force"
                + (": it is that of a body or joint" if taken else ""),
                key_node.location,
                "choose another name: a letter followed by letters, digits and _",
            )
            continue
        call = read_call(value, FORCES)
        kinds = ", ".join(f"`{k}`" for k in FORCES)
        if isinstance(call, str) or call.kind not in FORCES:
            said = call if isinstance(call, str) else f"is of the unknown kind `{call.kind}`"
            close = [] if isinstance(call, str) else nearest(call.kind, list(FORCES), 1)
            report.add(
                "wrong-type" if isinstance(call, str) else "unknown-kind",
                f"the force `{key_node.value}` {said}",
                value.location if isinstance(call, str) else call.kind_node.location,
                did_you_mean(close)
                or f"the kinds are {kinds}; a force on a coordinate is written under `Q`",
            )
            continue
        kind = FORCES[call.kind]
        what = f"the force `{key_node.value}`"
        wanted = 1 if kind.connects == "body" else 2
        references = [r for x in call.arguments if (r := read_reference(x)) is not None]
        if len(call.arguments) != wanted or len(references) != wanted:
            report.add(
                "wrong-arguments",
                f"{what} acts on {wanted} {'point' if wanted == 1 else 'points'}",
                call.kind_node.location,
                f"write `{kind.example}`",
            )
            continue
        unknown = next((k for k in call.keys if k not in kind.keys), None)
        if unknown is not None:
            report.add(
                "unknown-key",
                f"a force of the kind `{kind.name}` has no key `{shorten(unknown)}`",
                call.keys[unknown][0].location,
                did_you_mean(nearest(unknown, list(kind.keys), 1))
                or "its keys are " + ", ".join(kind.keys),
            )
            continue
        found = [bodies.find(r, what) for r in references]
        if None not in found:
            force = MachineJoint(key, kind, call.keys, written, references[0], references[-1])
            force.bodies = tuple(b for b in found if b is not None)
            kind.write(force)
