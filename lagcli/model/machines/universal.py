"""Universal joint: two axes at right angles that cross in a point."""

from lagcli.model.machines.frames import on_body, read_axes, right_angle
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    axes = read_axes(joint)
    if axes is None:
        return
    first, second = axes
    if not right_angle(first.u, second.u):
        joint.fault(
            "wrong-value",
            f"the axes of {joint.title} are not at right angles",
            "give the axis of each body in its frame: `axis=[y, z]`, or two vectors",
            joint.given("axis"),
        )
        return
    joint.axes = axes
    joint.row("", f"{joint.point(1)} = {joint.point(0)}")
    one, two = on_body(joint, 0, first.u), on_body(joint, 1, second.u)
    joint.row("M", f"-dot({one}, {two}) = 0")


UNIVERSAL = JointKind(
    "universal",
    "bodies",
    _write,
    ("axis",),
    False,
    "universal(input.P, shaft.Q, axis=[y, z])",
    "P_B − P_A = 0, −u_A·u_B = 0",
    "`.x`, `.y`, `.z`: force in the fixed frame; `.M`: moment about u_A × u_B",
    3,
)
