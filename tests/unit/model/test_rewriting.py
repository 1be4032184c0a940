"""Other values in a model file's text: in the right places, everything else kept."""

from __future__ import annotations

import difflib
from pathlib import Path

import pytest
from shipped import PATHS, every_model

from lagcli.errors import ModelError
from lagcli.model.loader import load_text
from lagcli.model.rewriting import rewrite

MODELS = Path(__file__).parents[3] / "models"

TEXT = """\
coordinates: [x]   # a comment
parameters: {a: &mass 1 kg, b: *mass, c: {value: 20, unit: deg}, 'd': "3"}
T: a/2*x'^2
V: c*d*b*x
initial:
  x:
    guess: 1   # another
  # and one more
  x': 1
"""


def changes(text: str, *values: object) -> list[str]:
    """Return the lines that are new."""
    found = difflib.ndiff(text.splitlines(), rewrite(text, "model.yaml", *values).splitlines())
    return [line[2:].strip() for line in found if line.startswith("+ ")]


def shipped(name: str) -> str:
    return (MODELS / f"{name}.yaml").read_text(encoding="utf-8")


def test_values_stand_where_the_files_did_with_its_units_and_comments() -> None:
    new = changes(
        shipped("slider_crank"),
        {"m": "2", "tau": "0.05 N*m", "r": "l/3"},
        {"phi": "{guess: 0.3}", "psi": "0.2", "phi_dot": "3"},
        5.0,
    )
    assert new == [
        "m: {value: 2 kg, description: mass of A and of B}",
        "r: {value: l/3, description: crank OA}",
        "tau: {value: 0.05 N*m, description: torque on the crank}",
        "phi: {guess: 0.3 rad}",
        "phi': 3 rad/s",
        "psi: 0.2 rad   # the other solution of the constraint has the rod pointing backwards",
        "simulation: {t_end: 5, samples: 601, rtol: 1e-9}",
    ]


def test_expressions_over_several_lines_and_values_in_other_units() -> None:
    assert changes(shipped("rolling_disk"), {"S": "-3.5"}, {}) == ["value: -3.5"]
    assert changes(shipped("parallelogram"), {}, {"alpha_1": "-20 deg"}) == ["alpha_1: -20 deg"]


def test_a_member_of_a_range_gets_an_entry_of_its_own_even_one_that_is_new() -> None:
    new = changes(shipped("chain"), {"N": "30", "m[2]": "3", "m[25]": "4 kg"}, {"y[25]'": "0.1"})
    assert new == [
        "N: {value: 30, description: number of masses}",
        "m[2]: 3",
        "m[25]: 4 kg",
        "y[25]': 0.1 m/s",
    ]


def test_braces_lists_quotes_and_units_in_fields_of_their_own() -> None:
    assert changes(TEXT, {"c": "30 deg", "d": "4"}, {"x": "3"}, 4.0) == [
        "parameters: {a: &mass 1 kg, b: *mass, c: {value: 30, unit: deg}, 'd': 4}",
        "3   # another",
        "simulation: {t_end: 4}",
    ]
    assert changes(TEXT, {"c": "d/7"}, {"x'": "min(a, 3)"}) == [
        "parameters: {a: &mass 1 kg, b: *mass, c: {value: 24.55533407703528, unit: deg},"
        " 'd': \"3\"}",
        "x': 'min(a, 3)'",
    ]
    lists = "coordinates: [x]\nparameters: {k[1..3]: [1, 2, 3]}\nT: k[1]*x'^2\nV: k[2]*x\n"
    lists += "initial: {x: 0, x': 0}\nsimulation:\n  rtol: 1e-8"
    assert changes(lists, {"k[2]": "5"}, {"x'": "1"}, 3.5) == [
        "parameters: {k[1..3]: [1, 5, 3]}",
        "initial: {x: 0, x': 1}",
        "t_end: 3.5",
    ]


def test_windows_line_ends_stay() -> None:
    new = rewrite(TEXT.replace("\n", "\r\n"), "model.yaml", {"d": "4"}, {"x": "2"})
    assert new.count("\r\n") == TEXT.count("\n")
    assert load_text(new).parameters["d"].value == 4


def test_what_an_alias_denotes_is_not_changed_with_it() -> None:
    for name in ("a", "b"):
        with pytest.raises(ModelError, match=f"values of `{name}`"):
            rewrite(TEXT, "model.yaml", {name: "2"}, {})


def test_wrong_values_are_those_of_the_model() -> None:
    with pytest.raises(ModelError, match="no parameter `zz`"):
        rewrite(TEXT, "model.yaml", {"zz": "1"}, {})
    with pytest.raises(ModelError, match="division by zero"):
        rewrite(TEXT, "model.yaml", {"c": "1/(d - 3)"}, {})


def _unit(unit: str | None) -> str:
    """Return a unit as it follows a number: none after a pure number."""
    return "" if unit in (None, "1") else unit


