"""Contacts, friction and events in derivations, in all formats."""

from __future__ import annotations

import json

import pytest

from lagcli.equations.derivation.lagrange import Equations, derive
from lagcli.equations.render import render
from lagcli.model.expression.grammar import parse
from lagcli.model.loader import load_text
from lagcli.simulations.start import degrees_of_freedom

BALL = """
coordinates: {x: m, y: m, phi: rad}
parameters: {m: 6 kg, r: 0.1 m, g: 9.81 m/s^2, mu: {value: 0.12, unit: "1"}, v: 2 m/s, F: 3 N}
T: m/2*(x'^2 + y'^2) + m*r^2/5*phi'^2
V: m*g*y
constraints:
  lane: {expr: y >= r, restitution: 1/2, friction: {static: 2*mu, kinetic: mu}, slip: x' - r*phi'}
  roof: y <= 2*r
  belt: {expr: x' = v, limit: F, active: false}
events:
  pull: {when: t >= 1 and not x > 3*r, engage: belt, times: 2}
  kick: {when: x' = 0, set: {x': 2*x', F: F/2}, impulse: {phi: m*r*v}}
  end: {when: lane slips, stop: true}
initial: {x: 0, y: r, phi: 0, x': 8, y': 0, phi': -20}
"""


@pytest.fixture(name="equations", scope="module")
def _equations() -> Equations:
    return derive(load_text(BALL))


def text_of(equations: Equations, **options: bool) -> str:
    found = render(equations, "text", freedom=degrees_of_freedom(equations), **options)
    return " ".join(found.split())


def test_complementarity_as_a_textbook_writes_it(equations: Equations) -> None:
    text = text_of(equations)
    assert "lane: 0 ≤ λ_lane ⊥ y − r ≥ 0" in text
    assert "ε = ½ coefficient of restitution" in text
    assert "roof: 0 ≤ −λ_roof ⊥ −y + 2 r ≥ 0" in text or "roof: 0 ≤ −λ_roof ⊥ 2 r − y ≥ 0" in text
    assert "lane: y ≥ r unilateral, scleronomic δy ≥ 0" in text


def test_laws_of_friction_and_limits(equations: Equations) -> None:
    text = text_of(equations)
    assert "lane.slip: ẋ − r φ̇ = 0 and |λ_lane.slip| ≤ 2 μ λ_lane sticks" in text
    assert "λ_lane.slip = −μ λ_lane sign(ẋ − r φ̇) slips" in text
    assert "λ_belt = −F sign(ẋ − v) slips λ_belt = 0 until an event engages it" in text


def test_table_of_events(equations: Equations) -> None:
    text = text_of(equations)
    assert "pull: t ≥ 1 and [not (x > 3 r)] engages belt, at most 2 times" in text
    assert "kick: ẋ = 0 ẋ = 2 ẋ set F = ½ F set Λ_phi = m r v impulse on phi" in text
    assert "end: lane slips stops the run" in text


@pytest.mark.parametrize(
    ("restitution", "sentence"),
    [
        ("", "Impacts are inelastic: ε = 0."),
        ("restitution: 1/2, ", "of compression. Where no ε is shown, it is 0."),
    ],
)
def test_law_of_impacts_with_and_without_restitution(restitution: str, sentence: str) -> None:
    model = BALL.replace("restitution: 1/2, ", restitution)
    assert sentence in text_of(derive(load_text(model)))


def test_friction_is_not_counted_as_a_constraint(equations: Equations) -> None:
    assert "Constraints: s = 3" in text_of(equations)


def test_degrees_of_freedom_are_of_what_holds(equations: Equations) -> None:
    assert "3 − 1 = 2 active at the start: lane" in text_of(equations)
    above = derive(load_text(BALL.replace("y: r,", "y: 1.5*r,")))
    assert "k = 3 no constraint is active at the start" in text_of(above)
    # a ball that rises or falls does not rest on the lane
    rising = derive(load_text(BALL.replace("y': 0,", "y': 1,")))
    assert "k = 3 no constraint is active at the start" in text_of(rising)


