"""Text → Model: what every part of a file means, and which errors it brings."""

from __future__ import annotations

import copy
import math
import pickle
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import symengine as se

from lagcli.equations.derivation.lagrange import derive
from lagcli.equations.render import render
from lagcli.errors import ModelError, UsageError
from lagcli.model.diagnostics import MAX_DIAGNOSTICS
from lagcli.model.expression.tensors import Tensor
from lagcli.model.loader import load, load_text
from lagcli.model.model import Model

MODELS = Path(__file__).parents[3] / "models"

TEXT = """\
name: pendulum
description: on a rod
coordinates: {x: m, y: {unit: m, description: upward, latex: Y}}
parameters:
  m: 2 kg
  g: 9.81
  l: {value: 1/2 + m/4, unit: m, description: rod}
  angle: 30 deg
  d: 7 mm
  late: early + 1
  early: 2*l
definitions:
  speed: r'
  r: [x, y]
  height: {expr: y + l, description: above the lowest point}
T: m/2*dot(speed, speed)
V: m*g*height
Q: {x: -0.1*x', r: [0, 3]}
D: x'^2/2
constraints:
  rod: x^2 + y^2 = l^2
  knife: {expr: x'*y, description: none}
initial: {x: l*sin(angle), y: {guess: -1 m}, x_dot: 1, y': {guess: 2*m}}
outputs:
  tension: {expr: -2*lambda.rod*l, unit: N}
  pull: Qc.x + Qc.rod.y + x''
simulation: {t_end: 2*l, times: [0, 1/2, 1], method: Radau, through_singular: true, max_steps: 1e3}
"""


@pytest.fixture(scope="module")
def model() -> Model:
    return load_text(TEXT, "pendulum.yaml")


def diagnostics(text: str, **options: dict[str, object]) -> list[str]:
    try:
        load_text(text, "f", **options)
    except ModelError as error:
        return [
            f"{d.location.line if d.location else 0} {d.kind}: {d.message}"
            for d in error.diagnostics
        ]
    return []


def test_head(model: Model) -> None:
    assert (model.name, model.description) == ("pendulum", "on a rod")
    assert load_text(TEXT.replace("name: pendulum\n", ""), "a/b.yaml").name == "b"


def test_coordinates(model: Model) -> None:
    assert model.coordinate_names == ("x", "y")
    assert [c.unit for c in model.coordinates] == ["m", "m"]
    assert model.coordinates[1].description == "upward"
    assert model.coordinates[1].latex == "Y"


def test_parameters_are_in_si(model: Model) -> None:
    values = model.parameter_values
    assert list(values) == ["m", "g", "l", "angle", "d", "late", "early"]
    assert values["l"] == 1
    assert values["angle"] == math.radians(30)
    assert values["d"] == 0.007  # exactly: not 7*0.001
    assert (values["early"], values["late"]) == (2, 3)
    assert model.parameters["l"].description == "rod"
    assert model.parameters["m"].unit == "kg"


def test_definitions_may_be_vectors_and_stand_in_any_order(model: Model) -> None:
    assert list(model.definitions) == ["speed", "r", "height"]
    r = model.definitions["r"].value
    assert isinstance(r, Tensor)
    assert r.entries == (se.Symbol("x"), se.Symbol("y"))


def test_physics(model: Model) -> None:
    x, y, m, dx, dy = (se.Symbol(n) for n in ("x", "y", "m", "x'", "y'"))
    assert model.kinetic is not None
    assert se.expand(model.kinetic - m * (dx**2 + dy**2) / 2) == 0
    assert model.applied_forces == {"x": -dx / 10, "y": se.Integer(3)}
    assert model.dissipation == dx**2 / 2
    assert [c.kind for c in model.constraints] == ["holonomic", "nonholonomic"]
    assert model.constraints[0].expression == x**2 + y**2 - se.Symbol("l") ** 2


def test_a_lagrangian_is_minus_the_potential() -> None:
    text = "coordinates: [x]\nL: x'^2/2 - x\ninitial: {x: 0, x': 0}\n"
    model = load_text(text)
    assert model.kinetic is None
    assert se.expand(model.potential + se.Symbol("x'") ** 2 / 2 - se.Symbol("x")) == 0


def test_initial_values(model: Model) -> None:
    assert model.initial_positions["x"].fixed
    assert math.isclose(model.initial_positions["x"].value, 0.5, rel_tol=1e-15)
    assert not model.initial_positions["y"].fixed
    assert model.initial_velocities["y"].value == 4
    assert model.initial_velocities["x"].fixed


