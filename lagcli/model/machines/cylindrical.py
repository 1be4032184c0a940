"""Cylindrical joint: the second body turns about an axis of the first and moves along it."""

from lagcli.model.machines.frames import moments, on_body, read_axes
from lagcli.model.machines.kind import JointKind, MachineJoint


def guide(joint: MachineJoint) -> None:
    """Write the rows that keep the second point on the axis of the first body."""
    first, _ = joint.axes
    for name, axis in (("v", first.v), ("w", first.w)):
        joint.row(name, f"dot({on_body(joint, 0, axis)}, {joint.distance()}) = 0")


def advance(joint: MachineJoint) -> str:
    """Return the position of the second point along the axis of the first body."""
    return f"dot({on_body(joint, 0, joint.axes[0].u)}, {joint.distance()})"


def _write(joint: MachineJoint) -> None:
    axes = read_axes(joint)
    if axes is None:
        return
    joint.axes = axes
    guide(joint)
    joint.coordinate("position", advance(joint))
    moments(joint)


CYLINDRICAL = JointKind(
    "cylindrical",
    "bodies",
    _write,
    ("axis", "angle", "position"),
    True,
    "cylindrical(rail.P, slider.Q, axis=x)",
    "v_A·d = 0, w_A·d = 0, −w_A·u_B = 0, v_A·u_B = 0; with the angle q also"
    " cos q w_A·v_B − sin q v_A·v_B = 0",
    "`.v`, `.w`: force along v_A and w_A; `.Mv`, `.Mw`, `.Mu`: moments about v_A, w_A, u_A",
    3,
)
