"""Fixed joint: a weld."""

from lagcli.model.machines.frames import equal_rotations
from lagcli.model.machines.kind import JointKind, MachineJoint
from lagcli.model.machines.revolute import relative_angle


def _write(joint: MachineJoint) -> None:
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")
    if joint.bodies[1].turns and joint.bodies[0].turns:
        node = joint.given("angle")
        angle = "0" if node is None else joint.number("angle", node)
        joint.row("M", f"{relative_angle(joint)} = {angle}")


def _write_in_space(joint: MachineJoint) -> None:
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")
    joint.row("M", equal_rotations(joint))


FIXED = JointKind(
    "fixed",
    "bodies",
    _write,
    ("angle",),
    False,
    "fixed(frame.P, plate, angle=30 deg)",
    "P_B − P_A = 0, φ_B − φ_A = angle",
    "`.x`, `.y`: force in the fixed frame; `.M`: moment",
)
FIXED_IN_SPACE = JointKind(
    "fixed",
    "bodies",
    _write_in_space,
    (),
    False,
    "fixed(frame.P, plate.Q)",
    "P_B − P_A = 0, R_B = R_A",
    "`.x`, `.y`, `.z`: force in the fixed frame; `.M.x`, `.M.y`, `.M.z`: moment in A's frame",
    3,
)