def test_outputs(model: Model) -> None:
    assert list(model.outputs) == ["tension", "pull"]
    assert model.output_units == {"tension": "N"}


def test_settings(model: Model) -> None:
    s = model.settings
    assert (s.t_end, s.times, s.method) == (2, (0, 0.5, 1), "Radau")
    assert s.through_singular is True
    assert s.max_steps == 1000
    assert isinstance(s.max_steps, int)
    assert s.samples is None


def test_overrides() -> None:
    model = load_text(TEXT, "f", {"m": "4 kg", "g": 1, "angle": "60 deg"}, {"y": 0.25, "y'": "m"})
    assert model.parameter_values["m"] == 4
    assert model.parameter_values["l"] == 1.5  # depends on m
    assert model.parameters["l"].description == "rod"
    assert model.initial_positions["y"].value == 0.25
    assert model.initial_positions["y"].fixed
    assert model.initial_velocities["y"].value == 4
    assert math.isclose(model.initial_positions["x"].value, 1.5 * math.sin(math.pi / 3))


@pytest.mark.parametrize("number", [0.1, 3, np.float64(0.1), np.float32(0.5), np.int64(3), 1e-300])
def test_numbers_from_python_keep_all_their_digits(number: float) -> None:
    model = load_text(TEXT, "f", {"g": number}, {"x_dot": number})
    assert model.parameter_values["g"] == number
    assert model.initial_velocities["x"].value == number


@pytest.mark.parametrize("number", [math.nan, math.inf, True, None, object()])
def test_what_is_no_number_from_python(number: object) -> None:
    assert diagnostics(TEXT, set={"g": number})


def test_whole_parameters_are_exact_in_parameters() -> None:
    text = "coordinates: [x]\nT: x'^2\ninitial: {x: 0, x': 0}\nparameters:\n"
    model = load_text(text + "  n: 3\n  a: (-8)^n\n  b: if(n == 3, 1, 2)\n  c: n/3 - 1\n")
    assert model.parameter_values == {"n": 3, "a": -512, "b": 1, "c": 0}


def test_order_of_the_keys_does_not_matter() -> None:
    blocks: list[str] = []
    for line in TEXT.splitlines(keepends=True):
        if line[0] == " ":
            blocks[-1] += line
        else:
            blocks.append(line)
    other = load_text("".join(reversed(blocks)))
    model = load_text(TEXT)
    assert other.kinetic == model.kinetic
    assert other.parameter_values == model.parameter_values
    assert other.initial_positions.keys() == model.initial_positions.keys()


@pytest.mark.parametrize("ending", ["\r\n", "\r"])
def test_line_ends(ending: str) -> None:
    assert load_text(TEXT.replace("\n", ending)).parameter_values["l"] == 1


def test_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    assert load(path).text == TEXT


def test_no_name_is_special() -> None:
    names = ["gamma", "S", "N", "E", "I", "Q", "beta", "zeta", "O", "lambda", "T", "e", "sin", "e1"]
    text = "coordinates: [" + ", ".join(names) + "]\n"
    text += "T: " + " + ".join(f"{n}'^2" for n in names) + "\nV: sin(sin)*I*E\n"
    text += "initial: {" + ", ".join(f"{n}: 0, {n}': 0" for n in names) + "}\n"
    model = load_text(text)
    assert model.coordinate_names == tuple(names)
    assert len(model.potential.free_symbols) == 3


def test_long_chains_of_definitions_in_any_order() -> None:
    count = 300
    chain = [f"  x_{i}: x_{i - 1} + sin(q + {i})\n" for i in range(1, count)]
    for lines in (chain, chain[::-1]):
        text = "coordinates: [q]\ndefinitions:\n  x_0: q\n" + "".join(lines)
        model = load_text(text + f"T: x_{count - 1}'^2\ninitial: {{q: 0, q': 0}}\n")
        assert len(model.definitions) == count


# errors


