"""Drive: a motor that moves the coordinate of a joint as given."""

from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    (driven,) = joint.joints
    given = [k for k in ("angle", "position", "speed") if k in joint.keys]
    both = len(driven.quantities) > 1  # a cylindrical joint has no speed of its own
    allowed = [*driven.quantities, *([] if both else ["speed"])]
    if len(given) != 1 or given[0] not in allowed:
        wanted = "` or `".join(driven.quantities)
        joint.fault(
            "contradiction" if given else "missing-value",
            f"{joint.title} gives " + (" and ".join(f"`{k}`" for k in given) or "no motion"),
            f"give `{wanted}`"
            + ("" if both else " or `speed`")
            + f", as in `{{drive: {driven.key.node.value}, {driven.quantity}: 2*t}}`",
        )
        return
    wanted = driven.quantity if given[0] == "speed" else given[0]
    node = joint.keys[given[0]][1]
    moved = f"{joint.first.name}.{wanted}" + ("'" if given[0] == "speed" else "")
    joint.row("", f"{moved} = {joint.expression(given[0], node)}")


DRIVE = JointKind(
    "drive",
    "joint",
    _write,
    ("angle", "position", "speed"),
    False,
    "{drive: O, angle: n*t}",
    "q = f(t), or q' = f",
    "torque or force of the motor on the second body",
)