def test_steps_show_the_laws_too(equations: Equations) -> None:
    text = text_of(equations, steps=True)
    assert "0 ≤ λ_lane ⊥ y − r ≥ 0" in text
    assert "lane slips stops the run" in text


def test_latex_and_markdown(equations: Equations) -> None:
    for format_ in ("latex", "markdown"):
        found = render(equations, format_, freedom=degrees_of_freedom(equations))
        assert r"&0 \le \lambda_{\mathrm{lane}} \perp y - r \ge 0" in found
        assert r"\lambda_{\mathrm{lane,slip}}" in found
        assert r"\text{lane slips}" in found
        assert "[U+" not in found
        assert "u002E" not in found


def test_json(equations: Equations) -> None:
    content = json.loads(render(equations, "json", freedom=degrees_of_freedom(equations)))
    lane, slip, roof, belt = content["constraints"]
    assert [c["relation"] for c in (lane, slip, roof, belt)] == [">=", "=", "<=", "="]
    assert lane["written"] == r"y \ge r"
    assert lane["restitution"]["text"] == "0.5"
    assert slip["limit"]["normal"] == "lane"
    assert not belt["active"]
    pull, kick, end = content["events"]
    assert pull["engage"] == ["belt"]
    assert kick["either"]
    assert set(kick["set"]) == {"x'", "F"}
    assert end["change"] == ["lane.slip", "slips"]
    for formula in (pull["condition"], slip["limit"]["static"], *kick["set"].values()):
        parse(formula["text"])


def test_chetaevs_rule_is_reported_to_be_a_postulate() -> None:
    text = """
coordinates: [x, y]
parameters: {c: 5}
T: x'^2/2 + y'^2/2
V: 9.81*y
constraints: {speed: x'^2 + y'^2 = c^2}
initial: {x: 0, y: 0, x': 3, y': 4}
"""
    found = text_of(derive(load_text(text)))
    assert "speed: ẋ² + ẏ² = c² nonlinear in the velocities" in found
    assert "2 (ẋ δx + ẏ δy) = 0" in found
    assert "Chetaev's rule, a postulate" in found
    assert "ẍ = 2 λ ẋ" in found


def test_members_with_friction_have_names() -> None:
    text = """
coordinates: ["x[1..2]", "y[1..2]"]
T: sum(x[i]'^2 + y[i]'^2, i = 1..2)
V: sum(y[i], i = 1..2)
constraints: {"floor[i = 1..2]": {expr: "y[i] >= 0", friction: 0.3, slip: "x[i]'"}}
events: {"hit[i = 1..2]": {when: "floor[i] impacts", record: true}}
outputs: {f: "lambda.floor[1].slip + Qc.floor[2].slip.x[2]"}
initial: {"x[1..2]": 0, "y[1..2]": 0, "x[1..2]'": 1, "y[1..2]'": 0}
"""
    equations = derive(load_text(text))
    assert [e.change for e in equations.model.events] == [
        ("floor[1]", "impacts"),
        ("floor[2]", "impacts"),
    ]
    assert "λ_floor₁.slip" in text_of(equations)
    latex = render(equations, "latex")
    assert r"\lambda_{\mathrm{floor,slip},1}" in latex


GUIDED = """
coordinates: {x: m, y: m}
parameters: {m: 1 kg, l: 1 m, g: 9.81 m/s^2, mu: {value: 0.3, unit: "1"}}
definitions: {y_L: y - l*sin(x/l), x_L: x + y^2/l}
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints:
  rope: x^2 + y^2 <= l^2
  floor: {expr: y_L >= 0, friction: mu, slip: x_L'}
initial: {x: 0, y: 0, x': 0, y': 0}
"""


def test_gaps_and_slips_are_written_as_in_the_model():
    text = text_of(derive(load_text(GUIDED)), steps=True)
    assert "0 ≤ −λ_rope ⊥ l² − x² − y² ≥ 0" in text
    assert "0 ≤ λ_floor ⊥ y_L ≥ 0" in text
    assert "ẋ_L = 0 and |λ_floor.slip| ≤ μ λ_floor sticks" in text
    closing = text.split("Together with the constraint equations")[1]
    assert "floor: y_L ≥ 0" in closing  # it is an equation only while it is closed
    assert "unknowns" not in closing
