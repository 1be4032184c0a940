"""What residuals count: those of rows that hold."""

import numpy as np
import pytest
from pendulum_by_hand import pendulum_system

import lagcli
from lagcli.engine.contract import Block
from lagcli.engine.held_rows import held_rows
from lagcli.model.loader import load_text
from lagcli.trajectory.trajectory import Trajectory

BALL = """
coordinates: {x: m, y: m}
parameters: {m: 1 kg, g: 10 m/s^2, mu: 0.2, k: 0 N/m}
T: m/2*(x'^2 + y'^2)
V: m*g*y + k/2*x^2
constraints:
  floor: {expr: y >= 0, friction: mu, slip: x'}
events:
  spring: {when: t >= 1.25, set: {k: 1}}
initial: {x: 0, y: 1.25, x': 1.5, y': 0}
simulation: {t_end: 2, samples: 41}
"""


@pytest.fixture(scope="module")
def run() -> Trajectory:
    """A ball that falls for 0.5 s, and slides with 2 m/s² from 0.5 m/s to rest at 0.75 s."""
    return lagcli.simulate(load_text(BALL), method="DOP853", rtol=1e-11)


def test_open_contacts_have_no_residual(run: Trajectory) -> None:
    # a sample is at 0.5 s, before or after the impact, as rounding has it
    falls, slides = run.time < 0.49, run.time > 0.51
    assert np.isnan(run.residual_position[falls, 0]).all()
    assert np.abs(run.residual_position[slides, 0]).max() < 1e-15
    assert (run.multipliers[falls] == 0).all()


def test_friction_has_a_residual_where_it_sticks(run: Trajectory) -> None:
    held = ~np.isnan(run.residual_velocity[:, 1])
    # it sticks from 0.75 s on: without a force up to the spring, at 1.25 s, and with one then
    assert not held[run.time < 0.74].any()
    assert held[run.time > 1.26].all()


def test_the_energy_balances_through_all_of_it(run: Trajectory) -> None:
    """The impact, with its friction; sliding; the parameter that is set."""
    assert run.warnings == ()
    scale = 10 * 1.25 + 0.5 * 1.5**2
    assert np.abs(run.energy_balance).max() < 1e-9 * scale
    assert run.energy_total[-1] > run.energy_total[run.time < 1.25][-1] + 0.01  # of the spring
    assert run.residual_equation.max() < 1e-12


def test_constraints_of_a_system_that_does_not_switch_hold() -> None:
    system = pendulum_system()
    block = Block.of_rows(np.zeros((2, system.sample_layout.size)), system.sample_layout)
    assert held_rows(system, (), block).all()


def test_forces_that_depend_on_multipliers_are_part_of_the_equations() -> None:
    text = (
        BALL.split("constraints:")[0]
        + """
constraints:
  guide: y = 0
Q: {x: -0.1*abs(lambda.guide)}
initial: {x: 0, y: 0, x': 1.5, y': 0}
simulation: {t_end: 1, samples: 5}
"""
    )
    run = lagcli.simulate(load_text(text), method="DOP853")
    np.testing.assert_allclose(run.a[:, 0], -1.0)
    assert run.residual_equation.max() < 1e-14
    assert np.abs(run.energy_balance).max() < 1e-12
