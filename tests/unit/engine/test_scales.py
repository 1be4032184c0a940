"""Scales of constraints and sizes of coordinates: what they are, and what must not matter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lagcli
from lagcli.engine.linear import dense
from lagcli.engine.scales import (
    LEAST_PART,
    coordinate_sizes,
    largest,
    least_scales,
    least_scales_of_entries,
    row_lengths,
)
from lagcli.simulations.simulation import prepare

FOUND = Path(__file__).parents[2] / "found"


def random_case(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return inertias, B with zeros, and coordinates."""
    random = np.random.default_rng(seed)
    jacobian = random.normal(size=(4, 6)) * (random.random((4, 6)) > 0.3)
    return random.uniform(0.5, 2, 6), jacobian, random.normal(size=6)


def test_least_scales_by_hand() -> None:
    inertia, jacobian = np.array([4.0, 1.0]), np.array([[3.0, 0.0], [0.0, 2.0]])
    # the first coordinate is zero: as large as the second, by its inertia
    found = least_scales(inertia, jacobian, np.array([0.0, 5.0]))
    np.testing.assert_allclose(found, [LEAST_PART * 3.0 / 2.0 * 5.0, 10.0])
    # without inertia there is nothing to compare it by
    found = least_scales(np.array([0.0, 1.0]), jacobian, np.array([0.0, 5.0]))
    np.testing.assert_allclose(found, [0.0, 10.0])


@pytest.mark.parametrize("seed", range(5))
def test_units_change_scales_as_they_change_residuals(seed: int) -> None:
    inertia, jacobian, x = random_case(seed)
    random = np.random.default_rng(100 + seed)
    columns, rows = 10.0 ** random.uniform(-6, 6, 6), 10.0 ** random.uniform(-6, 6, 4)
    mass = 1e6
    before = least_scales(inertia, jacobian, x)
    scaled = rows[:, None] * jacobian / columns
    after = least_scales(mass * inertia / columns**2, scaled, x * columns)
    np.testing.assert_allclose(after, rows * before, rtol=1e-12)
    sizes = coordinate_sizes(inertia, jacobian)
    other = coordinate_sizes(mass * inertia / columns**2, scaled)
    np.testing.assert_allclose(other, sizes * columns / np.sqrt(mass), rtol=1e-12)
    terms = np.abs(jacobian) @ np.abs(x)
    lengths = row_lengths(jacobian, sizes, terms, largest(x, sizes))
    one = dense.singular_values(jacobian, lengths, sizes)
    lengths = row_lengths(scaled, other, rows * terms, largest(x * columns, other))
    np.testing.assert_allclose(dense.singular_values(scaled, lengths, other), one, atol=1e-12)


def test_scales_of_entries_and_of_many_states() -> None:
    inertia, jacobian, x = (
        np.array([a, b]) for a, b in zip(*map(random_case, (1, 2)), strict=True)
    )
    pattern = tuple((i, j) for i in range(4) for j in range(6))
    entries = jacobian.reshape(2, -1).T
    expected = [least_scales(*one) for one in zip(inertia, jacobian, x, strict=True)]
    np.testing.assert_allclose(least_scales(inertia, jacobian, x), expected)
    found = least_scales_of_entries(inertia.T, pattern, entries, 4, x.T)
    np.testing.assert_allclose(found.T, expected, rtol=1e-14)


def test_coordinates_without_inertia_are_as_large_as_their_rows_say() -> None:
    jacobian = np.array([[2.0, 4.0, 0.0, 0.0], [0.0, 1.0, 5.0, 0.0]])
    sizes = coordinate_sizes(np.array([4.0, 0.0, 0.0, 0.0]), jacobian)
    # 2·(1/2) = 4·s; then 1·s = 5·s'; nothing is known of the last
    np.testing.assert_allclose(sizes, [0.5, 0.25, 0.05, 1.0])


def test_a_quaternion_has_one_unit() -> None:
    system = prepare(lagcli.load(FOUND / "door_one_hinge.yaml")).system
    assert (3, 4, 5, 6) in system.same_unit
    # none along itself
    inertia = system.inertia(np.array([1.0, 1.0, 1.0, 1e-33, 2.0, 4.0, 3.0]))
    np.testing.assert_array_equal(inertia, [1.0, 1.0, 1.0, 4.0, 4.0, 4.0, 4.0])


