"""Screw: a nut that advances along its axis as it turns."""

from lagcli.model.machines.cylindrical import advance, guide
from lagcli.model.machines.frames import moments, read_axes
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    axes = read_axes(joint)
    node = joint.required("pitch", "pitch=5 mm")
    if axes is None or node is None:
        return
    joint.axes, joint.measured = axes, True
    joint.size = joint.number("pitch", node)
    guide(joint)
    moments(joint)
    joint.row("h", f"{advance(joint)} = {joint.size}/(2*pi)*{joint.q}")


SCREW = JointKind(
    "screw",
    "bodies",
    _write,
    ("axis", "pitch"),
    True,
    "screw(frame.P, nut, axis=z, pitch=5 mm)",
    "those of `cylindrical` with the angle q, and u_A·d = pitch q/2π",
    "those of `cylindrical`; `.h`: axial force",
    3,
)
