"""Errors of bodies, joints and forces: each at the line of its cause, with a remedy."""

from __future__ import annotations

import pytest

from lagcli.errors import ModelError
from lagcli.model.loader import expand_text, load_text

BODIES = """bodies:
  ground: {points: {O: [0, 0], P: [0.3, 0]}}
  crank: {mass: 1, length: 0.1}
  wheel: {mass: 1, inertia: 0.02, points: {Q: [0.1, 0]}}
  bob: {mass: 2}
joints:
  O: revolute(ground.O, crank.a)
  W: revolute(ground.P, wheel)
  B: rod(crank.b, bob, length=0.2)
"""
CASES = {
    "unknown body": ("  X: revolute(crnk.b, wheel)", "unknown-name", "crnk", "crank"),
    "unknown point": ("  X: revolute(crank.c, wheel)", "unknown-name", "`c`", "`a`, `b`"),
    "unknown kind": ("  X: revolut(crank.b, wheel)", "unknown-kind", "revolut", "revolute"),
    "kind in space": ("  X: spherical(crank.b, wheel)", "unknown-kind", "space", "dimension: 3"),
    "unknown key": ("  X: revolute(crank.b, wheel, dampin=1)", "unknown-key", "dampin", "damping"),
    "one body": ("  X: revolute(crank.b)", "wrong-arguments", "not 1", "revolute("),
    "itself": ("  X: revolute(crank.a, crank.b)", "contradiction", "itself", "different"),
    "no call": ("  X: crank.b", "wrong-type", "is no call", "revolute("),
    "turns a point mass": (
        "  X: prismatic(ground, crank, along=[0, 0])",
        "wrong-value",
        "along",
        "dir",
    ),
    "angle of a point mass": (
        "  X: gear(bob, wheel, radii=[1, 2])",
        "missing-value",
        "inertia",
        "bob",
    ),
    "no along": ("  X: slot(ground, wheel)", "missing-value", "along", "along=x"),
    "drive of a rod": ("  X: {drive: B, angle: t}", "contradiction", "rod", "revolute"),
    "drive of nothing": ("  X: {drive: V, angle: t}", "unknown-name", "V", "joint"),
    "drive without motion": ("  X: {drive: W}", "missing-value", "no motion", "angle"),
    "two drives": (
        "  X: {drive: W, angle: t}\n  Y: {drive: W, speed: 1}",
        "contradiction",
        "two drives",
        "remove",
    ),
    "gearbox": ("  X: {gearbox: [W, O]}", "missing-value", "ratio", "ratio: 5"),
    "centers": ("  X: gear(crank.a, wheel, radii=[0.1, 0.1])", "contradiction", "0.3 m", "center"),
    "joint as body": (
        "  crank: rod(ground.O, wheel, length=1)",
        "duplicate-name",
        "body",
        "rename",
    ),
    "stops": (
        "  X: revolute(crank.b, wheel, min=1, max=0)",
        "contradiction",
        "min = 1",
        "exchange",
    ),
    "rest": ("  X: revolute(crank.b, wheel, rest=1)", "missing-value", "rest", "stiffness"),
    "force on angle": ("  X: revolute(crank.b, wheel, force=1)", "unknown-key", "force", "torque"),
    "unknown name in a value": (
        "  X: revolute(crank.b, wheel, torque=3*q)",
        "unknown-name",
        "`q`",
        "",
    ),
    "unknown force": (
        "forces:\n  s: sprng(ground.O, crank.b, stiffness=1)",
        "unknown-kind",
        "sprng",
        "spring",
    ),
    "force of a coordinate": ("forces:\n  crank.x: 3", "bad-name", "crank.x", "name"),
    "initial": ("initial: {O.position: 1}", "unknown-name", "angle", "O.angle"),
    "declared twice": ("parameters: {crank.mass: 3}", "duplicate-name", "crank.mass", "rename"),
    "gravity": ("dimension: 2\ngravity: [0, 0, -9.81]", "shape", "gravity", "-9.81 m/s^2"),
    "dimension": ("dimension: 4", "wrong-value", "4", "dimension: 3"),
    "L": ("L: 1", "contradiction", "`L`", "`T`"),
}