def test_no_errors_that_follow_from_others() -> None:
    text = TEXT
    for old, new in [
        ("m: 2 kg", "m: 2 kgg"),  # used in l, early, late, T, V, initial
        ("r: [x, y]", "r: [x, y"),
    ]:
        text = text.replace(old, new) if "r: [" not in old else text
    assert [d.split(":")[0] for d in diagnostics(text)] == ["5 unknown-unit"]
    text = TEXT.replace("r: [x, y]", 'r: "[x, y"')
    assert [d.split(":")[0] for d in diagnostics(text)] == ["14 syntax"]
    text = TEXT.replace("early: 2*l", "early: late")
    assert [d.split(":")[0] for d in diagnostics(text)] == ["10 circular"]
    text = TEXT.replace("coordinates: {", "coordinate: {")
    assert [d.split(":")[0] for d in diagnostics(text)] == ["3 unknown-key"]
    text = TEXT.replace("parameters:", "params:")
    assert [d.split(":")[0] for d in diagnostics(text)] == ["4 unknown-key"]


def test_all_errors_come_at_once_in_the_order_of_the_file() -> None:
    text = TEXT
    for old, new in [
        ("m: 2 kg", "m: 2,5"),
        ("height: {expr: y + l", "height: {expr: y l"),
        ("T: m/2", "T: mm/2"),
        ("x: -0.1*x'", "z: 1"),
        ("= l^2", "= l^"),
        ("x_dot: 1", "x_dt: 1"),
        ("lambda.rod", "lambda.rood"),
        ("Radau", "Radaus"),
    ]:
        assert old in text
        text = text.replace(old, new)
    found = diagnostics(text)
    lines = [int(d.split()[0]) for d in found]
    assert lines == sorted(lines)
    kinds = [d.split()[1].rstrip(":") for d in found]
    assert kinds == [
        *("syntax", "syntax", "unknown-name", "unknown-name", "syntax"),
        *("missing-initial", "unknown-name", "unknown-name", "bad-setting"),
    ]


def test_a_name_missing_often_is_reported_once() -> None:
    text = TEXT.replace("  g: 9.81\n", "").replace("V: m*g*height", "V: m*g*height + g")
    text = text.replace("expr: y + l", "expr: y + g").replace("-2*lambda", "-g*lambda")
    with pytest.raises(ModelError) as caught:
        load_text(text)
    (only,) = caught.value.diagnostics
    assert only.notes[0][0] == "also in lines 16, 24"
    assert only.location is not None
    assert only.location.line == 14


def test_the_number_of_errors_is_bounded() -> None:
    text = "coordinates: [x]\nT: x'^2\ninitial: {x: 0, x': 0}\nparameters:\n"
    text += "".join(f"  p{i}: 1 +\n" for i in range(1000))
    assert len(diagnostics(text)) == MAX_DIAGNOSTICS + 1


def test_a_hundred_thousand_keys() -> None:
    text = TEXT + "".join(f"key{i}: 1\n" for i in range(100_000))
    began = time.process_time()
    assert "too-many" in diagnostics(text)[-1]
    assert time.process_time() - began < 5  # 1.5 s alone; must not be quadratic