QUATERNION_AT_REST = """
coordinates: [x, y, z, a, b, c, d]
definitions:
  R: quat(a, b, c, d)
  w: omega(R)
  r: [x, y, z]
  E: r + R*[0.6, 0.1, 0.2]
T: dot(r', r')/2 + dot(w, w)/20
V: 9.81*dot([0.3, 0.5, 0.8], r)
constraints:
  unit: a^2 + b^2 + c^2 + d^2 = 1
  px: dot([1, 0, 0], E) = 0
  py: dot([0, 1, 0], E) = 0
  pz: dot([0, 0, 1], E) = 0
  again: 2*dot([0, 0, 1], E) = 0
initial:
  x: {guess: -0.6}
  y: {guess: 0.1}
  z: {guess: 0.2}
  a: {guess: 6.123233995736766e-17}
  b: {guess: 1}
  c: {guess: 0}
  d: {guess: 0}
  x': {guess: 0}
  y': {guess: 0}
  z': {guess: 0}
  a': {guess: 0}
  b': {guess: 0}
  c': {guess: 0}
  d': {guess: 0}
simulation: {t_end: 1, samples: 11}
"""


def test_rounding_errors_in_the_inertia_of_a_quaternion() -> None:
    """After a half turn its component along itself has 1e-33 of inertia."""
    t = lagcli.simulate(lagcli.load_text(QUATERNION_AT_REST))
    assert t.status == "completed", t.message
    # of lengths near 1 and, of `again`, 2
    assert (t.scale_position < 10).all()
    assert np.abs(t.residual_position).max() <= 1e-14


def test_a_row_of_zeros_at_the_start_need_not_be_singular() -> None:
    """A Bennett linkage that lies flat: two of its redundant conditions have no gradient there."""
    text = (FOUND / "bennett.yaml").read_text(encoding="utf-8")
    text = text.replace("q[1]: 1.2", "q[1]: 0").replace("q[2]: {guess: 2}", "q[2]: {guess: pi}")
    text = text.replace("q[3]: {guess: -1.2}", "q[3]: {guess: 0}")
    text = text.replace("q[4]: {guess: -2}", "q[4]: {guess: -pi}")
    t = lagcli.simulate(lagcli.load_text(text), t_end=0.5, samples=11)
    assert t.status == "completed", t.message
    assert np.abs(t.q[-1] - t.q[0]).max() > 0.1
    np.testing.assert_allclose(t.energy_total, t.energy_total[0], atol=1e-8)


def test_a_constraint_without_any_gradient_is_rejected() -> None:
    text = "coordinates: [x, y]\nT: (x'^2 + y'^2)/2\nV: y\nconstraints: {c: (x - y)^2 = 0}\n"
    t = lagcli.simulate(lagcli.load_text(text + "initial: {x: 1, y: 1, x': 0, y': 0}\n"), t_end=1)
    assert t.status == "failed"
    assert "the constraint `c` has no gradient there" in t.message


CLOSE_TO_ZERO = """
coordinates: [x, phi]
parameters: {{l: 2}}
T: (x'^2 + phi'^2)/2
V: 0
constraints: {{c: {constraint}}}
initial: {{x: {{guess: 0}}, phi: {phi}, x': {{guess: 0}}, phi': 1}}
simulation: {{t_end: 1, samples: 3}}
"""


@pytest.mark.parametrize("phi", [0.0, 1e-30, 1e-17, 1e-9])
@pytest.mark.parametrize("constraint", ["x + l*cos(phi) = l", "1e6*x + 1e6*l*cos(phi) = 1e6*l"])
def test_coordinates_that_are_zero_except_for_rounding_are_no_scale(
    constraint: str, phi: float
) -> None:
    """x = l (1 − cos φ) determines x, however small φ is at the start; l is the scale."""
    text = CLOSE_TO_ZERO.format(constraint=constraint, phi=phi)
    t = lagcli.simulate(lagcli.load_text(text))
    assert t.status == "completed", t.message
    assert (t.freedom["rank"], t.freedom["redundant"]) == (1, [])
    np.testing.assert_allclose(t.q[:, 0], 2 * (1 - np.cos(t.q[:, 1])), atol=1e-12)


@pytest.mark.parametrize("phi", [0.0, 1e-30, 1e-17])
def test_a_gradient_of_rounding_is_none(phi: float) -> None:
    text = CLOSE_TO_ZERO.format(constraint="cos(phi) = 1", phi=phi)
    t = lagcli.simulate(lagcli.load_text(text.replace("phi': 1", "phi': {guess: 1}")))
    assert t.status == "failed"
    assert "the constraint `c` has no gradient there" in t.message
