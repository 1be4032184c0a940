"""Vectors and rotations as coordinates: names, constraints, initial values, errors."""

from __future__ import annotations

import numpy as np
import pytest

import lagcli
from lagcli.errors import ModelError
from lagcli.model.values import dependent_values

MODEL = """
coordinates: {{r: point, e: quaternion, q[1..2]: point, u[1..2, 1..2]: m, phi: rad}}
parameters: {{m: 1 kg, l: 2 m, a: 30 deg, w: 3 rad/s, k: 1 kg*m^2}}
definitions:
  b: [l, 0, 0]
T: >
  body(m, diag(k, k, k), r, e) + k/2*phi'^2 + sum(m/2*dot(q[i]', q[i]')
  + sum(m/2*u[i,j]'^2, j = 1..2), i = 1..2)
constraints:
  {constraint}
initial:
  {initial}
outputs: {{out: {output}}}
"""
START = {
    "r": "[1, 2, 3]",
    "r'": "0",
    "e": "1",
    "e'": "0",
    "q[1..2]": "[0, 0, 0]",
    "q[1..2]'": "0",
    "u[1..2, 1..2]": "0",
    "u[1..2, 1..2]'": "0",
    "phi": "0",
    "phi'": "0",
}


def text(constraint: str = "c: phi = 0", output: str = "0", **changes: str) -> str:
    """Return a model with some initial values changed."""
    return with_start({**START, **changes}, constraint, output)


def with_start(start: dict[str, str | None], constraint: str = "c: phi = 0", output: str = "0"):
    entries = [f"{name}: {value}" for name, value in start.items() if value is not None]
    return MODEL.format(constraint=constraint, initial="\n  ".join(entries), output=output)


def load(source: str, **options):
    return lagcli.load_text(source, **options)


def values(model: lagcli.Model, *names: str) -> list[float]:
    return [model.initial[name].value for name in names]


def test_kinds_declare_coordinates_in_groups() -> None:
    names = load(text()).coordinate_names
    assert names[:7] == ("r.x", "r.y", "r.z", "e.0", "e.1", "e.2", "e.3")
    assert names[7:13] == tuple(f"q[{i}].{x}" for x in "xyz" for i in (1, 2))
    assert names[13:] == ("u[1,1]", "u[1,2]", "u[2,1]", "u[2,2]", "phi")


def test_points_are_in_metres_where_the_model_has_units() -> None:
    units = [c.unit for c in load(text()).coordinates[:7]]
    assert units == ["m"] * 3 + ["1"] * 4
    bare = "coordinates: {r: point}\nT: dot(r', r')/2\ninitial: {r: 0, r': 0}"
    assert [c.unit for c in load(bare).coordinates] == [None] * 3


def test_quaternion_brings_its_constraint() -> None:
    model = load(text())
    assert model.constraint_names == ("c", "e.unit")
    assert str(model.constraints[1].expression).count("**2") == 4


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("[1, 2, 3]", [1, 2, 3]),
        ("[1 cm, l/2, 0]", [0.01, 1, 0]),
        ("l*[1, 0, 2]", [2, 0, 4]),
        ("rot_z(90 deg)*[l, 0, 0]", [0, 2, 0]),
        ("0", [0, 0, 0]),
        ("{guess: [1, 2, 3]}", [1, 2, 3]),
        ("[0, {guess: 4}, 0]", [0, 4, 0]),
    ],
)
def test_points_start_anywhere(value: str, expected: list[float]) -> None:
    model = load(text(r=value))
    assert np.allclose(values(model, "r.x", "r.y", "r.z"), expected, atol=1e-15)
    fixed = [model.initial[f"r.{x}"].fixed for x in "xyz"]
    if value.startswith("{"):
        assert not any(fixed)
    else:
        assert fixed == [True, "guess" not in value, True]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("1", [1, 0, 0, 0]),
        ("[0.5, 0.5, 0.5, 0.5]", [0.5] * 4),
        ("rot_z(90 deg)", [np.sqrt(0.5), 0, 0, np.sqrt(0.5)]),
        ("rot_z(a)*rot_x(2*a)", [np.cos(np.pi / 12) * np.cos(np.pi / 6)] + [None] * 3),
        ("transpose(rot_y(a))", [np.cos(np.pi / 12), 0, -np.sin(np.pi / 12), 0]),
        ("rot([0, 0, 3], a)", [np.cos(np.pi / 12), 0, 0, np.sin(np.pi / 12)]),
        ("quat(0, 1, 0, 0)", [0, 1, 0, 0]),
    ],
)
def test_rotations_start_by_their_quaternion(value: str, expected: list[float | None]) -> None:
    found = values(load(text(e=value)), "e.0", "e.1", "e.2", "e.3")
    assert np.linalg.norm(found) == pytest.approx(1, abs=1e-15)
    for x, wanted in zip(found, expected, strict=True):
        assert wanted is None or x == pytest.approx(wanted, abs=1e-15)