def calls_to_read(text: str) -> int:
    """Return how many functions of Python are called to read a text, valid or not."""
    count = 0

    def counted(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(counted)
    try:
        load_text(text)
    except ModelError:
        pass
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize("term", ["x", "x^2", "3*x*sin(x)"])
def test_the_work_is_proportional_to_the_number_of_terms(term: str) -> None:
    """Counts of calls are the same on every machine; a second measures what they hide."""

    def text(terms: int) -> str:
        sum_ = " + ".join([term] * terms)
        return f"coordinates: [x]\ninitial: {{x: 0, x': 0}}\nT: x'^2/2\nV: {sum_}\n"

    few, many = calls_to_read(text(250)), calls_to_read(text(2000))
    assert many < 8.2 * few
    began = time.process_time()
    load_text(text(4000))
    assert time.process_time() - began < 2  # 0.2 s alone


@pytest.mark.parametrize("term", ["x", pytest.param("x^2", marks=pytest.mark.slow), "3*x"])
def test_a_million_terms_are_rejected_before_they_are_read(term: str) -> None:
    text = f"coordinates: [x]\nT: x'^2/2\nV: {' + '.join([term] * 10**6)}\n"
    (found,) = diagnostics(text)
    assert "too-large: the model has more than 1,000,000 words" in found
    assert calls_to_read(text) < 1000
    lines = "".join(f"  a{i}: {'+'.join([term] * 100)}\n" for i in range(10_000))
    assert "too-large" in diagnostics(f"coordinates: [x]\nT: x'^2/2\noutputs:\n{lines}")[0]


@pytest.mark.parametrize("last", ["1000", "i + 900"])
def test_a_million_terms_of_sums_are_rejected_before_they_are_built(last: str) -> None:
    text = f"""coordinates: [x]
T: x'^2/2
V: sum(i*x + sum(x^2/(i + j), j = 1..{last}), i = 1..1000) + sum(i*x, i = 1..10)
initial: {{x: 0, x': 0}}
"""
    (found,) = diagnostics(text)
    assert "the sums of this expression have more than 100,000 terms" in found
    # building one term takes some hundred calls
    assert calls_to_read(text) < 1_000_000
    assert diagnostics(text.replace("i = 1..1000", "i = 1..3")) == []


@pytest.mark.parametrize("block", ["definitions", "constraints", "outputs", "parameters"])
def test_what_follows_an_open_parenthesis_is_no_second_error(block: str) -> None:
    start = "coordinates: [x]\nT: x'^2/2\ninitial: {x: 0, x': 0}\n"
    entries = "a: max(x, y: 2" if block != "parameters" else "a: max(1, x: 2"
    only = "4 syntax: `(` is not closed"
    assert diagnostics(f"{start}{block}: {{{entries}}}\n") == [only]
    # other lines, and what precedes it, are read as usual
    assert diagnostics(f"{start}{block}: {{3b: 1, {entries}}}\nq: 1\n")[1:2] == [only]
    assert len(diagnostics(f"{start}{block}: {{3b: 1, {entries}}}\nq: 1\n")) == 3


def test_a_constraint_that_is_expensive_to_expand() -> None:
    many = " + ".join(["x", "y", "x'", "y'", "t", "l", "m", "g", "1"])
    text = TEXT.replace("knife: {expr: x'*y", f"knife: {{expr: ({many})^300")
    began = time.process_time()
    assert load_text(text).constraints[1].kind == "nonlinear"
    assert time.process_time() - began < 1


def test_hidden_linearity_is_seen() -> None:
    text = TEXT.replace("knife: {expr: x'*y", "knife: {expr: (x' + 1)^2 - x'^2 + y'")
    assert load_text(text).constraints[1].kind == "nonholonomic"
    text = TEXT.replace("V: m*g*height", "V: m*g*height + (x' + 1)^2 - x'^2")
    assert diagnostics(text) == []


@pytest.mark.parametrize(
    "equation", ["x = x", "cos(x)^2 = 1 - sin(x)^2", "(x + y)^2 = x^2 + y^2 + 2*x*y", "m = 1"]
)
def test_constraints_that_constrain_nothing(equation: str) -> None:
    text = TEXT.replace("rod: x^2 + y^2 = l^2", f"rod: {equation}")
    assert [d.split(":")[0] for d in diagnostics(text)] == ["21 no-unknowns"]


def test_a_constraint_that_parameters_switch_off_is_unchanged() -> None:
    text = TEXT.replace("rod: x^2 + y^2 = l^2", "rod: (m - 2)*(x^2 + y^2 - l^2) = 0")
    assert diagnostics(text) == []


@pytest.mark.parametrize("path", sorted(MODELS.rglob("*.yaml")), ids=lambda p: p.stem)
def test_shipped_models_load(path: Path) -> None:
    began = time.process_time()
    model = load(path)
    assert time.process_time() - began < 1
    assert model.initial_positions.keys() == set(model.coordinate_names)
    assert model.initial_velocities.keys() == set(model.coordinate_names)


def with_length(unit: str) -> str:
    return (
        f"coordinates: [x]\nparameters: {{m: 1 kg, a: 30 {unit}}}\nT: m/2*x'^2\nV: m*a*x\n"
        "initial: {x: 0, x': 0}\n"
    )


def test_a_bare_number_replaces_a_value_given_in_si_and_keeps_its_unit() -> None:
    parameter = load_text(with_length("m/s^2"), set={"a": 2}).parameters["a"]
    assert (parameter.value, parameter.unit) == (2.0, "m/s^2")


def test_a_bare_number_for_a_value_in_another_unit_is_ambiguous() -> None:
    with pytest.raises(ModelError, match=r"write the unit: --set 'a=2 cm/s\^2'"):
        load_text(with_length("cm/s^2"), set={"a": 2})
    assert load_text(with_length("cm/s^2"), set={"a": "2 cm/s^2"}).parameters["a"].value == 0.02


def test_an_option_frees_an_initial_value_as_the_file_does() -> None:
    crank = Path(__file__).parents[3] / "models" / "slider_crank.yaml"
    model = load(crank, set_initial={"phi": " { guess : 30 deg } ", "psi": "{guess: 2*r/l}"})
    phi, psi = (model.initial_positions[name] for name in ("phi", "psi"))
    assert not phi.fixed
    assert not psi.fixed
    assert phi.value == math.radians(30)
    assert psi.value == pytest.approx(2 * 0.1 / 0.3, rel=1e-15)
    with pytest.raises(ModelError, match=r"has no value\n +\| \{guess: \}"):
        load(crank, set_initial={"phi": "{guess: }"})


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("t_end: 500 mm", "`t_end` is in mm, but must be in s"),
        ("times: [1 s, 2 m]", "a time of `times` is in m, but must be in s"),
        ("rtol: 1e-6 m", "`rtol` is in m, but must be a number"),
        ("samples: 100 s", "`samples` is in s, but must be a number"),
        ("alpha: 5 s", "`alpha` is in s, but must be in 1/s"),
    ],
)
def test_settings_have_units_of_their_dimension(entry: str, message: str) -> None:
    text = f"coordinates: [x]\nT: x'^2/2\ninitial: {{x: 0, x': 0}}\nsimulation: {{{entry}}}\n"
    with pytest.raises(ModelError) as caught:
        load_text(text)
    (found,) = caught.value.diagnostics
    assert found.message == message
    assert found.location is not None
    assert found.location.line == 4
    assert load_text(text.replace(entry, "t_end: 2 min")).settings.t_end == 120.0


