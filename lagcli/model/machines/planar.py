"""Planar joint in space: a plane of the second body slides on one of the first."""

from lagcli.model.machines.cylindrical import advance
from lagcli.model.machines.frames import moments, read_axes
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    axes = read_axes(joint)
    if axes is None:
        return
    joint.axes = axes
    joint.row("n", f"{advance(joint)} = 0")
    moments(joint)


PLANAR = JointKind(
    "planar",
    "bodies",
    _write,
    ("axis",),
    False,
    "planar(ground.T, block.P, axis=z)",
    "u_A·d = 0, −w_A·u_B = 0, v_A·u_B = 0, where u is the normal",
    "`.n`: force along u_A; `.Mv`, `.Mw`: moments about v_A and w_A",
    3,
)
