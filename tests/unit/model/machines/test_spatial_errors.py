"""Errors of bodies, joints and forces in space: each at the line of its cause, with a remedy."""

from __future__ import annotations

import pytest

from lagcli.errors import ModelError
from lagcli.model.loader import expand_text, load_text

BODIES = """gravity: [0, 0, -9.81]
bodies:
  ground: {points: {O: [0, 0, 0]}}
  arm: {mass: 1, inertia: [0.02, 0.03, 0.04], points: {Q: [0.1, 0, 0]}}
  fork: {mass: 1, inertia: [0.02, 0.03, 0.04]}
  bob: {mass: 2}
joints:
  J: revolute(ground.O, arm, axis=z)
  F: spherical(arm.Q, fork)
  B: rod(arm, bob, length=0.2)
"""
CASES = {
    "gear": ("  X: gear(arm, fork, radii=[1, 2])", "unknown-kind", "plane only", "spherical"),
    "slot": ("  X: slot(arm, fork, along=x)", "unknown-kind", "plane only", "cylindrical"),
    "misspelled": ("  X: sphericl(arm, fork)", "unknown-kind", "sphericl", "spherical"),
    "no axis": ("  X: revolute(arm, fork)", "missing-value", "no `axis`", "axis=z"),
    "zero axis": ("  X: revolute(arm, fork, axis=[0, 0, 0])", "wrong-value", "zero", "axis=z"),
    "axis of two": ("  X: revolute(arm, fork, axis=[0, 1])", "shape", "axis", "[0, 0.6, 0.8]"),
    "axis of names": ("  X: revolute(arm, fork, axis=[a, 0, 1])", "wrong-value", "a", "numbers"),
    "unknown letter": ("  X: revolute(arm, fork, axis=q)", "shape", "axis", "axis=z"),
    "along": ("  X: prismatic(arm, fork, along=x)", "unknown-key", "along", "axis"),
    "two axes": ("  X: prismatic(arm, fork, axis=[x, y])", "wrong-value", "two axes", "one axis"),
    "universal": (
        "  X: universal(arm, fork, axis=[y, [0, 1, 1]])",
        *("wrong-value", "right angles", "axis=[y, z]"),
    ),
    "no pitch": ("  X: screw(arm, fork, axis=z)", "missing-value", "pitch", "pitch=5 mm"),
    "no radius": (
        "  X: rolling(ground, fork, normal=z, axis=y)",
        *("missing-value", "radius", "radius=0.3 m"),
    ),
    "rolling ground": (
        "  X: rolling(fork, ground, normal=z, axis=y, radius=1)",
        *("contradiction", "ground", "disc second"),
    ),
    "turns a point mass": ("  X: fixed(arm, bob)", "missing-value", "no inertia", "inertia: ["),
    "drive of a ball": ("  X: {drive: F, angle: t}", "contradiction", "spherical", "revolute"),
    "two drives": (
        "  X: {drive: J, angle: t}\n  Y: {drive: J, speed: 1}",
        *("contradiction", "two drives", "remove"),
    ),
    "drive of a position": (
        "  X: {drive: J, position: t}",
        *("contradiction", "position", "`angle` or `speed`"),
    ),
    "spring of a ball": (
        "  X: spherical(arm, fork, stiffness=1)",
        *("unknown-key", "stiffness", "spherical("),
    ),
    "keys of a cylindrical joint": (
        "  X: {cylindrical: [arm, fork], axis: z, angle: {damp: 1}}",
        *("unknown-key", "damp", "damping"),
    ),
    "torque on a position": (
        "  X: {cylindrical: [arm, fork], axis: z, position: {torque: 1}}",
        *("unknown-key", "torque", "force"),
    ),
    "force of a plane": (
        "forces:\n  w: wrench(arm, force=[0, 1])",
        *("shape", "vector of 3", "[0, 0, -20 N]"),
    ),
    "moment of a plane": (
        "forces:\n  w: wrench(arm, moment=2)",
        *("shape", "vector of 3", "[0, 0, 2 N*m]"),
    ),
    "reversed axis": (
        "initial: {arm.e: rot_x(180 deg)}",
        *("contradiction", "reversed", "angle of the joint"),
    ),
    "another half turn": (
        "initial: {arm.e: rot_z(180 deg), J.angle: 0}",
        *("contradiction", "half turn", "angle of the joint"),
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_errors_of_joints_in_space(case: str) -> None:
    added, kind, said, remedy = CASES[case]
    with pytest.raises(ModelError) as raised:
        load_text(BODIES + added + "\n")
    found = [d for d in raised.value.diagnostics if d.kind == kind]
    assert found, raised.value
    assert said in found[0].message
    assert remedy in (found[0].help or "")
    assert found[0].location is not None
    first = BODIES.count("\n") + 1
    lines = set(range(first, first + added.count("\n") + 1))
    assert found[0].location.line in ({8} if added.startswith("initial") else lines)


@pytest.mark.parametrize(
    ("body", "kind", "said", "remedy"),
    [
        ("mass: 1, inertia: [1, 1, 3]", "wrong-value", "exceeds the sum", "A + B ≥ C"),
        ("mass: 1, inertia: [1, 1, -1]", "wrong-value", "negative", "positive"),
        (
            "mass: 1, inertia: [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]",
            *("wrong-value", "symmetric", "both sides"),
        ),
        (
            "mass: 1, inertia: [[1, 0.9, 0], [0.9, 1, 0], [0, 0, 1]]",
            *("wrong-value", "exceeds the sum", "A + B ≥ C"),
        ),
        ("mass: 1, inertia: 2", "shape", "inertia", "[0.02, 0.03, 0.04]"),
        ("mass: 1, inertia: [1, 2]", "shape", "a list of 2", "shape"),
        ("mass: 1, shape: cone(1)", "unknown-kind", "cone", "box(a, b, c)"),
        ("mass: 1, shape: sphere(1, 2)", "wrong-arguments", "2 sizes", "sphere(r)"),
        ("mass: 1, shape: sphere(0)", "wrong-value", "is 0", "above 0"),
        ("mass: 1, shape: sphere(1), inertia: [1, 1, 1]", "contradiction", "shape", "remove"),
        ("mass: 1, inertia: [1, 1, 1], points: {P: [1, 0]}", "shape", "a list of 2", "`gravity`"),
        ("mass: 1, inertia: [1, 1, 1], points: {e: [1, 0, 0]}", "reserved-name", "e", "another"),
        ("mass: 1, points: {P: [1, 0, 0]}", "missing-value", "no inertia", "inertia: ["),
        ("mass: 1, inertia: [1, 1, 1]", "missing-initial", "no joint", "b.e: 1"),
    ],
)
def test_errors_of_bodies_in_space(body: str, kind: str, said: str, remedy: str) -> None:
    with pytest.raises(ModelError) as raised:
        load_text(f"gravity: [0, 0, -9.81]\nbodies:\n  b: {{{body}}}\n")
    found = [d for d in raised.value.diagnostics if d.kind == kind]
    assert found, raised.value
    assert said in found[0].message
    assert remedy in (found[0].help or "")
    assert found[0].location is not None
    assert found[0].location.line == 3


def test_moments_of_a_member_of_a_family_are_checked() -> None:
    with pytest.raises(ModelError, match="exceeds the sum"):
        load_text(
            "dimension: 3\nbodies: {'b[1..2]': {mass: 1, inertia: [1, 1, 3]}}\n"
            "joints: {J[i = 1..2]: 'spherical(ground, b[i])'}\n"
        )


def test_an_angle_that_nothing_uses_is_no_coordinate() -> None:
    names = [c.name for c in load_text(BODIES).coordinates]
    assert "J.angle" not in names
    for used in ("initial: {J.angle: 0}", "outputs: {a: J.angle}", "  M: {drive: J, speed: 2}"):
        model = load_text(BODIES + used + "\n")
        assert "J.angle" in [c.name for c in model.coordinates]
        assert "J.Mu" in [c.name for c in model.constraints]


def test_the_expanded_file_is_expanded_to_itself() -> None:
    once = expand_text(BODIES)
    assert expand_text(once) == once


def test_values_of_members_of_families_of_points_and_quaternions() -> None:
    text = "dimension: 3\nbodies: {'b[1..2]': {mass: 1, inertia: [1, 1, 1]}}\n"
    text += "initial: {'b[1..2].r': 0, 'b[1..2].e': 1, \"b[1..2].r'\": 0, \"b[1..2].e'\": 0}\n"
    model = load_text(text, set_initial={"b[2].r": "[1, 2, 3]", "b[1].e": "rot_x(180 deg)"})
    assert [model.initial[f"b[2].r.{c}"].value for c in "xyz"] == [1, 2, 3]
    assert model.initial["b[1].e.1"].value == pytest.approx(1)
    assert model.initial["b[1].r.x"].value == 0