@pytest.mark.parametrize(
    ("coordinates", "given", "entry"),
    [
        ("x[1..N]", "", "x[i = 1..N]: 0"),
        ("x[1..N]", "x[i = 1..N]: 0", "x[i = 1..N]': 0"),
        ("x[1..4]", "", "x[i = 1..4]: 0"),
        ("x[1..N]", "x[1]: 0, x[1]': 0", "x[i = 2..4]: 0"),
        ("x[1..N], i", "", "x[j = 1..N]: 0"),
    ],
)
def test_the_entries_proposed_for_missing_initial_values_are_valid(coordinates, given, entry):
    def text(initial):
        extra = "+ i'^2" if ", i" in coordinates else ""
        return (
            f"coordinates: [{coordinates}]\nparameters: {{N: 4}}\n"
            f"T: sum(x[k]'^2, k = 1..4) {extra}\ninitial: {{{initial}}}\n"
        )

    with pytest.raises(ModelError) as raised:
        load_text(text(given))
    (found,) = raised.value.diagnostics
    assert found.help.splitlines()[2].strip() == entry
    proposed = [f"{key}" for key in map(str.strip, found.help.splitlines()[2:])]
    assert load_text(text(", ".join([*([given] if given else []), *proposed])))


@pytest.mark.parametrize("argument", ["set", "set_initial"])
@pytest.mark.parametrize("values", ["m=2", ["m=2"], 3, {1: 2}])
def test_replaced_values_are_a_mapping_of_names(argument: str, values: object) -> None:
    with pytest.raises(UsageError, match=f"`{argument}` must be a dict such as"):
        load_text(TEXT, **{argument: values})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["slider_crank", "chain", "bouncing_ball", "four_bar"])
def test_models_and_equations_can_be_pickled_and_copied(name: str) -> None:
    for preset in (None, *(p.name for p in load(name).presets)):
        changed = load(name, preset=preset, set={"g": 3})
        for other in (pickle.loads(pickle.dumps(changed)), copy.deepcopy(changed)):
            assert other.parameter_values == changed.parameter_values
            values = {key: x.value for key, x in changed.initial.items()}
            assert {key: x.value for key, x in other.initial.items()} == values
            assert (other.name, other.text) == (changed.name, changed.text)
        equations = derive(changed)
        assert render(pickle.loads(pickle.dumps(equations))) == render(equations)


def test_a_pickled_model_keeps_the_tables_of_its_inputs(tmp_path: Path) -> None:
    (tmp_path / "u.csv").write_text("t,u\n0,1\n1,2\n")
    path = tmp_path / "model.yaml"
    path.write_text(
        "coordinates: [x]\ninputs: {u: {file: u.csv, time: t, column: u}}\nT: x'^2/2\nV: -u*x\n"
        "initial: {x: 0, x': 0}\n"
    )
    pickled = pickle.dumps(load(path))
    (tmp_path / "u.csv").unlink()
    assert pickle.loads(pickled).inputs["u"].data.values.tolist() == [1, 2]
