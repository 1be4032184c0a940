"""Fixed joint in a plane: a weld."""

from lagcli.model.machines.kind import JointKind, MachineJoint
from lagcli.model.machines.revolute import relative_angle


def _write(joint: MachineJoint) -> None:
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")
    if joint.bodies[1].turns and joint.bodies[0].turns:
        node = joint.given("angle")
        angle = "0" if node is None else joint.number("angle", node)
        joint.row("M", f"{relative_angle(joint)} = {angle}")


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
