"""Errors of bodies, joints and forces: each at the line of its cause, with a remedy."""

from __future__ import annotations

import math
import re

import pytest

from lagcli import simulate
from lagcli.errors import LagcliError, ModelError
from lagcli.model.loader import expand_text, load_text
from lagcli.simulations.variants import Variants
from lagcli.sweeps.plan.vary import varied_name

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
    "time in a unit": ("  X: {drive: W, angle: 60 rpm*t}", "units", "unit ton", "n*t"),
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


FOUR_BAR = """\
bodies:
  ground: {points: {O: [0, 0], D: [0.4, 0]}}
  crank: {mass: 1, length: 0.1}
  coupler: {mass: 2, length: 0.45}
  rocker: {mass: 1.5, length: 0.3}
joints:
  O: revolute(ground.O, crank.a)
  A: revolute(crank.b, coupler.a)
  B: revolute(coupler.b, rocker.b)
  D: revolute(ground.D, rocker.a)
initial: {coupler.phi: {guess: 30 deg}, rocker.phi: {guess: 90 deg}, O.angle': 2}
"""


def test_a_loop_that_cannot_close_lists_the_gaps_of_its_joints() -> None:
    # crank at 180°: at least 0.5 m from its pin to D, but 0.1 m and 0.3 m of rods
    text = FOUR_BAR.replace("length: 0.45", "length: 0.1")
    text = text.replace("O.angle': 2", "O.angle': 2, O.angle: 180 deg")
    with pytest.raises(LagcliError) as raised:
        simulate(load_text(text))
    message = str(raised.value)
    gaps = re.findall(r"^ +(\w+): ([\d.]+) mm$", message, re.MULTILINE)
    assert {name for name, _ in gaps} <= {"O", "A", "B", "D"}, message
    values = [float(gap) for _, gap in gaps]
    assert values == sorted(values, reverse=True)
    assert 99 <= sum(values) < 120  # the bars span 400 mm of 500
    assert "joints" in message
    assert "guesses" in message


def test_an_angle_that_cannot_be_reached_is_in_degrees() -> None:
    text = FOUR_BAR.replace(
        "initial:", "  P: prismatic(crank, rocker, along=x, angle=20 deg)\ninitial:"
    )
    with pytest.raises(LagcliError) as raised:
        simulate(load_text(text))
    assert re.search(r"^ +P: [\d.]+°$", str(raised.value), re.MULTILINE), raised.value


def test_the_start_of_a_pin_may_be_set_by_its_angle() -> None:
    one = load_text(FOUR_BAR, set_initial={"O.angle": "50 deg", "O.angle'": 3})
    two = load_text(FOUR_BAR, set_initial={"crank.phi": "50 deg", "crank.phi_dot": 3})
    assert one.initial["crank.phi"].value == pytest.approx(math.radians(50))
    assert one.initial["crank.phi"].fixed
    assert {n: x.value for n, x in one.initial.items()} == {
        n: x.value for n, x in two.initial.items()
    }
    # the bodies are placed from it
    assert one.initial["crank.x"].value == pytest.approx(0.05 * math.cos(math.radians(50)))


def test_the_angle_of_another_joint_is_set_in_the_file() -> None:
    with pytest.raises(ModelError) as raised:
        load_text(FOUR_BAR, set_initial={"A.angle": "50 deg"})
    (error,) = raised.value.diagnostics
    assert error.kind == "unknown-name"
    assert "`A.angle` in `initial`" in (error.help or "")
    model = load_text(
        FOUR_BAR.replace("{coupler", "{A.angle: {guess: 10 deg}, coupler"),
        set_initial={"coupler.phi": "0.3 rad"},
    )
    assert model.initial["coupler.phi"].value == 0.3


def test_a_sweep_of_a_length_or_angle_places_the_bodies_of_each_run() -> None:
    variants = Variants(load_text(FOUR_BAR))
    assert variants.together(["crank.mass"])
    assert not variants.together(["crank.length"])
    assert not variants.together(["crank.phi"])
    assert varied_name(variants.model, "O.angle") == "crank.phi"
    assert varied_name(variants.model, "O.angle_dot") == "crank.phi'"


def test_ground_cannot_be_declared_twice_nor_have_a_mass() -> None:
    for entry, kind, said in (
        ("  ground: {mass: 3}\n", "unknown-key", "mass"),
        ("  ground: {points: {a: [0, 0, 0]}}\n", "shape", "a list of 3"),
        ("  'ground[1..3]': {points: {P: [0, 0]}}\n", "bad-name", "ground"),
    ):
        text = BODIES.replace("  ground: {points: {O: [0, 0], P: [0.3, 0]}}\n", entry)
        with pytest.raises(ModelError) as raised:
            load_text(f"{text}\ndimension: 2\n")
        found = [d for d in raised.value.diagnostics if d.kind == kind]
        assert found, (entry, raised.value)
        assert said in found[0].message
        assert found[0].location is not None
        assert found[0].location.line == 2
    twice = BODIES.replace("  crank:", "  ground: {points: {Z: [0, 0]}}\n  crank:")
    with pytest.raises(ModelError) as raised:
        load_text(twice)
    assert raised.value.diagnostics[0].kind == "duplicate-key"
    with pytest.raises(ModelError) as raised:
        load_text(BODIES + "  ground: rod(ground.O, bob, length=1)\n")
    assert raised.value.diagnostics[0].kind == "bad-name"


def test_a_gearbox_needs_one_housing() -> None:
    text = BODIES + "  V: revolute(crank.b, wheel)\n"
    text = text.replace("  wheel:", "  disc: {mass: 1, inertia: 0.1}\n  wheel:")
    text += "  U: revolute(wheel, disc)\n  box: {gearbox: [O, U], ratio: 3}\n"
    with pytest.raises(ModelError) as raised:
        load_text(text)
    (error,) = raised.value.diagnostics
    assert error.kind == "contradiction"
    assert "no body in common" in error.message
    assert error.location is not None
    assert error.location.line == text.count("\n")


def test_a_drive_determines_the_torque_of_its_joint() -> None:
    text = BODIES.replace("crank.a)", "crank.a, torque=3)") + "  M: {drive: O, angle: t}\n"
    with pytest.raises(ModelError) as raised:
        load_text(text)
    (error,) = raised.value.diagnostics
    assert error.kind == "contradiction"
    assert "`torque`" in error.message
    assert "`lambda.M`" in (error.help or "")
    assert error.location is not None
    assert error.location.line == 7
