"""Revolute joint in a plane: a pin."""

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
