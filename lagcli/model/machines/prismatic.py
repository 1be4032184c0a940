"""Prismatic joint and slot in a plane: a guide along a line of the first body."""

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
