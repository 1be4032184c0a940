"""Cam: the coordinate of a follower's joint is a function of the cam's."""

from lagcli.model.machines.gear import flag
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    node = joint.required("lift", "lift: 10 mm*(1 - cos(C.angle))")
    if node is None:
        return
    follower = f"{joint.second.name}.{joint.joints[1].quantity}"
    relation = ">=" if flag(joint, "contact") else "="
    joint.row("", f"{follower} {relation} {joint.expression('lift', node)}")


CAM = JointKind(
    "cam",
    "joints",
    _write,
    ("lift", "contact"),
    False,
    "{cam: [C, follower], lift: h*(1 - cos(C.angle))}",
    "q₂ = lift, or q₂ ≥ lift with `contact: true`",
    "force of the cam along the follower",
)
