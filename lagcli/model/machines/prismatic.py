"""Prismatic joint and slot: a guide along a line of the first body."""

from lagcli.model.machines.cylindrical import advance, guide
from lagcli.model.machines.frames import equal_rotations, read_axes
from lagcli.model.machines.kind import JointKind, MachineJoint
from lagcli.model.machines.revolute import relative_angle


def _guide(joint: MachineJoint) -> None:
    axes = joint.along()
    if axes is None:
        return
    along, normal = axes
    joint.row("n", f"dot({normal}, {joint.distance()}) = 0")
    joint.coordinate("position", f"dot({along}, {joint.distance()})")


def _prismatic(joint: MachineJoint) -> None:
    _guide(joint)
    if joint.bodies[1].turns and joint.bodies[0].turns:
        node = joint.given("angle")
        angle = "0" if node is None else joint.number("angle", node)
        joint.row("M", f"{relative_angle(joint)} = {angle}")


def _prismatic_in_space(joint: MachineJoint) -> None:
    axes = read_axes(joint)
    if axes is None:
        return
    if axes[0] != axes[1]:
        joint.fault(
            "wrong-value",
            f"{joint.title} has two axes, but its bodies do not turn relative to each other",
            "give one axis, which is the same in the frames of both bodies",
            joint.given("axis"),
        )
        return
    joint.axes = axes
    guide(joint)
    joint.row("M", equal_rotations(joint))
    joint.coordinate("position", advance(joint))


PRISMATIC = JointKind(
    "prismatic",
    "bodies",
    _prismatic,
    ("along", "angle"),
    True,
    "prismatic(ground.G, ram, along=y)",
    "n_A·(P_B − P_A) = 0, φ_B − φ_A = angle",
    "`.n`: force along n_A, which is `along` turned by 90°; `.M`: moment",
)
SLOT = JointKind(
    "slot",
    "bodies",
    _guide,
    ("along",),
    True,
    "slot(lever, pin.P, along=x)",
    "n_A·(P_B − P_A) = 0",
    "`.n`: force along n_A",
)
PRISMATIC_IN_SPACE = JointKind(
    "prismatic",
    "bodies",
    _prismatic_in_space,
    ("axis",),
    True,
    "prismatic(ground.G, ram, axis=z)",
    "v_A·d = 0, w_A·d = 0, R_B = R_A",
    "`.v`, `.w`: force along v_A and w_A; `.M.x`, `.M.y`, `.M.z`: moment in A's frame",
    3,
)