def test_derivative_of_a_rotation_is_its_angular_velocity() -> None:
    start = {**START, "e": "rot_z(a)*rot_x(20 deg)", "e'": "[1, w, -2 rad/s]"}
    out = "omega(e).x + 10*omega(e).y + 100*omega(e).z"
    run = lagcli.simulate(load(with_start(start, output=out)), t_end=1e-3, samples=2)
    assert run.outputs["out"][0] == pytest.approx(1 + 30 - 200, abs=1e-12)


def test_members_of_families_have_lists() -> None:
    start = {
        **START,
        "q[1..2]": "[[1, 2, 3], l*[4, 5, 6]]",
        "q[1..2]'": "[1, 0, 0]",
        "u[1..2, 1..2]": "[1, 2, 3, {guess: 4}]",
        "u[1..2, 1..2]'": None,
        "u[i = 1..2, j = 1..2]'": "10*i + j",
    }
    model = load(with_start(start))
    assert values(model, "q[1].z", "q[2].x", "q[2].z") == [3, 8, 12]
    assert values(model, "q[1].x'", "q[2].x'", "q[2].y'") == [1, 1, 0]
    assert values(model, "u[1,2]", "u[2,1]", "u[2,2]") == [2, 3, 4]
    assert values(model, "u[1,2]'", "u[2,1]'") == [12, 21]
    assert not model.initial["u[2,2]"].fixed


def test_component_overrides_its_vector_and_member_its_family() -> None:
    start = {**START, "r.y": "7", "q[2].x": "8", "q[2]'": "[0, 0, 9]", "e.1'": "0.25"}
    model = load(with_start(start))
    assert values(model, "r.x", "r.y", "q[1].x", "q[2].x") == [1, 7, 0, 8]
    assert values(model, "q[2].z'", "e.1'", "e.2'") == [9, 0.25, 0]


def test_options_give_vectors_and_components() -> None:
    given = {
        "r": "[4, 5, 6]",
        "r.y": 1,
        "q[2]": "{guess: [1, 1, 1]}",
        "e": "rot_x(180 deg)",
        "e'": "[2, 0, 0]",
        "u[1,2]": "3",
    }
    model = load(text(), set_initial=given)
    assert values(model, "r.x", "r.y", "r.z", "q[2].y", "u[1,2]") == [4, 1, 6, 1, 3]
    assert np.allclose(values(model, "e.0", "e.1", "e.0'", "e.1'"), [0, 1, -1, 0], atol=1e-15)
    assert not model.initial["q[2].x"].fixed


def test_initial_values_of_vectors_follow_parameters() -> None:
    start = {**START, "r": "l*[1, 0, 0]", "e": "rot_z(a)", "e'": "[0, 0, w]"}
    found = dependent_values(load(with_start(start)), {"l", "a", "w"})
    assert str(found["r.x"]) in ("l", "1.0*l")
    at = {"a": 0.5, "w": 4.0}
    rate = found["e.3'"].subs(at)
    assert float(rate) == pytest.approx(2 * np.cos(0.25), abs=1e-14)


