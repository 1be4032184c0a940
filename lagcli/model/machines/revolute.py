"""Revolute joint: a pin, in a plane or in space."""

from lagcli.model.machines.frames import moments, read_axes
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")
    if joint.bodies[1].turns and joint.bodies[0].turns:
        joint.coordinate("angle", relative_angle(joint))


def relative_angle(joint: MachineJoint) -> str:
    """Return the angle of the second body relative to the first."""
    first, second = joint.angle(0), joint.angle(1)
    if first == "0":
        return second
    return f"-{first}" if second == "0" else f"{second} - {first}"


def _write_in_space(joint: MachineJoint) -> None:
    axes = read_axes(joint)
    if axes is None:
        return
    joint.axes = axes
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")
    moments(joint)


REVOLUTE = JointKind(
    "revolute",
    "bodies",
    _write,
    (),
    True,
    "revolute(crank.b, coupler.a)",
    "P_B − P_A = 0",
    "`.x`, `.y`: force in the fixed frame",
)
REVOLUTE_IN_SPACE = JointKind(
    "revolute",
    "bodies",
    _write_in_space,
    ("axis",),
    True,
    "revolute(base.P, arm.O, axis=z)",
    "P_B − P_A = 0, −w_A·u_B = 0, v_A·u_B = 0; with the angle q also"
    " cos q w_A·v_B − sin q v_A·v_B = 0",
    "`.x`, `.y`, `.z`: force in the fixed frame; `.Mv`, `.Mw`: moments about v_A and w_A; `.Mu`:"
    " about u_A",
    3,
)
