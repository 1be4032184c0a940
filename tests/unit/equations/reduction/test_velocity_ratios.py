"""Velocity ratios of mechanisms with one degree of freedom, against the engine's accelerations."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest
from random_cases import FUZZ_COUNT

import lagcli
from lagcli.equations.presentation.assembly import Contents, shown_steps
from lagcli.equations.presentation.formulas import Formulas
from lagcli.equations.reduction.velocity_ratios import velocity_ratios
from lagcli.errors import LagcliError
from lagcli.model.loader import load, load_text

MODELS = Path(__file__).parents[4] / "models"
COUNT = FUZZ_COUNT // 5
#: Two four-bars in a row, and a slider driven by the second, with masses that depend on positions.
TWO_LOOPS = """\
coordinates: [a, b, c, e, s]
parameters: {r: 0.3, l: 1, h: 0.7, d: 0.9, m: 2, J: 0.4, g: 9.81, k: 3, w: 0.2}
T: J/2*a'^2 + m/2*(r*a' + l*b'*cos(a - b))^2 + m/2*(1 + w*sin(c))*c'^2 + m/2*s'^2 + J/2*e'^2
V: m*g*(r*sin(a) + l*sin(b)) + k/2*s^2
Q: {a: 2 - 0.3*a', s: -0.5*s'*s'^2, c: 0.1*sin(a)}
constraints:
  x: r*cos(a) + l*cos(b) = d + h*cos(c)
  y: r*sin(a) + l*sin(b) = h*sin(c)
  slide: s = h*cos(c) + l*cos(e)
  level: h*sin(c) = l*sin(e)
initial: {a: 1.0, a': 2, b: {guess: 0.5}, c: {guess: 1.2}, e: {guess: 0.7}, s: {guess: 1},
  b': {guess: 0}, c': {guess: 0}, e': {guess: 0}, s': {guess: 0}}
"""
#: Shipped models and their independent coordinate, if its velocity can be given.
CASES = {"four_bar": "theta_1", "slider_crank": "phi", "parallelogram": None}


def assert_accelerations(model: lagcli.Model) -> None:
    """Compare (Q − ½ J′ q̇²)/J, and k q̈ + k′ q̇², with the accelerations of the engine."""
    e = lagcli.derive(model)
    r = velocity_ratios(lagcli.partition(e))
    assert r is not None
    run = lagcli.simulate(model, t_end=1e-6, samples=2)
    known = {x: float(y) for x, y in zip((*e.q, *e.v), (*run.q[0], *run.v[0]), strict=True)}
    known |= {s: float(v) for s, v in _parameters(e).items()}

    def value(expression) -> float:
        return float(expression.subs(known).subs({"t": 0.0}).n(real=True))

    rate = run.v[0][r.independent]
    k, dk = {r.independent: 1.0}, {r.independent: 0.0}
    for values, names, numbers in (
        (r.ratios, r.names, k),
        (r.derivatives, r.derivative_names, dk),
    ):
        for i, (above, below) in values.items():
            numbers[i] = known[names[i]] = value(above) / value(below)
    acceleration = (value(r.force) - value(r.inertia_rate) * rate**2 / 2) / value(r.inertia)
    # projection onto the constraints leaves some 1e-9 of the sizes
    for i, expected in enumerate(run.a[0]):
        found = k[i] * acceleration + dk[i] * rate**2
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(run.a[0]).max())
        assert k[i] * rate == pytest.approx(run.v[0][i], rel=1e-6, abs=1e-7)


def _parameters(e):
    symbols = {s.name: s for x in (e.lagrangian, *e.applied_forces) for s in x.free_symbols}
    symbols |= {s.name: s for c in e.constraints for s in c.position.free_symbols}
    given = e.model.parameter_values
    return {symbol: given[name] for name, symbol in symbols.items() if name in given}


def random_case(seed: int) -> lagcli.Model | None:
    """Return a mechanism with random parameters; None if it cannot be assembled."""
    draw = random.Random(seed)
    name = draw.choice(["two", *CASES])

    def near(x: float) -> str:
        return repr(x * draw.uniform(0.9, 1.1))

    try:
        if name == "two":
            parameters = {"r": 0.3, "l": 1, "h": 0.7, "d": 0.9, "m": 2, "J": 0.4, "w": 0.2}
            chosen = {x: near(y) for x, y in parameters.items()}
            start = {"a": near(draw.uniform(0.2, 1.5)), "a'": near(draw.uniform(-5, 5))}
            return load_text(TWO_LOOPS, set=chosen, set_initial=start)
        free = CASES[name]
        model = load(MODELS / f"{name}.yaml")
        chosen = {x: near(y) for x, y in model.parameter_values.items() if y and free}
        start = {} if free is None else {f"{free}'": near(draw.uniform(-5, 5))}
        return load(MODELS / f"{name}.yaml", set=chosen, set_initial=start)
    except LagcliError:
        return None


def test_one_degree_of_freedom_moves_as_the_engine_says() -> None:
    assert_accelerations(load_text(TWO_LOOPS))
    assert_accelerations(load(MODELS / "four_bar.yaml"))


@pytest.mark.fuzz
def test_random_mechanisms_move_as_the_engine_says() -> None:
    done = 0
    for seed in range(COUNT):
        model = random_case(seed)
        try:
            if model is None or lagcli.simulate(model, t_end=1e-6, samples=2).status != "completed":
                continue
        except LagcliError:
            continue  # cannot be assembled
        assert_accelerations(model)
        done += 1
    assert done > COUNT / 2


def test_a_long_second_kind_is_printed_with_velocity_ratios() -> None:
    model = load(MODELS / "four_bar.yaml")
    e = lagcli.derive(model)
    text = lagcli.render(e, kinds=("second",), partition=lagcli.partition(e))
    assert "k[θ₂] = −a sin(θ₁ − θ₃)/[b sin(θ₂ − θ₃)]" in text
    assert "J θ̈₁ + ½ J′ θ̇₁² = τ − " in text
    assert "z₁" not in text
    latex = lagcli.render(e, "latex", kinds=("second",), partition=lagcli.partition(e))
    assert r"k'_{\theta_{2}}" in latex or r"k'_{\theta_2}" in latex
    full = Contents(("second",), lagcli.partition(e), full=True)
    assert all(s.title != "Velocity ratios" for s in shown_steps(Formulas(e), full))


@pytest.mark.parametrize(
    "change",
    [
        ("level: h*sin(c) = l*sin(e)", "level: h*sin(c) = l*sin(e) + 0.01*t"),  # time
        ("slide: s = h*cos(c) + l*cos(e)", "slide: s' = -h*sin(c)*c' - l*sin(e)*e'"),  # velocities
        ("J/2*e'^2", "J/2*e'^2 + w*e'"),  # a term linear in velocities
        ("  level: h*sin(c) = l*sin(e)\n", ""),  # two degrees of freedom
    ],
)
def test_other_systems_have_no_velocity_ratios(change: tuple[str, str]) -> None:
    text = TWO_LOOPS.replace(*change)
    assert text != TWO_LOOPS
    e = lagcli.derive(load_text(text))
    assert velocity_ratios(lagcli.partition(e)) is None