@pytest.mark.parametrize(
    ("constraint", "names"),
    [
        ("pin: r = q[1]", "pin.x pin.y pin.z"),
        ("pin: r - b = 0", "pin.x pin.y pin.z"),
        ("pin: [r.x, phi*l]", "pin.x pin.y"),
        ("pin: [r.x, r.y, r.z, phi*l] = 0", "pin.1 pin.2 pin.3 pin.4"),
        ("pin[i = 1..2]: q[i] = i*b", "pin[1].x pin[2].x pin[1].y pin[2].y pin[1].z pin[2].z"),
        ("pin: [r.x, 0*r.y, l - l] = 0", "pin.x"),
        ("turn: e = rot_z(phi)", "turn.x turn.y turn.z"),
        ("none[i = 1..2, j = 1..2]: u[i, j] = 0", "none[1,1] none[1,2] none[2,1] none[2,2]"),
        ("roll: r' = cross([0, 0, phi'], r)", "roll.x roll.y roll.z"),
    ],
)
def test_vector_constraints_are_one_per_component(constraint: str, names: str) -> None:
    model = load(text(constraint))
    assert model.constraint_names == (*names.split(), "e.unit")


def test_components_that_always_hold_are_left_out_and_reported() -> None:
    model = load(text("pin: [r.x, r.y - r.y, phi*l] = [0, 0, 0]"))
    assert model.left_out == ("pin.y",)
    assert "coordinates: pin.y." in lagcli.render(lagcli.derive(model))


def test_names_with_dots_are_those_of_outputs() -> None:
    source = text("pin: r = q[1]", output="lambda.pin.x + Qc.pin.y.r.y + Qc.r.z + Qc.q[1].x")
    expression = load(source).outputs["out"]
    names = {"lambda.pin.x", "Qc.pin.y.r.y", "Qc.r.z", "Qc.q[1].x"}
    assert {s.name for s in expression.free_symbols} == names


def test_forces_act_along_points() -> None:
    source = text().replace("constraints:", "Q: {r: [0, 0, -5 N]}\nconstraints:")
    source = source.replace("-5 N", "-m*l*w^2")
    assert str(load(source).applied_forces["r.z"]) == "-l*m*w**2"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"r": "[1, 2]"}, "must be a vector of 3, not a list of 2"),
        ({"r": "5"}, "must be a vector of 3, not a scalar"),
        ({"r": "[1, 2]*l"}, "must be a vector of 3, not a vector of 2"),
        ({"r": None}, "no initial value for `r`"),
        ({"e": None, "e_dot": None}, "  e: 1"),
        ({"e": "[1, 0, 0]"}, "the four components of a quaternion"),
        ({"e": "2"}, "must be a rotation"),
        ({"e": "[0, 1, 0]*l"}, "must be a rotation"),
        ({"e": "diag(1, 1, 1)"}, "the quaternion of a matrix is not known"),
        ({"e_dot": "[1, 0, 0, 0]"}, "the angular velocity in the frame of the body"),
        ({"e_dot": "rot_z(1)"}, "the angular velocity in the frame of the body"),
        ({"q[1..2]": "[[1, 2, 3]]"}, "has 2 members, but its list has 1 value"),
        ({"u[1..2, 1..2]": "[1, 2, 3]"}, "has 4 members, but its list has 3 values"),
        ({"r.w": "1"}, "not a coordinate"),
        ({"q[3]": "[1, 2, 3]"}, "there is only `q[1..2]`"),
        ({"r": "[phi, 0, 0]"}, "cannot depend on coordinates"),
        ({"r": "[1 kg, 0, 0]"}, "units"),
    ],
)
def test_wrong_initial_values(changes: dict[str, str | None], words: str) -> None:
    start: dict[str, str | None] = {**START}
    start.update({name.replace("_dot", "'"): value for name, value in changes.items()})
    with pytest.raises(ModelError) as caught:
        load(with_start(start))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("constraint", "words"),
    [
        ("c: r = [1, 2]", "a vector of 3 cannot be equal to a vector of 2"),
        ("c: r = phi", "a vector of 3 cannot be equal to a scalar"),
        ("c: r = 1", "a vector of 3 cannot be equal to a scalar"),
        ("c: e = 2*e", "between rotations only"),
        ("c: [[phi, 0], [0, phi]] = 0", "between rotations only"),
        ("c: r = r", "it constrains nothing"),
        ("c: [r.x, 1]", "neither a coordinate nor a velocity"),
        ("c[i = 1..2, j = 1..2]: u[i, 1] = 0", "the same for every index"),
        ("c[i = 1..2, j = 1..2, k = 1..2]: u[i, 1] = 0", "at most two indices"),
        ("c: u[1] = 0", "`u[1]`"),
        ("c: u[3, 1] = 0", "there is only `u[1..2, 1..2]`"),
    ],
)
def test_wrong_vector_constraints(constraint: str, words: str) -> None:
    with pytest.raises(ModelError) as caught:
        load(text(constraint))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("coordinates", "words"),
    [
        ("r: {kind: vector}", "the kinds are `point` and `quaternion`"),
        ("lambda: point", "cannot be the name of a point"),
        ("r: point, b: point", "`b` is declared twice"),
        ("'x[1..2]': point, 'x[0]': m", "twice"),
    ],
)
def test_wrong_kinds(coordinates: str, words: str) -> None:
    source = f"coordinates: {{{coordinates}}}\nparameters: {{b: 1 m}}\nT: 1\ninitial: {{}}"
    with pytest.raises(ModelError) as caught:
        load(source)
    assert words in str(caught.value)


