"""Gearbox: a fixed ratio of the coordinates of two joints on one housing."""

from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    one, two = joint.joints
    housings = [{j.first.name, j.second.name} for j in joint.joints]
    if not housings[0] & housings[1]:
        joint.fault(
            "contradiction",
            f"{joint.title} couples `{one.key.node.value}` and `{two.key.node.value}`, which have"
            " no body in common",
            "both joints must be on one housing; wheels on different bodies are coupled by `gear`",
        )
        return
    node = joint.required("ratio", "ratio: 5")
    if node is not None:
        ratio = joint.number("ratio", node)
        q1, q2 = (
            f"{r.name}.{j.quantity}'"
            for r, j in zip((joint.first, joint.second), joint.joints, strict=True)
        )
        joint.row("", f"{q1} - {ratio}*{q2} = 0")


GEARBOX = JointKind(
    "gearbox",
    "joints",
    _write,
    ("ratio",),
    False,
    "{gearbox: [In, Out], ratio: 5}",
    "q₁' − ratio q₂' = 0",
    "torque on the first joint; the second has −ratio times it",
)