@pytest.mark.parametrize("case", CASES)
def test_errors_of_joints(case: str) -> None:
    added, kind, said, remedy = CASES[case]
    with pytest.raises(ModelError) as raised:
        load_text(BODIES + added + "\n")
    found = [d for d in raised.value.diagnostics if d.kind == kind]
    assert found, raised.value
    last = found[0]
    assert said in last.message
    assert remedy in (last.help or "")
    assert last.location is not None
    lines = {BODIES.count("\n") + 1 + n for n in range(added.count("\n") + 1)}
    assert last.location.line in lines or case == "duplicate"


@pytest.mark.parametrize(
    ("bodies", "kind", "said", "remedy"),
    [
        ("crank: {length: 0.1}", "missing-value", "no `mass`", "mass: 2 kg"),
        ("crank: {mass: 0, length: 1}", "wrong-value", "mass", "rod"),
        ("crank: {mass: 1, size: 2}", "unknown-key", "size", "mass"),
        ("crank: 3", "wrong-type", "mapping", "mass"),
        (
            "crank: {mass: 1, inertia: [1, 2, 3]}\ndimension: 2",
            *("wrong-type", "list", "moment of inertia"),
        ),
        ("crank: {mass: 1, shape: sphere(1)}", "wrong-value", "planar", "dimension: 3"),
        ("crank: {mass: 1, inertia: 1, points: {phi: [1, 0]}}", "reserved-name", "phi", "another"),
        (
            "crank: {mass: 1, inertia: 1, points: {P: [1, 0, 0]}}\ndimension: 2",
            *("shape", "a list of 3", "dimension: 3"),
        ),
        ("crank: {mass: 1, points: {P: [1, 0]}}", "missing-value", "no inertia", "inertia"),
        ("lambda: {mass: 1}", "bad-name", "lambda", "letter"),
        ("crank: {mass: 1, length: 2}", "missing-initial", "no joint", "initial"),
        ("crank: {mass: 1 kgg, length: 2}", "unknown-unit", "kgg", ""),
    ],
)
def test_errors_of_bodies(bodies: str, kind: str, said: str, remedy: str) -> None:
    with pytest.raises(ModelError) as raised:
        load_text(f"bodies:\n  {bodies}\n")
    found = [d for d in raised.value.diagnostics if d.kind == kind]
    assert found, raised.value
    assert said in found[0].message
    assert remedy in (found[0].help or "")
    assert found[0].location is not None
    assert found[0].location.line == 2


def test_an_error_in_a_value_is_where_it_is_written() -> None:
    with pytest.raises(ModelError) as raised:
        load_text(BODIES + "  X: revolute(crank.b, wheel, torque=3*q)\n")
    location = raised.value.diagnostics[0].location
    assert location is not None
    line = "  X: revolute(crank.b, wheel, torque=3*q)"
    assert (location.line, location.column) == (BODIES.count("\n") + 1, line.index("q)") + 1)


def test_forces_without_bodies_are_those_of_coordinates() -> None:
    with pytest.raises(ModelError) as raised:
        load_text("coordinates: [x]\nT: x'^2/2\nforces: {x: 1}\ninitial: {x: 0, x': 0}\n")
    assert "`Q`" in (raised.value.diagnostics[0].help or "")


def test_the_expanded_file_is_expanded_to_itself() -> None:
    once = expand_text(BODIES)
    assert expand_text(once) == once


def test_entries_of_the_file_are_kept_beside_those_of_bodies() -> None:
    text = BODIES + "coordinates: [z]\nT: z'^2/2\nQ: {O.angle: 1, z: 2}\n"
    text += "initial: {z: 0, z': 0}\n"
    model = load_text(text.replace("crank.a)", "crank.a, torque=3)"))
    assert [c.name for c in model.coordinates][-1] == "z"
    assert str(model.applied_forces["crank.phi"]) == "1 + O.torque"
    assert str(model.applied_forces["z"]) == "2"
