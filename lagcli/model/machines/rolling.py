"""Rolling of a thin disc on a plane without slipping."""

from lagcli.model.machines.frames import completed, on_body, read_axes
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    normal, axis = read_axes(joint, "normal"), read_axes(joint)
    node = joint.required("radius", "radius=0.3 m")
    if normal is None or axis is None or node is None:
        return
    if joint.bodies[1].fixed:
        joint.fault(
            "contradiction",
            f"{joint.title} rolls the ground",
            "name the body with the plane first, and the disc second",
        )
        return
    first = normal[0]
    joint.axes = first, completed(axis[1].u)
    joint.size = joint.number("radius", node)
    n, a = on_body(joint, 0, first.u), on_body(joint, 1, axis[1].u)
    if not joint.rotation(1):
        return
    name, declared, place, written = (
        *(joint.key.name, joint.key.declared, joint.key.node),
        joint.written,
    )
    written.add("definitions", f"{declared}.axis", a, place)
    written.add("definitions", f"{declared}.sine", f"sqrt(1 - dot({name}.axis, {n})^2)", place)
    # from the center of the disc to the contact
    arm = f"-{joint.size}/{name}.sine*({n} - dot({name}.axis, {n})*{name}.axis)"
    written.add("definitions", f"{declared}.arm", arm, place)
    slip = f"{joint.speed(1)} + cross({_omega(joint, 1)}, {name}.arm)"
    if not joint.bodies[0].fixed:
        center, middle = joint.point(1), joint.bodies[0].center(joint.first.name)
        reach = f"{center} + {name}.arm - {middle}"
        moved = joint.bodies[0].velocity(joint.first.name)
        slip += f" - {moved} - cross({_omega(joint, 0)}, {reach})"
    written.add("definitions", f"{declared}.slip", slip, place)
    joint.row("n", f"dot({n}, {joint.distance()}) = {joint.size}*{name}.sine")
    for suffix, along in (("x", first.v), ("y", first.w)):
        joint.row(suffix, f"dot({on_body(joint, 0, along)}, {name}.slip) = 0")


def _omega(joint: MachineJoint, side: int) -> str:
    """Return the angular velocity of a body in the fixed frame."""
    rotation = joint.rotation(side)
    return f"{rotation}*omega({rotation})"


ROLLING = JointKind(
    "rolling",
    "bodies",
    _write,
    ("normal", "axis", "radius"),
    False,
    "rolling(ground, wheel, normal=z, axis=y, radius=0.3 m)",
    "n·d = radius √(1 − (a·n)²), where a is the axis of the disc; velocity of the contact along v"
    " and w of the plane = 0",
    "`.n`: normal force; `.x`, `.y`: friction along v and w of the normal: x and y for z",
    3,
)