@pytest.mark.parametrize("model_name", every_model())
def test_every_value_of_every_model_can_be_written(model_name: str) -> None:
    text = PATHS[model_name].read_text(encoding="utf-8")
    name = str(PATHS[model_name])
    model = load_text(text, name)
    # nearly one, as no number of members and any coefficient may be, in the unit of the file
    set_ = {
        name: str(p.value + 1) if p.structural else f"0.9375 {_unit(p.unit)}".strip()
        for name, p in model.parameters.items()
    }
    initial = {
        name: f"{{guess: 0.1875 {_unit(x.unit)}}}".replace(" }", "}")
        for name, x in model.initial.items()
    }
    # `rewrite` itself holds the result against the model with these options
    new = rewrite(text, name, set_, initial, 1.75)
    found = load_text(new, name)
    wanted = load_text(text, name, set_, initial)
    assert found.parameter_values == wanted.parameter_values
    assert {n: x[:2] for n, x in found.initial.items()} == {
        n: x[:2] for n, x in wanted.initial.items()
    }
    assert found.settings.t_end == 1.75
    comments = [line[line.index("#") :] for line in text.splitlines() if "#" in line]
    assert [line[line.index("#") :] for line in new.splitlines() if "#" in line] == comments


VECTORS = """\
coordinates: {r: point, e: quaternion, q[1..2]: point}
T: dot(r', r')/2 + dot(omega(e), omega(e))/2 + sum(dot(q[i]', q[i]')/2, i = 1..2)
initial:
  r: [1, 2, {guess: 3}]   # a comment
  e: {guess: rot_x(0.1)}
  q[1..2]: [[1, 2, 3], [4, 5, 6]]
  r': {guess: [0, 0, 0]}
  e': [0, 0, 1]
  q[1..2]': 0
"""


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"r.x": "5"}, "r: [5, 2, {guess: 3}]   # a comment"),
        ({"r.z": "{guess: 5}"}, "r: [1, 2, {guess: 5}]   # a comment"),
        ({"r.z": "5"}, "r: [1, 2, 5]   # a comment"),
        ({"r.x'": "5"}, "r.x': 5"),
        ({"r.x'": "{guess: 5}"}, "r.x': {guess: 5}"),
        ({"e.1": "0.5"}, "e.1: 0.5"),
        ({"e.1'": "0.5"}, "e.1': 0.5"),
        ({"q[2].y": "7"}, "q[1..2]: [[1, 2, 3], [4, 7, 6]]"),
        ({"q[2].y'": "7"}, "q[2].y': 7"),
        ({"r": "[7, 8, 9]"}, "r: '[7, 8, 9]'   # a comment"),
        ({"e'": "[1, 0, 0]"}, "e': '[1, 0, 0]'"),
    ],
)
def test_components_stand_in_their_vector_or_behind_it(values: dict[str, str], line: str) -> None:
    assert line in changes(VECTORS, {}, values)


def test_member_of_a_range_of_vectors_is_not_written() -> None:
    with pytest.raises(ModelError, match="cannot write the values of `q"):
        changes(VECTORS, {}, {"q[1]": "[1, 1, 1]"})


MACHINE = """\
gravity: [0, -9.81 m/s^2]
parameters: {c: 0.3 N*m*s}
bodies:
  ground: {points: {O: [0, 0], D: [0.4 m, 0]}}
  crank: {mass: 1 kg, length: 100 mm}   # a rod
  coupler:
    mass: 2 kg
    length: 450 mm
  rocker: {mass: 1.5, length: 0.3}
  'link[1..3]': {mass: 1, length: 0.1}
joints:
  O: revolute(ground.O, crank.a, damping=2 N*m*s, stiffness=c)
  A: revolute(crank.b, coupler.a)
  B: {revolute: [coupler.b, rocker.b], damping: 0.5 N*m*s}
  D: revolute(ground.D, rocker.a)
  L[i = 1..3]: revolute(ground.O, link[i].a)
"""


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("crank.length", "90 mm", "crank: {mass: 1 kg, length: 90 mm}   # a rod"),
        ("coupler.mass", "2.5", "mass: 2.5 kg"),
        ("gravity.y", "-1.6", "gravity: [0, -1.6 m/s^2]"),
        ("ground.points.D.x", "0.5", "ground: {points: {O: [0, 0], D: [0.5 m, 0]}}"),
        ("O.damping", "3", "O: revolute(ground.O, crank.a, damping=3 N*m*s, stiffness=c)"),
        ("O.stiffness", "2*c", "O: revolute(ground.O, crank.a, damping=2 N*m*s, stiffness=2*c)"),
        ("B.damping", "0.6", "B: {revolute: [coupler.b, rocker.b], damping: 0.6 N*m*s}"),
        ("crank.inertia", "0.01", "crank: {mass: 1 kg, length: 100 mm, inertia: 0.01}   # a rod"),
        ("coupler.inertia", "0.02 kg*m^2", "inertia: 0.02 kg*m^2"),
    ],
)
def test_numbers_of_bodies_and_joints_stand_where_they_are(
    name: str, value: str, line: str
) -> None:
    assert changes(MACHINE, {name: value}, {}) == [line]


def test_initial_values_of_placed_bodies_are_added() -> None:
    new = changes(MACHINE, {}, {"O.angle": "0.5", "rocker.phi": "{guess: 1.4}", "O.angle'": "2"})
    assert new == ["initial: {crank.phi: 0.5, rocker.phi: {guess: 1.4}, crank.phi': 2}"]
    given = MACHINE + "initial:\n  O.angle: 30 deg\n"
    assert changes(given, {}, {"crank.phi": "40 deg"}) == ["O.angle: 40 deg"]
    assert changes(given, {}, {"rocker.y": "{guess: 1}", "link[2].phi": "1"}) == [
        "rocker.y: {guess: 1}",
        "link[2].phi: 1",
    ]


def test_a_number_of_one_body_of_a_family_is_not_written() -> None:
    with pytest.raises(ModelError, match=r"cannot write the values of `link\[2\].mass`"):
        rewrite(MACHINE, "model.yaml", {"link[2].mass": "3"}, {})
