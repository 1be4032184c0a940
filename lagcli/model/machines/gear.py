"""Pair of gear wheels: equal velocities at the pitch point, along the line of action."""

from lagcli.model.machines.kind import JointKind, MachineJoint
from lagcli.model.machines.references import items_of


def radii_of(joint: MachineJoint) -> tuple[str, str] | None:
    """Return the two radii of wheels; report others."""
    node = joint.required("radii", "radii=[40 mm, 20 mm]")
    items = None if node is None else items_of(node)
    if node is not None and (items is None or len(items) != 2):
        joint.fault(
            "shape",
            f"`radii` of {joint.title} must be two numbers, not {node.what}",
            "write `radii=[40 mm, 20 mm]`: the first wheel's, the second wheel's",
            node,
        )
    if items is None or len(items) != 2:
        return None
    places = zip(("first", "second"), items, strict=True)
    first, second = (joint.number(f"radii.{place}", x) for place, x in places)
    return first, second


def flag(joint: MachineJoint, name: str) -> bool:
    """Return a key that is true or false; false by default."""
    node = joint.given(name)
    if node is None:
        return False
    what = f"`{name}` of {joint.title}"
    return bool(joint.written.draft.flag(node, what, f"write `{name}=true`, or leave it out"))


def rotated(along: str, across: str, pressure: str) -> str:
    """Return the line of action: a direction turned by the pressure angle."""
    if pressure == "0":
        return along
    return f"cos({pressure})*{along} + sin({pressure})*{across}"


def pressure_of(joint: MachineJoint) -> str:
    """Return the pressure angle; 0 by default."""
    node = joint.given("pressure")
    return "0" if node is None else joint.number("pressure", node)


def spin(joint: MachineJoint, side: int) -> str:
    """Return the angular velocity of a wheel; empty for the ground."""
    angle = joint.angle(side)
    return "" if angle == "0" else f"{angle}'"


def _write(joint: MachineJoint) -> None:
    radii = radii_of(joint)
    if radii is None:
        return
    one, two = radii
    inner = flag(joint, "inner")
    name, declared = joint.key.name, joint.key.declared
    centers = f"({one} - {two})" if inner else f"({one} + {two})"
    written, place = joint.written, joint.key.node
    written.add("definitions", f"{declared}.centers", f"({joint.distance()})/{centers}", place)
    along, across = f"[-{name}.centers.y, {name}.centers.x]", f"{name}.centers"
    action = rotated(along, f"(-{across})", pressure_of(joint))
    # the wheels' own velocities at the pitch point are along [-centers.y, centers.x]
    turning = []
    if second := spin(joint, 1):
        turning.append(f"{'' if inner else '-'}{two}*{second}")
    if first := spin(joint, 0):
        turning.append(f"-{one}*{first}")
    sum_ = " + ".join(turning).replace("+ -", "- ")
    velocity = f"({sum_})*{along}"
    if approach := joint.approach():
        velocity = f"{approach} + {velocity}"
    joint.row("", f"dot({action}, {velocity}) = 0")


GEAR = JointKind(
    "gear",
    "bodies",
    _write,
    ("radii", "inner", "pressure"),
    False,
    "gear(sun, planet, radii=[40 mm, 20 mm])",
    "d·(v_B − v_A) = 0 at the pitch point",
    "tooth force along the line of action d, which is the tangent turned by `pressure`",
)
