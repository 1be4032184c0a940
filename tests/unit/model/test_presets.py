"""Presets: the same model as with their values on the command line, and their errors."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.errors import ModelError, UsageError
from lagcli.model.model import Model
from lagcli.play.controls import controls
from lagcli.play.presets import presets
from lagcli.settings.settings import resolve

MODEL = """\
coordinates: {x: m, y: m, phi: rad, e: quaternion}
parameters:
  m: {value: 1 kg, min: 0.5, max: 3}
  l: 30 cm
  g: 9.81 m/s^2
  A: 1 kg*m^2
  N: 2
  k[1..N]: 3 N/m
  h: 2*l
definitions: {w: omega(e)}
T: m/2*(x'^2 + y'^2) + A/2*phi'^2 + A/2*dot(w, w)
V: m*g*y + sum(k[i], i = 1..N)/2*h*x
constraints: {rod: x^2 + y^2 = l^2}
initial:
  x: 18 cm
  y: {guess: -24 cm}
  x': 0 m/s
  y': {guess: 0 m/s}
  phi: 20 deg
  phi': 1 rad/s
  e: 1
  e': [0, 0, 2 rad/s]
"""
LAST = MODEL.count("\n") + 2  # the line of the first preset


def with_presets(text: str) -> str:
    return f"{MODEL}presets:\n{text}\n"


def same(one: Model, other: Model) -> None:
    assert one.parameter_values == other.parameter_values
    assert {k: (x.value, x.fixed) for k, x in one.initial.items()} == {
        k: (x.value, x.fixed) for k, x in other.initial.items()
    }
    assert one.spins == other.spins


@pytest.mark.parametrize(
    ("preset", "set", "set_initial"),
    [
        ("{parameters: {m: 2 kg}}", {"m": "2"}, {}),
        ("{parameters: {l: 40 cm}}", {"l": "0.4*1 m"}, {}),
        ("{parameters: {'k[1..2]': [5 N/m, 6 N/m]}}", {"k[1]": "5", "k[2]": "6"}, {}),
        ("{parameters: {'k[1..N]': 7}}", {"k[1]": "7", "k[2]": "7"}, {}),
        ("{initial: {x: 2*l, phi_dot: 3 rad/s}}", {}, {"x": "2*l", "phi'": "3"}),
        ('{initial: {y: 24 cm, "x\'": {guess: 1}}}', {}, {"y": "24 cm", "x'": "{guess: 1}"}),
        ("{initial: {e: rot_x(30 deg)}}", {}, {"e": "rot_x(30 deg)"}),
        ("{initial: {e: {guess: [1, 0.5, 0, 0]}}}", {}, {"e": "{guess: [1, 0.5, 0, 0]}"}),
        (
            "{initial: {e: [0.6, {guess: 0.8}, 0, 0]}}",
            {},
            {"e.0": "0.6", "e.1": "{guess: 0.8}", "e.2": "0", "e.3": "0"},
        ),
        ('{initial: {"e\'": [1, 2 rad/s, 120 deg/s]}}', {}, {"e'": "[1, 2, 2*pi/3]"}),
        (
            "{parameters: {h: 3*l}, initial: {e': {guess: [0, A, 1]}}}",
            {"h": "3*l"},
            {"e'": "{guess: [0, A, 1]}"},
        ),
    ],
)
def test_a_preset_is_its_values_on_the_command_line(
    preset: str, set: dict[str, str], set_initial: dict[str, str]
) -> None:
    text = with_presets(f"  some text, with a comma: {preset}")
    loaded = lagcli.load_text(text, preset="some text, with a comma")
    same(
        loaded,
        lagcli.load_text(
            MODEL,
            set={k: x.replace("0.4*1 m", "40 cm") for k, x in set.items()},
            set_initial=set_initial,
        ),
    )
    same(loaded, lagcli.load_text(text, set=loaded.set, set_initial=loaded.set_initial))
    same(lagcli.load_text(text), lagcli.load_text(MODEL))


def test_other_values_replace_those_of_a_preset() -> None:
    text = with_presets(
        "  a: {description: Some, parameters: {m: 2 kg, l: 40 cm},"
        " initial: {x: 24 cm, phi': 5, e: [0, 1, 0, 0], e': [0, 1, 0]}}"
    )
    [preset] = lagcli.load_text(text).presets
    assert (preset.name, preset.description) == ("a", "Some")
    given = {"x": "1 cm", "phi_dot": "7", "e": "rot_z(1)", "e.0'": "3"}
    model = lagcli.load_text(text, set={"m": "3"}, set_initial=given, preset="a")
    assert model.set == {"l": "40 cm", "m": "3"}
    assert model.set_initial == {"e'": "[0, 1, 0]", **given}
    assert model.initial["e.0'"].value == 3


def test_a_preset_that_does_not_exist_is_named() -> None:
    with pytest.raises(UsageError, match="no preset `heavi`; did you mean `heavy`"):
        lagcli.load_text(with_presets("  heavy: {parameters: {m: 2}}"), preset="heavi")
    with pytest.raises(UsageError, match="no preset `a`; it has none"):
        lagcli.load_text(MODEL, preset="a")


def test_a_preset_of_members_that_are_not_there_now_is_refused_when_it_is_taken() -> None:
    text = with_presets("  a: {parameters: {'k[2]': 5, m: 2}}\n  b: {parameters: {m: 2}}")
    assert lagcli.load_text(text, set={"N": 1}).parameter_values["m"] == 1
    assert lagcli.load_text(text, set={"N": 1}, preset="b").parameter_values["m"] == 2
    with pytest.raises(ModelError, match=r"preset `a`: the model has no parameter `k\[2\]`"):
        lagcli.load_text(text, set={"N": 1}, preset="a")
    with pytest.raises(ModelError):
        lagcli.load_text(text.replace("k[2]", "k[3]"))


CHAIN = """\
coordinates: ["x[1..N]", "y[1..N]"]
parameters: {N: 3, m: 1 kg, l: 100 mm, g: 9.81 m/s^2}
T: sum(m/2*(x[i]'^2 + y[i]'^2), i = 1..N)
V: sum(m*g*y[i], i = 1..N)
initial: {"x[i = 1..N]": i*l, "y[1..N]": 0, "x[1..N]'": 0, "y[1..N]'": 0}
presets:
  hang: {initial: {"x[1..N]": 0, "y[i = 1..N]": -i*l}}
  long: {parameters: {l: 300 mm}, initial: {"x[1..N]": 0, "y[i = 1..N]": -i*l}}