def test_a_quaternion_coordinate_needs_no_quat() -> None:
    with pytest.raises(ModelError) as raised:
        lagcli.load_text(text(output="'dot(quat(e)*[1, 0, 0], [1, 0, 0])'"))
    (found,) = raised.value.diagnostics
    assert found.message == "`quat` takes 4 arguments, not 1"
    assert found.help == (
        "a quaternion coordinate is a rotation already: write `e` if `e` is one; else name the four"
        " components"
    )
    with pytest.raises(ModelError) as raised:
        lagcli.load_text(text(output="'dot(quat(1, 0)*[1, 0, 0], [1, 0, 0])'"))
    assert raised.value.diagnostics[0].help is None


BODY = """
coordinates: {{r: point, e: quaternion}}
parameters: {{m: 1 kg, J: 2 kg*m^2}}
definitions:
  S: {matrix}
  R: e*S
T: body(m, diag(J, J, J), r, e)
{more}
initial: {{r: 0, r': 0, e: {start}, e': 0}}
"""
TURNED = "[[{0}, -0.5, 0], [0.5, {0}, 0], [0, 0, 1]]"
GUESS = "{guess: 1}"


def body(matrix: str, more: str = "", start: str = GUESS) -> lagcli.Model:
    return lagcli.load_text(BODY.format(matrix=matrix, more=more, start=start))


@pytest.mark.parametrize("digits", ["0.8660254037844387", "0.866025403784439"])
def test_a_matrix_rounded_to_a_double_is_a_rotation(digits: str) -> None:
    model = body(TURNED.format(digits), "constraints: {weld: e = S}\nQ: {R: [0, 0, 3]}")
    run = lagcli.simulate(model, t_end=0.1, samples=2)
    half = np.pi / 12
    np.testing.assert_allclose(run.q[:, 3:], [[np.cos(half), 0, 0, np.sin(half)]] * 2, atol=1e-14)
    torques = dict(zip(run.constraints, run.multipliers[0], strict=True))
    assert torques["weld.z"] == pytest.approx(-3, abs=1e-12)


@pytest.mark.parametrize(
    ("more", "start"),
    [
        ("constraints: {weld: e = S}", GUESS),
        ("constraints: {weld: S = e}", GUESS),
        ("Q: {R: [0, 0, 3]}", GUESS),
        ("outputs: {o: S.0}", GUESS),
        ("", TURNED.format("0.866")),
    ],
)
def test_of_a_matrix_with_fewer_digits_the_nearest_rotation_is_named(more: str, start: str) -> None:
    with pytest.raises(ModelError) as caught:
        body(TURNED.format("0.866"), more, start)
    named = "quat(0.9659241824876161, 0, 0, 0.258825179775134)"
    assert named in str(caught.value)
    model = body(named, more, start if start == GUESS else named)  # the help is accepted
    assert lagcli.simulate(model, t_end=0.1, samples=2).status == "completed"
