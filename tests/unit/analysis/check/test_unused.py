"""Parameters that nothing in a model file uses."""

from __future__ import annotations

import pytest

import lagcli
from lagcli.analysis.check.description import page
from lagcli.analysis.check.unused import unused_parameters

MODEL = """
title: The lenght of a rod
coordinates: [x, y]
parameters:
  m: 1 kg
  length: {value: 3, unit: m, description: lenght}
  lenght: 2 m
  N: 2
  "k[i = 1..N]": 1
  s: 1 kg
  g: 9.81 m/s^2
T: m/2*(x'^2 + y'^2)
V: m*g*y
constraints: {rod: x^2 + y^2 = length^2}
initial: {x: 0, y: -3, x': 0, y': 0}
simulation: {sensitivity: [lenght]}
presets: {long: {parameters: {lenght: 3}}}
"""


def test_names_in_texts_units_and_settings_are_no_uses() -> None:
    model = lagcli.load_text(MODEL)
    assert unused_parameters(model) == {"lenght": ["length"], "k": [], "s": []}
    text = page(lagcli.check(model))
    assert "Nothing uses `lenght` (did you mean `length`?), `k`, `s`." in text


@pytest.mark.parametrize(
    "use",
    [
        "definitions: {h: s}",
        "outputs: {h: 2*s}",
        "view: {points: {P: [s, 0]}}",
        "D: s*x'^2",
        "functions: {f(u): u*s}",
        "events: {e: {when: x > s, stop: true}}",
    ],
)
def test_a_name_in_any_formula_is_a_use(use: str) -> None:
    text = MODEL.replace("[lenght]", "[m]")
    assert "s" not in unused_parameters(lagcli.load_text(f"{text}{use}\n"))
