"""First-order coordinates, damped without mass: closed forms and the matrix exponential."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import lagcli
from lagcli.errors import ModelError, UsageError

COUPLED = """
coordinates: [x, y]
parameters: {m: 2, k: 4, c: 3}
T: m/2*y'^2
V: k/2*x^2 + k/2*(y - x)^2
D: c/2*x'^2
initial: {x: 1, y: 0.5, x': {guess: 0}, y': 0}
simulation: {t_end: 2, samples: 21}
"""


def test_overdamped_spring_decays_exponentially() -> None:
    text = """
coordinates: [x]
parameters: {k: 4, c: 2, F: 3}
T: 0
V: k/2*x^2
D: c/2*x'^2
Q: {x: F}
initial: {x: 1, x': {guess: 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=2, samples=11)
    expected = 0.75 + 0.25 * np.exp(-2 * run.time)
    assert np.allclose(run.q[:, 0], expected, atol=1e-9)
    assert np.allclose(run.v[:, 0], -2 * (expected - 0.75), atol=1e-8)
    assert np.abs(run.multipliers).max() < 1e-12
    assert np.abs(run.energy_balance).max() < 1e-8


@pytest.mark.parametrize("options", [{}, {"method": "Taylor"}])
def test_maxwell_body_is_a_linear_system_of_third_order(options: dict[str, str]) -> None:
    run = lagcli.simulate(lagcli.load_text(COUPLED), **options)
    m, k, c = 2, 4, 3
    matrix = np.array([[-2 * k / c, k / c, 0], [0, 0, 1], [k / m, -k / m, 0]])
    exact = np.array([expm(matrix * t) @ [1, 0.5, 0] for t in run.time])
    assert np.allclose(run.q, exact[:, :2], atol=1e-8)
    assert np.allclose(run.v[:, 1], exact[:, 2], atol=1e-8)


def test_several_overdamped_particles_share_a_damper() -> None:
    """c (x' − y') = −k x and c (y' − x') + d y' = 0: the damper between x and y slides."""
    text = """
coordinates: [x, y]
parameters: {k: 4, c: 3, d: 2}
T: 0
V: k/2*x^2
D: c/2*(x' - y')^2 + d/2*y'^2
initial: {x: 1, y: 0, x': {guess: 0}, y': {guess: 0}}
"""
    run = lagcli.simulate(lagcli.load_text(text), t_end=1, samples=11)
    rate = 4 * (1 / 3 + 1 / 2)  # dampers in series
    x = np.exp(-rate * run.time)
    assert np.allclose(run.q[:, 0], x, atol=1e-9)
    assert np.allclose(run.q[:, 1], -2 / rate * (1 - x), atol=1e-9)


def test_equation_is_named_and_reported() -> None:
    model = lagcli.load_text(COUPLED)
    assert model.constraint_names == ("x.rate",)
    text = lagcli.render(lagcli.derive(model))
    assert "the equation of a first-order coordinate; its multiplier is 0" in text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("D: c/2*x'^2", "D: c/4*x'^4"), "is not linear in the velocities"),
        (("D: c/2*x'^2", "D: c/2*x'^2\nQ: {x: -lambda.h}"), "depends on multipliers"),
    ],
)
def test_balances_that_are_not_linear_are_rejected(change: tuple[str, str], words: str) -> None:
    text = COUPLED.replace("initial:", "constraints: {h: y = 0.5}\ninitial:")
    with pytest.raises(ModelError, match=words):
        lagcli.load_text(text.replace(*change))


def test_massless_coordinates_with_a_constraint_stay_as_they_are() -> None:
    text = COUPLED.replace("initial:", "constraints: {h: x = y}\ninitial:")
    assert lagcli.load_text(text).constraint_names == ("h",)


def test_equilibria_with_first_order_coordinates_are_rejected() -> None:
    with pytest.raises(UsageError, match="`x` is a first-order coordinate"):
        lagcli.equilibrium(lagcli.load_text(COUPLED))
