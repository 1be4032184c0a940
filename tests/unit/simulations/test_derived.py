"""Derived columns: forces, energies, powers and residuals of samples against formulas by hand."""

from __future__ import annotations

import numpy as np
from lowered import lowered

import lagcli
from lagcli.engine.contract import Block
from lagcli.simulations.derived import DerivedColumns

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
