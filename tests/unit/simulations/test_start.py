"""The start of a run: why there is none."""

from __future__ import annotations

import numpy as np
import pytest
from kkt_systems import hand_written

import lagcli
from lagcli.engine.system import State
from lagcli.equations.derivation.lagrange import derive
from lagcli.errors import ModelError, NumericalError
from lagcli.simulations.simulation import Simulation, prepare
from lagcli.simulations.start import (
    ModelStart,
    degrees_of_freedom,
    determined_values,
    negative_inertia,
)

ROD = """name: a rod of length l
coordinates: [x, y]
parameters: {{l: {l}, m: 1, g: 9.81}}
T: m*(x'^2 + y'^2)/2
V: m*g*y
constraints:
  rod: {rod}
initial: {{x: {{guess: 0.3}}, y: {{guess: 0.4}}, x': {{guess: 0}}, y': {{guess: 0}}}}
simulation: {{t_end: 1, samples: 3}}
"""
FORMS = ("x^2 + y^2 = l^2", "norm([x, y]) = l", "1e6*(x^2 + y^2) = 1e6*l^2")


@pytest.mark.parametrize("rod", FORMS)
def test_a_rod_of_no_length_is_rejected_with_its_line(rod: str) -> None:
    """Its force has no direction, and the projection would follow rounding errors."""
    text = ROD.format(l=0, rod=rod)
    with pytest.raises(NumericalError) as caught:
        lagcli.simulate(lagcli.load_text(text))
    (found,) = caught.value.diagnostics
    assert "the constraint `rod` holds only where it has no gradient" in found.message
    assert found.location is not None
    assert found.location.line == 7


@pytest.mark.parametrize("length", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("rod", FORMS)
def test_a_short_rod_is_none(rod: str, length: float) -> None:
    """However far the guess: 0.5 m."""
    text = ROD.format(l=length, rod=rod)
    t = lagcli.simulate(lagcli.load_text(text), t_end=0.01 * length**0.5)
    assert t.status == "completed", t.message
    assert abs((t.q**2).sum(axis=1) ** 0.5 / length - 1).max() < 1e-9


def test_a_constraint_whose_terms_vanish_keeps_its_gradient() -> None:
    text = ROD.format(l=0, rod="x = 0\n  other: sin(y) = l")
    t = lagcli.simulate(lagcli.load_text(text))
    assert t.status == "completed", t.message
    assert abs(t.multipliers[:, 1] - 9.81).max() < 1e-12


def test_a_zero_row_at_the_start_is_reported_with_its_line() -> None:
    text = ROD.format(l=0, rod=FORMS[0])
    text = text.replace("{guess: 0.3}", "0").replace("{guess: 0.4}", "0")
    t = lagcli.simulate(lagcli.load_text(text))
    assert t.status == "failed"
    assert "the constraint `rod` has no gradient there" in t.message
    assert t.message.endswith("`rod` is on line 7 of the model")


def test_a_start_is_found_once_and_has_the_rank_of_its_constraints() -> None:
    start = ModelStart(derive(lagcli.load_text(ROD.format(l=0.5, rod=FORMS[0]))))
    assert start.consistent is start.consistent
    # the nearest point of the circle
    assert start.consistent.state.q.tolist() == pytest.approx([0.3, 0.4])
    assert (start.freedom.rank, start.freedom.degrees) == (1, 1)


def test_without_a_start_the_rank_is_not_known() -> None:
    text = ROD.format(l=1, rod=FORMS[0]).replace("{guess: 0.3}", "3").replace("{guess: 0.4}", "0")
    equations = derive(lagcli.load_text(text))
    assert degrees_of_freedom(equations).rank is None
    with pytest.raises(ModelError):
        _ = ModelStart(equations).consistent


@pytest.mark.parametrize("seed", range(40))
def test_inertia_is_negative_where_an_eigenvalue_is(seed: int) -> None:
    """Blocks of coupled coordinates in any order, some of them indefinite or without inertia."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 15))
    block = rng.integers(0, 5, n)
    root = rng.normal(size=(n, n)) * (block[:, None] == block)
    mass = root @ np.diag(rng.choice([1.0, 2.0, 0.0, -0.5], n, p=[0.6, 0.25, 0.1, 0.05])) @ root.T
    mass *= np.outer(*2 * [10.0 ** rng.integers(-3, 4, n)])  # in any units
    system, p = hand_written(mass, np.empty((0, n)), np.zeros(n))
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(mass)), 1e-300))
    least = np.linalg.eigvalsh(mass * np.outer(scale, scale))[0]
    found = negative_inertia(system, State(0.0, np.zeros(n), np.zeros(n), tuple(p)), 0)
    assert bool(found) == (least < -1e-9)


@pytest.mark.parametrize(
    ("name", "initial", "expected"),
    [
        ("slider_crank", {}, ["psi", "psi'"]),
        ("slider_crank", {"phi": "{guess: 0.5}"}, ["psi'"]),  # either angle is free
        ("slider_crank", {"psi": "0.160497", "phi": "{guess: 0.5}"}, ["phi", "psi'"]),
        ("pendulum_cartesian", {}, None),
        ("double_pendulum_cartesian", {}, None),
    ],
)
def test_guesses_that_the_constraints_determine(
    name: str, initial: dict[str, str], expected: list[str] | None
) -> None:
    def started(**guesses: str) -> Simulation:
        return prepare(lagcli.load(name, set_initial=initial | guesses))

    simulation = started()
    model, start = simulation.model, simulation.start
    found = determined_values(model, simulation.system, start)
    guesses = [key for key, value in model.initial.items() if not value.fixed]
    assert found == (guesses if expected is None else expected)
    # moving any other guess moves the start, moving these does not
    for guess in guesses:
        state = started(**{guess: f"{{guess: {model.initial[guess].value + 0.01}}}"}).start.state
        away = max(abs(state.q - start.state.q).max(), abs(state.v - start.state.v).max())
        assert (away < 1e-9) == (guess in found), guess
