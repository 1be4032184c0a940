"""Derived columns: forces, energies, powers and residuals of samples against formulas by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lowered import lowered
from pendulum_by_hand import pendulum_system

import lagcli
from lagcli.engine.contract import Block
from lagcli.model.loader import load_text
from lagcli.settings.settings import SettingsOverrides
from lagcli.simulations.derived import NO_MONITOR, DerivedColumns, held_rows
from lagcli.simulations.simulation import prepare
from lagcli.trajectory.trajectory import Trajectory

G = 9.81
SYSTEM, P = lowered(
    lagcli.load_text(f"""
coordinates: [x, y]
parameters: {{m: 2.0}}
T: m*(x'^2 + y'^2)/2
V: {G}*m*y
Q: {{x: -0.5*x'}}
constraints:
  wheel: x' = t*y'
  rod: x^2 + y^2 = 1
initial: {{x: {{guess: 1}}, y: {{guess: 0}}, x': {{guess: 0}}, y': {{guess: 0}}}}
outputs: {{height: y + 1}}
""")
)
(M,) = P


def block(count: int = 6) -> Block:
    """Return samples of any numbers: they need not be those of a motion."""
    rng = np.random.default_rng(4)
    pairs = rng.normal(size=(4, count, 2))
    return Block(np.linspace(0.0, 1.0, count), *pairs, rng.normal(size=count))


def test_columns_by_hand() -> None:
    b = block()
    found = DerivedColumns(SYSTEM, P)(b)
    (x, y), (u, v), (wheel, rod) = b.q.T, b.v.T, b.multipliers.T
    # λ_i B_ij: by the wheel on x and y, by the rod on x and y
    np.testing.assert_allclose(
        found.constraint_force_by,
        np.column_stack([wheel, -b.time * wheel, 2 * x * rod, 2 * y * rod]),
        rtol=1e-13,
    )
    rolling, turning = u - b.time * v, 2 * (x * u + y * v)
    np.testing.assert_allclose(found.residual_velocity, np.column_stack([rolling, turning]))
    np.testing.assert_allclose(found.residual_position[:, 1], x * x + y * y - 1)
    assert np.isnan(found.residual_position[:, 0]).all()
    np.testing.assert_allclose(found.power_constraint, wheel * rolling + rod * turning)
    kinetic, potential = M * (u * u + v * v) / 2, G * M * y
    np.testing.assert_allclose(found.energy_kinetic, kinetic)
    np.testing.assert_allclose(found.energy_total, kinetic + potential)
    np.testing.assert_allclose(found.power_applied, -0.5 * u * u)
    forces = np.array([-0.5 * u + wheel + 2 * x * rod, -G * M - b.time * wheel + 2 * y * rod])
    defect = np.abs(M * b.a.T - forces).max(axis=0)
    np.testing.assert_allclose(found.residual_equation, defect, rtol=1e-12)
    np.testing.assert_allclose(found.outputs["height"], y + 1)
    balance = found.energy_total - b.work
    np.testing.assert_allclose(found.energy_balance, balance - balance[0], atol=1e-13)


def test_no_number_depends_on_how_samples_lie_in_blocks() -> None:
    whole = block()
    one, many = DerivedColumns(SYSTEM, P), DerivedColumns(SYSTEM, P)
    expected = one(whole)
    parts = [many(Block(*(column[a:b] for column in whole))) for a, b in ((0, 1), (1, 4), (4, 6))]
    for name in ("energy_balance", "constraint_force_by", "residual_equation", "power_constraint"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        np.testing.assert_array_equal(joined, getattr(expected, name), err_msg=name)
    assert one.samples == many.samples == 6
    np.testing.assert_array_equal(one.scale_velocity, many.scale_velocity)


def test_scales_are_the_largest_so_far() -> None:
    b = block()
    columns = DerivedColumns(SYSTEM, P)
    columns(b)
    position, velocity = columns.scale_position, columns.scale_velocity
    assert np.isnan(position[0])
    assert position[1] >= ((b.q**2).sum(axis=1) + 1).max() * (1 - 1e-15)
    assert velocity[0] >= (np.abs(b.v[:, 0]) + b.time * np.abs(b.v[:, 1])).max() * (1 - 1e-15)
    columns(Block(*(column[:0] for column in b)))
    np.testing.assert_array_equal(columns.scale_velocity, velocity)
    assert columns.samples == 6


def test_velocities_at_rest_are_compared_with_those_that_would_move_the_body() -> None:
    """A rod of length 1 at rest for 2 s, and rounding errors of its velocity."""
    model = lagcli.load_text("""
coordinates: [x, y]
T: (x'^2 + y'^2)/2
constraints: {rod: x^2 + y^2 = 1}
initial: {x: 0.6, y: 0.8, x': 0, y': 0}
""")
    columns = DerivedColumns(*lowered(model))
    for time in (0.0, 0.5, 2.0):  # a sample in each block
        at, rate = np.array([[0.6, 0.8]]), np.full((1, 2), 1e-16)
        zero, one = np.zeros((1, 2)), np.zeros((1, 1))
        columns(Block(np.array([time]), at, rate, zero, one, np.zeros(1)))
    # 2 (x² + y²) over 2 s
    np.testing.assert_allclose(columns.scale_velocity, 1.0, rtol=1e-12)


MODELS = Path(__file__).parents[3] / "models"


def test_the_columns_are_the_quantities() -> None:
    model = lagcli.load(MODELS / "charged_pendulum.yaml")
    run = lagcli.simulate(model, t_end=2.0, samples=21, rtol=1e-11)
    assert run.conserved_names == ("J_1",)
    assert run.conserved_formulas == {"J_1": "x*p_y - y*p_x"}
    # the model's own output, as its author wrote it
    np.testing.assert_allclose(
        run.conserved[:, 0], run.outputs["angular_momentum"], rtol=1e-13, atol=1e-15
    )
    assert np.ptp(run.conserved[:, 0]) < 1e-10


def test_a_drifting_formulation_shows_in_them() -> None:
    model = lagcli.load(MODELS / "heavy_top.yaml")
    tight, loose = (
        lagcli.simulate(model, t_end=0.2, samples=5, rtol=rtol).conserved for rtol in (1e-11, 1e-5)
    )
    assert np.abs(tight - tight[0]).max() < 1e-3 * np.abs(loose - loose[0]).max()


def test_the_value_is_that_of_the_closed_form() -> None:
    model = lagcli.load(MODELS / "knife_edge_incline.yaml")
    run = lagcli.simulate(model, t_end=0.5, samples=4)
    np.testing.assert_allclose(run.conserved, 0.2, rtol=1e-9)
    assert run.conserved_names == ("p_phi",)


def test_without_quantities_there_is_nothing_to_evaluate() -> None:
    model = lagcli.load(MODELS / "atwood.yaml")
    simulation = prepare(model, SettingsOverrides(t_end=0.1, samples=3))
    assert simulation.monitor is NO_MONITOR
    assert lagcli.simulate(model, t_end=0.1, samples=3).conserved.shape == (3, 0)


@pytest.mark.parametrize("suffix", [".h5", ".csv"])
def test_files_keep_them(tmp_path: Path, suffix: str) -> None:
    model = lagcli.load(MODELS / "bead_on_rotating_hoop.yaml")
    run = lagcli.simulate(model, t_end=0.5, samples=6)
    path = str(tmp_path / f"run{suffix}")
    lagcli.write(run, path, meta=suffix == ".csv")
    found = lagcli.read(path)
    assert found.conserved_names == ("jacobi",)
    assert found.conserved_formulas == {"jacobi": "h - 4*p_phi"}
    np.testing.assert_array_equal(found.conserved, run.conserved)


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
