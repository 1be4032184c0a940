"""Spherical joint: a ball in a socket."""

from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")


SPHERICAL = JointKind(
    "spherical",
    "bodies",
    _write,
    (),
    False,
    "spherical(ground.O, top.foot)",
    "P_B − P_A = 0",
    "`.x`, `.y`, `.z`: force in the fixed frame",
    3,
)
