"""Rod without mass between two points."""

from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    node = joint.required("length", "length=0.3 m")
    if node is not None:
        joint.row("", f"norm({joint.distance()}) = {joint.expression('length', node)}")


ROD = JointKind(
    "rod",
    "bodies",
    _write,
    ("length",),
    False,
    "rod(ground.O, bob, length=0.5 m)",
    "|P_B − P_A| = length",
    "force along the rod; positive pushes the points apart",
)
ROD_IN_SPACE = ROD._replace(dimension=3)
