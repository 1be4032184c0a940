"""Gear wheel on a rack."""

from lagcli.model.machines.gear import pressure_of, rotated, spin
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    node = joint.required("radius", "radius=30 mm")
    axes = joint.along(side=1)
    if node is None or axes is None:
        return
    radius = joint.number("radius", node)
    along, normal = axes
    action = rotated(along, normal, pressure_of(joint))
    # the pitch point is at -radius*normal from the wheel's center
    terms = [joint.approach()] if joint.approach() else []
    if first := spin(joint, 0):
        terms.append(f"-{radius}*{first}*{along}")
    if second := spin(joint, 1):
        # of the rack at the pitch point, relative to its own point
        arm = f"{joint.point(0)} - {radius}*{normal} - {joint.point(1)}"
        name = f"{joint.key.declared}.arm"
        joint.written.add("definitions", name, arm, joint.key.node)
        arm = f"{joint.key.name}.arm"
        terms.append(f"{second}*[-{arm}.y, {arm}.x]")
    velocity = " + ".join(terms).replace("+ -", "- ")
    joint.row("", f"dot({action}, {velocity}) = 0")


RACK = JointKind(
    "rack",
    "bodies",
    _write,
    ("radius", "along", "pressure"),
    False,
    "rack(pinion, bar.P, radius=30 mm, along=x)",
    "d·(v_B − v_A) = 0 at the pitch point",
    "tooth force along d, which is `along` (in the rack's frame, wheel on its left) turned by"
    " `pressure`",
)
