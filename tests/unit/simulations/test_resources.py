"""What the core needs to simulate a model elsewhere."""

from __future__ import annotations

import lagcli
from lagcli.simulations.resources import (
    DerivedTape,
    method_of,
    resources,
    settable_parameters,
)
from lagcli.simulations.simulation import prepare

#: A clock whose period is a parameter, by way of another one.
CLOCK = """\
parameters: {m: 1 kg, f: 10, period: 1/f, k: 4, u: 0}
coordinates: {x: m}
T: m/2*x'^2
V: k/2*x^2
initial: {x: 1, x': 0}
events:
  tick: {every: period, set: {u: x}}
simulation: {t_end: 1}
"""


def test_what_determines_a_clock_cannot_be_set() -> None:
    model = lagcli.load_text(CLOCK)
    assert settable_parameters(model) == ["m", "k", "u"]


def test_the_method_of_auto_is_that_of_a_run() -> None:
    assert method_of(prepare(lagcli.load("slider_crank"))) == "DOP853"


def test_the_same_model_gives_the_same_resources() -> None:
    found = []
    for _ in range(2):
        simulation = prepare(lagcli.load("bouncing_ball"))
        tape = DerivedTape(simulation.system)
        derived = tape.builder.finish([*tape.forces, *tape.reported])
        found.append(resources(simulation, "DOP853", derived))
    assert found[0] == found[1]
    assert found[0].model[:8] == b"lagmodel"
    assert found[0].values[:8] == b"llvalue2"
