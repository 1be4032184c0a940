"""Belt or chain on two wheels."""

from lagcli.model.machines.gear import flag, radii_of, spin
from lagcli.model.machines.kind import JointKind, MachineJoint


def _write(joint: MachineJoint) -> None:
    radii = radii_of(joint)
    if radii is None:
        return
    one, two = radii
    crossed = flag(joint, "crossed")
    name, declared, place = joint.key.name, joint.key.declared, joint.key.node
    written = joint.written
    written.add("definitions", f"{declared}.centers", joint.distance(), place)
    sine = f"({one} {'+' if crossed else '-'} {two})/norm({name}.centers)"
    written.add("definitions", f"{declared}.sine", sine, place)
    # the strand on the left of the line from the first center to the second
    e = f"{name}.centers/norm({name}.centers)"
    across = f"[-{name}.centers.y, {name}.centers.x]/norm({name}.centers)"
    strand = f"sqrt(1 - {name}.sine^2)*{e} - {name}.sine*{across}"
    written.add("definitions", f"{declared}.strand", strand, place)
    terms = [f"dot({name}.strand, {joint.approach()})"] if joint.approach() else []
    if second := spin(joint, 1):
        terms.append(f"{'' if crossed else '-'}{two}*{second}")
    if first := spin(joint, 0):
        terms.append(f"{one}*{first}")
    joint.row("", " + ".join(terms).replace("+ -", "- ") + " = 0")


BELT = JointKind(
    "belt",
    "bodies",
    _write,
    ("radii", "crossed"),
    False,
    "belt(motor, drum, radii=[50 mm, 120 mm])",
    "d·(v_B − v_A) = 0 along the strand d",
    "force of the strand on the left of the line from A to B; positive pushes the wheels apart",
)