"""


@pytest.mark.parametrize("members", [2, 3, 5])
@pytest.mark.parametrize("given", [None, 0.2])
@pytest.mark.parametrize("name", ["hang", "long"])
def test_a_preset_follows_the_values_that_are_given_with_it(
    members: int, given: float | None, name: str
) -> None:
    set = {"N": members} | ({"l": f"{given} m"} if given else {})
    model = lagcli.load_text(CHAIN, set=set, preset=name)
    length = given or (0.3 if name == "long" else 0.1)
    values = {q: x.value for q, x in model.initial.items() if x.value}
    assert values == pytest.approx({f"y[{i + 1}]": -(i + 1) * length for i in range(members)})


@pytest.mark.parametrize("members", [2, 5])
def test_pages_have_presets_in_place_of_the_values_that_were_given(members: int) -> None:
    model = lagcli.load_text(CHAIN, set={"N": members, "l": "200 mm"}, set_initial={"x[1]": 1})
    [hang, long] = presets(model, controls(model, resolve(model.settings)))
    for preset, length in ((hang, 0.2), (long, 0.3)):
        state = {name: float(value["text"]) for name, value in preset["state"]}
        for i in range(1, members + 1):
            assert (state[f"x[{i}]"], state[f"y[{i}]"]) == (0, pytest.approx(-i * length))


@pytest.mark.parametrize(
    ("preset", "column", "message", "remedy"),
    [
        ("{parameters: {mm: 2}}", 20, "no parameter `mm`", "did you mean `m`"),
        ("{parameters: {m: 2 cm}}", 23, "is in kg in the file, and in cm here", "give it in kg"),
        ("{parameters: {m: 5 kg}}", 23, "`m` is above its `max`", "choose another value"),
        ("{parameters: {m: 0.2}}", 23, "`m` is below its `min`", "choose another value"),
        ("{parameters: {l: 3}}", 23, "without a unit here", "`l: 3 cm`"),
        ("{parameters: {phi: 3}}", 20, "is an initial value", "under `initial`"),
        ("{parameters: {w: 3}}", 20, "`w` is a definition", "presets set"),
        ("{parameters: {k: 3}}", 20, "`k` is a family", "`k[1]`"),
        ("{parameters: {N: 3}}", 20, "the number of members depends", "--set"),
        ("{parameters: {'k[i=1..2]': i}}", 20, "cannot depend on an index", "`k[1..3]`"),
        ("{parameters: {'k[1..2]': [3]}}", 31, "2 members, but its list has 1", "one value"),
        ("{parameters: {m: {value: 3}}}", 23, "must be a number or an expression", "write"),
        ("{parameters: {m: 2 kgg}}", 25, "kgg", "units are"),
        ("{parameters: {g: 1/0}}", 25, "division by zero", ""),
        ("{initial: {phi: 3 kg}}", 22, "must be in rad, not in kg", "give it in rad"),
        ("{initial: {x: 2*m}}", 20, "must be in m, not in kg", "give it in m"),
        ("{initial: {z: 3}}", 17, "`z`", "the coordinates are"),
        ("{initial: {rod: closed}}", 17, "`rod: closed` is none", "write it under"),
        ("{initial: {e: [1, 0]}}", 20, "not a list of 2", "rot_z"),
        ('{initial: {"e\'": [{guess: 0}, 1, 2]}}', 23, "and some are guesses", "fix"),
        ("{foo: 1, parameters: {m: 1}}", 7, "no field `foo`", "its fields are"),
        ("{description: nothing}", 3, "has no values", "give it"),
        ("3", 6, "must be a mapping", "presets:"),
    ],
)
def test_mistakes_are_located(preset: str, column: int, message: str, remedy: str) -> None:
    with pytest.raises(ModelError) as found:
        lagcli.load_text(with_presets(f"  a: {preset}"), "file.yaml")
    [one] = found.value.diagnostics
    assert message in one.message
    assert "preset `a`" in one.render()
    assert remedy in (one.help or "")
    assert one.location is not None
    assert (one.location.line, one.location.column) == (LAST, column)


def test_mistakes_in_several_presets_are_reported_together() -> None:
    with pytest.raises(ModelError) as found:
        lagcli.load_text(with_presets("  a: {parameters: {q: 1}}\n  b: {initial: {x: 1 s}}"))
    assert len(found.value.diagnostics) == 2
